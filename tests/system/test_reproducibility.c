// The same numbers on every machine, compiler and vector width: results that only
// need addition, multiplication, division and square roots are identical to the bit. The
// hashes below were made on x86-64 and hold on 64-bit ARM. Functions of libm
// (sine, power) may differ in the last bit; no hash here depends on them.
// The solvers of other libraries differ in the ninth digit, which sensor_pose rounds away.
#include "tests/support/test.h"

#include "capture/sensor_pose.h"
#include "recording/depth_codec.h"
#include "reenact/retrieval/frame_selection.h"
#include "tests/support/film.h"

#include <stdlib.h>
#include <string.h>

enum { SEED = 1914, FRAMES = 500, VIEWS = 40 };

static uint64_t hash(uint64_t value, const void *bytes, size_t count) // FNV-1a
{
    for (const uint8_t *b = bytes; count--; b++)
        value = (value ^ *b) * UINT64_C(0x100000001b3);
    return value;
}

static const uint64_t HASH_START = UINT64_C(0xcbf29ce484222325);

static void expect_hash(const char *what, uint64_t value, uint64_t wanted)
{
    if (value != wanted) {
        print_error("%s: the hash is 0x%016llx, wanted 0x%016llx\n", what, (unsigned long long)value,
                    (unsigned long long)wanted);
        fail_test();
    }
}

static double symmetric(struct rng *rng, double most) { return most * (2 * rng_uniform(rng) - 1); }

// One statement each: the order in which the arguments of a call are evaluated is unspecified.
static struct vec3 vector_within(struct rng *rng, double x_most, double y_most, double z_most)
{
    double x = symmetric(rng, x_most), y = symmetric(rng, y_most), z = symmetric(rng, z_most);
    return v3(x, y, z);
}

static struct quat rotation_within(struct rng *rng, double x_most, double y_most, double z_most, double w)
{
    struct vec3 axis = vector_within(rng, x_most, y_most, z_most);
    return quat_unit((struct quat){axis.x, axis.y, axis.z, w});
}

// Moves the joints at random, without a sine.
static void step(struct skeleton *s, struct rng *rng)
{
    for (int j = 0; j < JOINT_COUNT; j++) {
        s->joint[j] = v3_add(s->joint[j], vector_within(rng, 0.03, 0.03, 0.03));
        s->confidence[j] = rng_uniform(rng) < 0.05 ? 0 : 1;
    }
}

static void test_frame_selection(void **state)
{
    (void)state;
    static const struct body body = {.radius_rate = {0.4, 0.4, 0.5, 0.15, 0.12, 0.15, 0.12, 0.17, 0.12, 0.17, 0.12}};
    struct rng rng = {SEED};
    static struct skeleton frames[FRAMES];
    struct skeleton s = {.confidence = {0}};
    for (int j = 0; j < JOINT_COUNT; j++)
        s.joint[j] = v3_add(v3(0, 0, 3), vector_within(&rng, 0.5, 0.9, 0.3));
    struct frame_selector *selector;
    EXPECT_STATUS(frame_selector_open(&selector, FRAMES), OK);
    for (int n = 0; n < FRAMES; n++) {
        step(&s, &rng);
        frames[n] = s;
        EXPECT_STATUS(frame_selector_add(selector, n, &s, &body), OK);
    }
    uint64_t value = HASH_START;
    for (int i = 0; i < VIEWS; i++) {
        struct quat rotation = rotation_within(&rng, 0.2, 1, 0.2, 1);
        struct pose viewer_from_camera = {rotation, v3(0, 0, 1)};
        struct skeleton k = skeleton_transform(viewer_from_camera, &frames[(int)(rng_uniform(&rng) * FRAMES)]);
        for (int p = 0; p <= PART_COUNT; p++) {
            struct frame_selection got = {-1, -1};
            enum status status = p < PART_COUNT ? frame_selector_find_part(selector, &k, (enum part)p, &got)
                                                : frame_selector_find_body(selector, &k, &got);
            EXPECT_TRUE(status >= 0);
            value = hash(value, &got.frame, sizeof got.frame);
            value = hash(value, &got.cost_m, sizeof got.cost_m);
        }
    }
    frame_selector_close(&selector);
    expect_hash("frames chosen and their costs", value, UINT64_C(0x83246c6d5a2f5ffd));
}

