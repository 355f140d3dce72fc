// A recording gives back what was put in, bit for bit, and answers wrong files
// and wrong names with a status and a sentence.
#include "tests/test.h"

#include "capture/recording/recording.h"
#include "platform/file.h"
#include "platform/jpeg.h"

#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

enum { WIDTH = 61, HEIGHT = 47, COLOR_WIDTH = 80, COLOR_HEIGHT = 60, FRAMES = 40, SEED = 20140601 };

static char folder[64];

static const char *path_of(const char *name)
{
    static char path[2][128];
    static int turn;
    turn = !turn;
    snprintf(path[turn], sizeof path[turn], "%s/%s", folder, name);
    return path[turn];
}

static int make_folder(void **state)
{
    (void)state;
    snprintf(folder, sizeof folder, "/tmp/test_recording.XXXXXX");
    return mkdtemp(folder) ? 0 : -1;
}

static int remove_folder(void **state)
{
    (void)state;
    char command[200];
    snprintf(command, sizeof command, "chmod -R u+w %s; rm -rf %s", folder, folder);
    return system(command);
}

// ------------------------------------------------------------- things to record

static double number(struct dice *dice)
{
    return dice_normal(dice) * 3;
}

static struct pose some_pose(struct dice *dice)
{
    return (struct pose){quat_unit((struct quat){number(dice), number(dice), number(dice), number(dice)}),
                         v3(number(dice), number(dice), -0.0)};
}

static struct calibration some_calibration(void)
{
    return (struct calibration){
        .color = {COLOR_WIDTH, COLOR_HEIGHT, 70.1, 70.2, 39.5, 29.5, 0.1, -0.02, 1e-3, -1e-3, 0.003},
        .depth = {WIDTH, HEIGHT, 55.5, 55.7, 30, 23, 0, 0, 0, 0, 0},
        .color_from_depth = {{0.01, 0.02, 0.03, 0.9993}, {0.025, -1e-3, 1e-4}},
    };
}

static uint8_t *some_jpeg(struct dice *dice, size_t *bytes)
{
    static uint8_t rgb[COLOR_WIDTH * COLOR_HEIGHT * 3];
    for (size_t i = 0; i < sizeof rgb; i++)
        rgb[i] = (uint8_t)(i / 37 + 40 * dice_uniform(dice));
    uint8_t *jpeg;
    assert_int_equal(jpeg_encode(rgb, COLOR_WIDTH, COLOR_HEIGHT, 90, &jpeg, bytes), OK);
    return jpeg;
}

static void some_depth(struct dice *dice, uint16_t *depth)
{
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        depth[i] = (uint16_t)(dice_uniform(dice) < 0.1 ? 0 : dice_uniform(dice) < 0.01 ? 65535 : 2000 + i / 3);
}

static struct place some_place(struct dice *dice)
{
    struct place p = {.calibration = some_calibration(), .rms_px = 0.31, .rms_m = 0.004};
    p.tag_count = 3;
    p.point_count = 1000;
    p.view_count = 3;
    p.tags = calloc((size_t)p.tag_count, sizeof *p.tags);
    p.points = calloc((size_t)p.point_count, sizeof *p.points);
    p.views = calloc((size_t)p.view_count, sizeof *p.views);
    for (int i = 0; i < p.tag_count; i++)
        p.tags[i] = (struct place_tag){7 * i, 0.16, some_pose(dice), number(dice), 5 + i};
    for (int i = 0; i < p.point_count; i++) {
        p.points[i].world = v3(number(dice), number(dice), number(dice));
        for (int k = 0; k < 32; k++)
            p.points[i].descriptor[k] = (uint8_t)(256 * dice_uniform(dice));
    }
    for (int i = 0; i < p.view_count; i++) {
        p.views[i].world_from_camera = some_pose(dice);
        if (i != 1)
            p.views[i].jpeg = some_jpeg(dice, &p.views[i].jpeg_bytes);
        if (i != 2) {
            p.views[i].depth = malloc(WIDTH * HEIGHT * 2);
            some_depth(dice, p.views[i].depth);
        }
    }
    return p;
}

// A frame and the memory it points to. Some pictures are missing on purpose.
struct made {
    struct take_frame frame;
    uint8_t *jpeg;
    uint16_t depth[WIDTH * HEIGHT];
    uint8_t mask[WIDTH * HEIGHT];
};

