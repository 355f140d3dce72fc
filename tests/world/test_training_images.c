// Training images: the truth belongs to the picture, every kind occurs, and the same seed gives the same bytes.
#include "tests/support/test.h"

#include "tests/support/scratch.h"
#include "tests/world/training/training_crop.h"
#include "tests/world/training/training_figure.h"

#include <stdlib.h>
#include <string.h>

enum { FIGURES = 4, SEED = 5 };

static struct training_people people;
static struct training_renderer *renderer;
static struct training_image *image, *again;

static int set_up(void **state)
{
    (void)state;
    EXPECT_STATUS(training_people_open(&people, &(struct training_people_wish){.seed = SEED, .figures = FIGURES}), OK);
    EXPECT_STATUS(training_renderer_open(&renderer, &people), OK);
    image = malloc(sizeof *image);
    again = malloc(sizeof *again);
    assert_non_null(image);
    assert_non_null(again);
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    training_renderer_close(&renderer);
    training_people_close(&people);
    free(image);
    free(again);
    return 0;
}

static void render(int index, struct training_scene *scene, struct training_image *out)
{
    training_scene_draw(&people, SEED, index, scene);
    EXPECT_STATUS(training_image_render(renderer, scene, out), OK);
}

// Whatever was drawn before.
static void test_the_same_seed_gives_the_same(void **state)
{
    (void)state;
    static const int order[] = {7, 3, 12, 3, 7};
    struct training_scene scene;
    uint16_t depth[2][64];
    for (size_t i = 0; i < COUNT_OF(order); i++) {
        render(order[i], &scene, image);
        render(order[i], &scene, again);
        const size_t pixels = (size_t)image->width * (size_t)image->height;
        EXPECT_TRUE(!memcmp(image->depth, again->depth, 2 * pixels) && !memcmp(image->part, again->part, pixels));
        if (order[i] == 3)
            memcpy(depth[i > 1], image->depth + pixels / 2, sizeof depth[0]);
    }
    EXPECT_TRUE(!memcmp(depth[0], depth[1], sizeof depth[0]));
}

// A joint that is seen lies behind the skin in its pixel, no deeper than the body is thick there; its part's pixels are
// about it.
static void test_joints_are_in_the_body(void **state)
{
    (void)state;
    enum { IMAGES = 150 };
    int seen = 0, deep = 0, hidden = 0;
    for (int i = 0; i < IMAGES; i++) {
        struct training_scene scene;
        render(i, &scene, image);
        for (int j = 0; j < JOINT_COUNT && image->person; j++) {
            const struct vec3 p = image->joints.joint[j];
            hidden += image->joints.confidence[j] > 0 && image->joints.confidence[j] < 1;
            if (image->joints.confidence[j] < 1)
                continue;
            const int x = (int)lround(scene.lens.fx * p.x / p.z + scene.lens.cx),
                      y = (int)lround(scene.lens.fy * p.y / p.z + scene.lens.cy);
            const int part = image->part[y * image->width + x], mm = image->depth[y * image->width + x];
            EXPECT_TRUE(part != TRAINING_NOTHING && part != TRAINING_OTHER);
            seen++;
            deep += mm && fabs(p.z - 1e-3 * mm) > 0.3;
        }
    }
    print_message("seed %d: of %d joints that are seen %d are 30 cm from their pixel's reading; %d are hidden\n", SEED,
                  seen, deep, hidden);
    EXPECT_AT_LEAST(seen, 5 * IMAGES);
    EXPECT_AT_LEAST(hidden, IMAGES);
    EXPECT_AT_MOST(deep, seen / 20); // noise reads beside an arm; 1.5 % seen
}

static void test_every_kind_occurs(void **state)
{
    (void)state;
    enum { IMAGES = 900 };
    int posture[POSTURES + 1] = {0}, sensor[TRAINING_SENSORS] = {0}, without = 0, two = 0, turned = 0;
    for (int i = 0; i < IMAGES; i++) {
        struct training_scene scene;
        training_scene_draw(&people, SEED, i, &scene);
        sensor[scene.sensor]++;
        without += !scene.person_count;
        two += scene.person_count > 1;
        if (scene.person_count)
            posture[scene.person[0].posture]++;
        const struct vec3 right = quat_rotate(scene.world_from_camera.rotation, v3(1, 0, 0));
        turned += fabs(right.z) > 0.6;
    }
    for (int k = 0; k < POSTURES; k++)
        EXPECT_AT_LEAST(posture[k], IMAGES / 40);
    EXPECT_INT(posture[POSTURES], 0); // there are no motions
    for (int k = 0; k < TRAINING_SENSORS; k++)
        EXPECT_AT_LEAST(sensor[k], IMAGES / 6);
    EXPECT_TRUE(without > IMAGES / 25 && without < IMAGES / 6);
    EXPECT_TRUE(two > IMAGES / 15 && two < IMAGES / 4);
    EXPECT_TRUE(turned > IMAGES / 20 && turned < IMAGES / 5);
}