static void test_coded_depth(void **state)
{
    (void)state;
    enum { WIDTH = 160, HEIGHT = 120 };
    struct rng rng = {SEED + 1};
    static uint16_t depth[WIDTH * HEIGHT];
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        double z = 1500 + 10 * (i % WIDTH) + 300 * (i / WIDTH > 60) + symmetric(&rng, 4);
        depth[i] = rng_uniform(&rng) < 0.03 ? 0 : (uint16_t)z;
    }
    struct depth_coder *coder;
    const uint8_t *bytes;
    size_t count;
    EXPECT_STATUS(depth_coder_open(&coder), OK);
    EXPECT_STATUS(depth_encode(coder, depth, WIDTH, HEIGHT, &bytes, &count), OK);
    expect_hash("an encoded depth image", hash(HASH_START, bytes, count), UINT64_C(0x96ec1d6e3e51c423));
    depth_coder_close(&coder);
}

static void test_rigid_motions(void **state)
{
    (void)state;
    struct rng rng = {SEED + 2};
    struct pose p = POSE_IDENTITY;
    uint64_t value = HASH_START;
    for (int i = 0; i < 200; i++) {
        struct quat rotation = rotation_within(&rng, 1, 1, 1, 0.5);
        struct pose next = {rotation, vector_within(&rng, 2, 2, 2)};
        p = i % 2 ? pose_multiply(p, next) : pose_multiply(pose_inverse(next), p);
        double m[3][3];
        quat_to_matrix(p.rotation, m);
        p.rotation = quat_unit(quat_from_matrix(m));
        value = hash(value, &p, sizeof p);
    }
    expect_hash("a chain of rigid motions", value, UINT64_C(0x5d0c683adc91743d));
}

static struct pose pose_of_sensor(const struct place *place, const uint8_t *color)
{
    const struct calibration c = world_calibration(1);
    struct sensor_pose *sensor;
    struct pose pose;
    EXPECT_STATUS(sensor_pose_open(&sensor, place, &c), OK);
    EXPECT_STATUS(sensor_pose_update(sensor, color, NULL), OK);
    EXPECT_TRUE(sensor_pose_get(sensor, &pose));
    sensor_pose_close(&sensor);
    return pose;
}

// Another machine's solver, simulated by tags that are moved by some nanometres.
static void test_sensor_pose(void **state)
{
    (void)state;
    struct world *world;
    const struct world_options options = world_default_options();
    EXPECT_STATUS(world_open(&world, &options), OK);
    struct place place = film_true_place(world, 1);
    struct world_shot shot = {world_calibration(1).color, world_sensor_pose(world), 0, false};
    uint8_t *color = malloc(3 * (size_t)shot.lens.width * (size_t)shot.lens.height);
    EXPECT_STATUS(world_render(world, &shot, &(struct world_image){.color = color}), OK);
    struct pose here = pose_of_sensor(&place, color), true_pose = shot.world_from_camera;
    for (int32_t i = 0; i < place.tag_count; i++)
        place.tags[i].world_from_tag.translation.x += 3e-9;
    struct pose moved_pose = pose_of_sensor(&place, color);
    print_message("the sensor at (%.9f, %.9f, %.9f) and (%.9f, %.9f, %.9f)\n", here.translation.x, here.translation.y,
                  here.translation.z, moved_pose.translation.x, moved_pose.translation.y, moved_pose.translation.z);
    EXPECT_TRUE(!memcmp(&here, &moved_pose, sizeof here));
    EXPECT_AT_MOST(v3_distance(here.translation, true_pose.translation), 0.02);
    free(color);
    place_free(&place);
    world_close(&world);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_frame_selection),
        cmocka_unit_test(test_coded_depth),
        cmocka_unit_test(test_rigid_motions),
        cmocka_unit_test(test_sensor_pose),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