static void make_frame(struct made *m, int index)
{
    struct dice dice = {SEED + (uint64_t)index};
    memset(m, 0, sizeof *m);
    m->frame.time_ns = -5 + index * INT64_C(33333333);
    m->frame.world_from_camera = some_pose(&dice);
    m->frame.located = index % 3 == 0;
    some_depth(&dice, m->depth);
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        m->mask[i] = (i % WIDTH - 30) * (i % WIDTH - 30) + (i / WIDTH - 20) * (i / WIDTH - 20) < 150 + index;
    m->jpeg = some_jpeg(&dice, &m->frame.jpeg_bytes);
    m->frame.jpeg = index % 7 == 3 ? NULL : m->jpeg;
    m->frame.depth = index % 7 == 4 ? NULL : m->depth;
    m->frame.mask = index % 7 == 5 ? NULL : m->mask;
    if (index % 7 == 6)
        m->frame.jpeg = NULL, m->frame.depth = NULL, m->frame.mask = NULL;
    m->frame.has_skeleton = index % 5 != 2;
    for (int j = 0; j < JOINT_COUNT; j++) {
        m->frame.skeleton.joint[j] = v3(number(&dice), number(&dice), number(&dice));
        m->frame.skeleton.confidence[j] = (float)(j % 3) / 2;
    }
}

static void add_frames(struct recording_writer *w, int from, int to)
{
    static struct made m;
    for (int i = from; i < to; i++) {
        make_frame(&m, i);
        EXPECT_STATUS(recording_add_frame(w, &m.frame), OK);
        free(m.jpeg);
    }
}

static const struct body some_body = {
    .representative_frame = 17,
    .radius_rate = {0.3, 0.5, 0.45, 0.2, 0.19, 0, 0.18, 0.21, 0.2, 0.2, 0.1},
};

// Two takes and a place; the second take stays open.
static void write_recording(const char *path)
{
    struct dice dice = {SEED};
    struct place place = some_place(&dice);
    struct calibration calibration = some_calibration();
    struct recording_writer *w;
    EXPECT_STATUS(recording_create(&w, path), OK);
    EXPECT_STATUS(recording_put_place(w, &place), OK);
    place.rms_px = 0.25;
    EXPECT_STATUS(recording_put_place(w, &place), OK); // replaces
    EXPECT_STATUS(recording_begin_take(w, "höher", &calibration), OK);
    add_frames(w, 0, FRAMES / 2);
    struct body body = some_body;
    body.representative_frame = 3;
    EXPECT_STATUS(recording_put_body(w, &body), OK);
    add_frames(w, FRAMES / 2, FRAMES);
    EXPECT_STATUS(recording_put_body(w, &some_body), OK);
    EXPECT_STATUS(recording_put_dropped(w, 12), OK);
    EXPECT_STATUS(recording_end_take(w), OK);
    EXPECT_STATUS(recording_begin_take(w, "second", &calibration), OK);
    add_frames(w, 0, 3);
    EXPECT_STATUS(recording_close(&w), OK);
    EXPECT_TRUE(w == NULL);
    place_free(&place);
}

// ------------------------------------------------------------- round trip

static void same_bytes(const void *a, const void *b, size_t count)
{
    EXPECT_INT(a != NULL, b != NULL);
    if (a)
        assert_memory_equal(a, b, count);
}

static void same_place(const struct place *a, const struct place *b)
{
    same_bytes(&a->calibration.color, &b->calibration.color, sizeof a->calibration.color);
    same_bytes(&a->calibration.color_from_depth, &b->calibration.color_from_depth, sizeof(struct pose));
    EXPECT_INT(a->calibration.registered, b->calibration.registered);
    EXPECT_INT(a->tag_count, b->tag_count);
    EXPECT_INT(a->point_count, b->point_count);
    EXPECT_INT(a->view_count, b->view_count);
    for (int i = 0; i < a->tag_count; i++) {
        EXPECT_INT(a->tags[i].id, b->tags[i].id);
        EXPECT_INT(a->tags[i].sightings, b->tags[i].sightings);
        same_bytes(&a->tags[i].world_from_tag, &b->tags[i].world_from_tag, sizeof(struct pose));
        EXPECT_NEAR(a->tags[i].side_m, b->tags[i].side_m, 0);
        EXPECT_NEAR(a->tags[i].rms_px, b->tags[i].rms_px, 0);
    }
    same_bytes(a->points, b->points, (size_t)a->point_count * sizeof *a->points);
    for (int i = 0; i < a->view_count; i++) {
        same_bytes(&a->views[i].world_from_camera, &b->views[i].world_from_camera, sizeof(struct pose));
        EXPECT_INT(a->views[i].jpeg_bytes, b->views[i].jpeg_bytes);
        same_bytes(a->views[i].jpeg, b->views[i].jpeg, a->views[i].jpeg_bytes);
        same_bytes(a->views[i].depth, b->views[i].depth, WIDTH * HEIGHT * 2);
    }
    EXPECT_NEAR(b->rms_px, 0.25, 0);
    EXPECT_NEAR(a->rms_m, b->rms_m, 0);
}