// No person is in it: no part, no joint.
static void test_no_person(void **state)
{
    (void)state;
    int empty = 0;
    for (int i = 0; i < 60; i++) {
        struct training_scene scene;
        training_scene_draw(&people, SEED, i, &scene);
        if (scene.person_count)
            continue;
        EXPECT_STATUS(training_image_render(renderer, &scene, image), OK);
        empty++;
        EXPECT_TRUE(!image->person);
        for (int k = 0; k < image->width * image->height; k++)
            EXPECT_INT(image->part[k], TRAINING_NOTHING);
        for (int j = 0; j < JOINT_COUNT; j++)
            EXPECT_NEAR(image->joints.confidence[j], 0, 0);
    }
    EXPECT_AT_LEAST(empty, 1);
}

// The joints that are seen are in their cells' readings, the person's middle is near the waist.
static void test_crops_show_the_person(void **state)
{
    (void)state;
    struct training_crop crop;
    int made = 0, without = 0, seen = 0, inside = 0;
    for (int i = 0; i < 120; i++) {
        struct training_scene scene;
        render(i, &scene, image);
        if (!training_crop_make(&scene, image, &crop))
            continue;
        made++;
        without += !crop.person;
        for (int j = 0; j < JOINT_COUNT && crop.person; j++) {
            const float *p = crop.joint[j];
            const double u = ((double)(crop.fx * p[0] / p[2] + crop.cx) + 0.5 - (double)crop.left_px) /
                             (double)crop.cell_px,
                         v = ((double)(crop.fy * p[1] / p[2] + crop.cy) + 0.5 - (double)crop.top_px) /
                             (double)crop.cell_px;
            if (p[3] < 1)
                continue;
            seen++;
            if (u < 0 || v < 0 || u >= CROP_CELLS || v >= CROP_CELLS)
                continue;
            const int part = crop.part[(int)v * CROP_CELLS + (int)u];
            inside += part != TRAINING_NOTHING && part != TRAINING_OTHER;
        }
        if (crop.person)
            EXPECT_NEAR(crop.middle_m, crop.joint[JOINT_WAIST][2], 0.6);
    }
    print_message("%d crops, %d without a person; %d of %d joints that are seen are in the body's cells\n", made,
                  without, inside, seen);
    EXPECT_AT_LEAST(made, 80);
    EXPECT_AT_LEAST(without, 3);
    EXPECT_AT_LEAST(inside, seen * 9 / 10);
}

// A ball at a known place, and the floor before it.
static void test_solids_are_where_they_are(void **state)
{
    (void)state;
    struct training_scene scene = {
        .sensor = TRAINING_TIME_OF_FLIGHT,
        .lens = {.width = 160, .height = 120, .fx = 131, .fy = 131, .cx = 79.5, .cy = 59.5},
        .world_from_camera = {{-0.7071067811865476, 0, 0, 0.7071067811865476}, {0, -3, 1}}, // looks along y, level
        .noise_seed = 3,
        .solid = {{.kind = SOLID_ROD, .at = {0, 0, 1}, .to = {0, 0, 1}, .radius_m = 0.3},
                  {.kind = SOLID_BOX, .at = {1, 0, 1}, .half = {0.2, 0.2, 0.2}}},
        .solid_count = 2,
    };
    EXPECT_STATUS(training_image_render(renderer, &scene, image), OK);
    EXPECT_NEAR(image->depth[60 * 160 + 80], 2700, 30);
    EXPECT_NEAR(image->depth[60 * 160 + 80 + 47], 2800, 30);
    EXPECT_NEAR(image->depth[110 * 160 + 20], 1000 * 131 / 50.5, 60); // the floor, 1 m below
}

// ---------------------------------------------------------------- figures of another program

struct bytes {
    uint8_t *at;
    size_t count;
};

static void append(struct bytes *bytes, const void *from, size_t count)
{
    memcpy(bytes->at + bytes->count, from, count);
    bytes->count += count;
}

static void append_point(struct bytes *bytes, struct vec3 p) { append(bytes, &(double[3]){p.x, p.y, p.z}, 24); }