static void same_frame(struct take *t, int index)
{
    static struct made m;
    static uint8_t rgb[COLOR_WIDTH * COLOR_HEIGHT * 3];
    make_frame(&m, index);
    const struct take_entry *e = take_entry(t, index);
    EXPECT_INT(e->time_ns, m.frame.time_ns);
    EXPECT_INT(e->located, m.frame.located);
    EXPECT_INT(e->has_skeleton, m.frame.has_skeleton);
    same_bytes(&e->world_from_camera, &m.frame.world_from_camera, sizeof(struct pose));
    if (e->has_skeleton) {
        same_bytes(e->skeleton.joint, m.frame.skeleton.joint, sizeof e->skeleton.joint);
        same_bytes(e->skeleton.confidence, m.frame.skeleton.confidence, sizeof e->skeleton.confidence);
    }
    struct take_pictures p;
    EXPECT_STATUS(take_read(t, index, TAKE_COLOR | TAKE_DEPTH | TAKE_MASK, &p), OK);
    same_bytes(m.frame.depth, p.depth, sizeof m.depth);
    same_bytes(m.frame.mask, p.mask, sizeof m.mask);
    if (m.frame.jpeg)
        EXPECT_STATUS(jpeg_decode(m.jpeg, m.frame.jpeg_bytes, rgb, COLOR_WIDTH, COLOR_HEIGHT), OK);
    same_bytes(m.frame.jpeg ? rgb : NULL, p.color, sizeof rgb);
    free(m.jpeg);
}

static void test_round_trip(void **state)
{
    (void)state;
    const char *path = path_of("round");
    write_recording(path);
    EXPECT_TRUE(!file_exists(path_of("round-wal")));
    EXPECT_TRUE(!file_exists(path_of("round-shm")));
    path = path_of("round");

    struct recording *r;
    EXPECT_STATUS(recording_open(&r, path), OK);
    struct dice dice = {SEED};
    struct place wanted = some_place(&dice), got;
    EXPECT_STATUS(recording_read_place(r, &got), OK);
    same_place(&wanted, &got);
    place_free(&wanted);
    place_free(&got);

    EXPECT_INT(recording_take_count(r), 2);
    assert_string_equal(recording_take_name(r, 0), "höher");
    assert_string_equal(recording_take_name(r, 1), "second");
    struct take *t;
    EXPECT_STATUS(take_open(&t, r, "höher"), OK);
    EXPECT_INT(take_frame_count(t), FRAMES);
    EXPECT_TRUE(take_is_complete(t));
    EXPECT_INT(take_dropped(t), 12);
    EXPECT_INT(take_body(t)->representative_frame, 17);
    same_bytes(take_body(t)->radius_rate, some_body.radius_rate, sizeof some_body.radius_rate);
    EXPECT_NEAR(take_calibration(t)->color.k3, 0.003, 0);
    for (int i = FRAMES - 1; i >= 0; i--)
        same_frame(t, i);
    struct take_pictures p;
    EXPECT_STATUS(take_read(t, 0, TAKE_DEPTH, &p), OK);
    EXPECT_TRUE(p.depth && !p.color && !p.mask);
    take_close(&t);
    EXPECT_STATUS(take_open(&t, r, "second"), OK);
    EXPECT_TRUE(!take_is_complete(t));
    EXPECT_INT(take_frame_count(t), 3);
    EXPECT_INT(take_body(t)->representative_frame, -1);
    take_close(&t);
    take_close(&t);
    recording_free(&r);
    recording_free(&r);
}

int main(void)
{
    printf("seed %d\n", SEED);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_round_trip),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