// As training_figure.h has it. Free with free.
static struct bytes figure_file(const struct figure *figure)
{
    const struct physique *physique = &figure->physique;
    const int32_t counts[2] = {figure->mesh.vertex_count, figure->mesh.triangle_count};
    struct bytes file = {malloc(1000 + 60 * (size_t)counts[0] + 12 * (size_t)counts[1]), 0};
    assert_non_null(file.at);
    append(&file, "RFG1", 4);
    append(&file, counts, sizeof counts);
    append(&file, &(double[3]){physique->figure.height_m, physique->figure.woman, physique->girth}, 24);
    for (int j = 0; j < JOINT_COUNT; j++)
        append_point(&file, physique->bind_joint[j]);
    append_point(&file, physique->wrist[LEFT]);
    append_point(&file, physique->wrist[RIGHT]);
    append_point(&file, physique->skull);
    append_point(&file, physique->arm);
    append(&file, figure->joint_radius, sizeof figure->joint_radius);
    append(&file, figure->mesh.at, (size_t)counts[0] * sizeof *figure->mesh.at);
    append(&file, figure->mesh.normal, (size_t)counts[0] * sizeof *figure->mesh.normal);
    for (int32_t i = 0; i < counts[0]; i++)
        append(&file, figure->bindings[i].weight, sizeof figure->bindings[i].weight);
    for (int32_t i = 0; i < counts[0]; i++)
        append(&file, figure->bindings[i].bone, sizeof figure->bindings[i].bone);
    append(&file, figure->mesh.triangles, (size_t)counts[1] * sizeof *figure->mesh.triangles);
    return file;
}

// One of figure.h's own, written and read, is the same in any image.
static void test_figure_is_read_as_it_is(void **state)
{
    (void)state;
    struct scratch scratch = scratch_make();
    struct figure *const own = &people.figures[0], other, kept = *own;
    struct bytes file = figure_file(own);
    scratch_write(&scratch, "a.figure", file.at, file.count);
    EXPECT_STATUS(training_figure_read(&other, scratch_file(&scratch, "a.figure")), OK);
    EXPECT_NEAR(other.physique.thigh_m, own->physique.thigh_m, 1e-9);
    EXPECT_NEAR(other.physique.forearm_m, own->physique.forearm_m, 1e-9);
    struct scene_sums {
        uint64_t depth, part;
    } sums[2] = {{0, 0}, {0, 0}};
    for (int which = 0; which < 2; which++) {
        *own = which ? other : kept;
        for (int i = 0; i < 30; i++) {
            struct training_scene scene;
            render(i, &scene, image);
            for (int k = 0; k < image->width * image->height; k++) {
                sums[which].depth = sums[which].depth * 31 + image->depth[k];
                sums[which].part = sums[which].part * 31 + image->part[k];
            }
        }
    }
    *own = kept;
    EXPECT_TRUE(sums[0].depth == sums[1].depth && sums[0].part == sums[1].part);
    figure_free(&other);
    free(file.at);
    scratch_remove(&scratch);
}

// Cut short anywhere, or with numbers that cannot be: a sentence.
static void test_damaged_figures_are_refused(void **state)
{
    (void)state;
    struct scratch scratch = scratch_make();
    struct figure figure;
    struct bytes file = figure_file(&people.figures[0]);
    const size_t numbers = 12 + 8 * (3 + 3 * (JOINT_COUNT + 4) + JOINT_COUNT),
                 bones = numbers + 36 * (size_t)people.figures[0].mesh.vertex_count;
    for (size_t count = 0; count < file.count; count += 1 + file.count / 37) {
        scratch_write(&scratch, "cut.figure", file.at, count);
        EXPECT_STATUS(training_figure_read(&figure, scratch_file(&scratch, "cut.figure")), ERR_CORRUPT);
    }
    // The magic, the counts, the height, a joint, a weight, a bone, a triangle.
    const size_t places[] = {
        0, 7, 11, 19, 12 + 8 * 20 + 7, numbers + 2 * (bones - numbers) / 3 + 3, bones, file.count - 1};
    for (size_t i = 0; i < COUNT_OF(places); i++) {
        const uint8_t before = file.at[places[i]];
        file.at[places[i]] = 0xff;
        scratch_write(&scratch, "odd.figure", file.at, file.count);
        EXPECT_STATUS(training_figure_read(&figure, scratch_file(&scratch, "odd.figure")), ERR_CORRUPT);
        file.at[places[i]] = before;
    }
    EXPECT_STATUS(training_figure_read(&figure, scratch_file(&scratch, "none.figure")), ERR_MISSING);
    free(file.at);
    scratch_remove(&scratch);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_the_same_seed_gives_the_same),
        cmocka_unit_test(test_joints_are_in_the_body),
        cmocka_unit_test(test_every_kind_occurs),
        cmocka_unit_test(test_no_person),
        cmocka_unit_test(test_solids_are_where_they_are),
        cmocka_unit_test(test_crops_show_the_person),
        cmocka_unit_test(test_figure_is_read_as_it_is),
        cmocka_unit_test(test_damaged_figures_are_refused),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
