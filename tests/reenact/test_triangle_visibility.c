// Triangles that have nothing of the shown frame's own are told from those that may: drawn without looking into the
// frame, the picture is the same.
#include "tests/support/test.h"

#include "reenact/render/avatar_renderer.h"
#include "reenact/skeleton/skeleton_track.h"
#include "tests/support/rehearsed.h"

#include <stdlib.h>
#include <string.h>

enum { W = 320, H = 240, VIEWS = 5, FRAME = 2, ANOTHER = 3 };
static const struct lens lens = {W, H, 270, 270, (W - 1) / 2.0, (H - 1) / 2.0, 0, 0, 0, 0, 0, 0, 0};
static const double PI = 3.14159265358979323846;

static struct rehearsed rehearsed; // its likeness is as the painter's
static struct gpu *gpu;
static struct gpu_target *target;
static struct likeness_painter *painter;

enum says { WHAT_IS_FOUND, ALL_MAY, NONE_MAY };

// A frame that the painter then shows. With no bytes to keep others in, the one before it goes.
static void give(struct frame_loader *loader, int64_t frame, enum says says)
{
    struct loaded_frame loaded;
    EXPECT_STATUS(frame_loader_load(loader, frame, &loaded), OK);
    EXPECT_TRUE(loaded.seen);
    if (says != WHAT_IS_FOUND)
        memset(loaded.own, says == ALL_MAY, (size_t)loaded.triangle_count);
    EXPECT_STATUS(likeness_painter_give_frame(painter, &loaded), OK);
}

// From all round, the first from where the sensor stood; how many calls a picture took at most.
static int64_t draw_all(uint8_t *rgba)
{
    struct motion *motion;
    struct moment moment;
    int64_t most = 0;
    const struct take *take = rehearsed.take;
    EXPECT_STATUS(motion_open(&motion, take), OK);
    EXPECT_STATUS(motion_at(motion, take_entry(take, FRAME)->time_ns - take_entry(take, 0)->time_ns, true, &moment),
                  OK);
    motion_close(&motion);
    EXPECT_INT(moment.frame, FRAME);
    for (int v = 0; v < VIEWS; v++) {
        const struct pose viewer = rehearsed_round(&rehearsed, FRAME, 2 * PI * v / VIEWS);
        const struct likeness_view view = {FRAME, moment.skeleton, viewer, target, NULL, NULL};
        const int64_t before = gpu_count(gpu).draws;
        struct gpu_box within;
        int parts;
        gpu_target_clear(target);
        EXPECT_STATUS(likeness_painter_draw(painter, &view, &parts, &within), OK);
        EXPECT_STATUS(gpu_target_read(target, rgba + 4 * (size_t)(W * H) * (size_t)v), OK);
        most = gpu_count(gpu).draws - before > most ? gpu_count(gpu).draws - before : most;
    }
    return most;
}

// How many of the pictures' values differ by more than `by`.
static long differ(const uint8_t *a, const uint8_t *b, int by)
{
    long count = 0;
    for (long i = 0; i < 4L * W * H * VIEWS; i++)
        count += abs(a[i] - b[i]) > by;
    return count;
}

static void the_picture_is_the_same(void **state)
{
    (void)state;
    static uint8_t rgba[3][4 * W * H * VIEWS];
    struct frame_loader *loader;
    EXPECT_STATUS(frame_loader_open(&loader, rehearsed.take, rehearsed.rays, &rehearsed.likeness), OK);
    for (enum says says = WHAT_IS_FOUND; says <= NONE_MAY; says++) {
        give(loader, FRAME, says);
        EXPECT_AT_MOST(draw_all(rgba[says]), 3);
        give(loader, ANOTHER, WHAT_IS_FOUND);
    }
    frame_loader_close(&loader);
    print_message("%ld values differ from those drawn without the frame\n",
                  differ(rgba[WHAT_IS_FOUND], rgba[NONE_MAY], 1));
    EXPECT_INT(differ(rgba[WHAT_IS_FOUND], rgba[ALL_MAY], 1), 0); // the sum may be rounded otherwise
    EXPECT_AT_LEAST(differ(rgba[WHAT_IS_FOUND], rgba[NONE_MAY], 1), 2000);
}

// Of a person half of whom is turned away from the sensor.
static void most_have_nothing_of_the_frame(void **state)
{
    (void)state;
    struct frame_loader *loader;
    struct loaded_frame loaded;
    int own = 0;
    EXPECT_STATUS(frame_loader_open(&loader, rehearsed.take, rehearsed.rays, &rehearsed.likeness), OK);
    EXPECT_STATUS(frame_loader_load(loader, FRAME, &loaded), OK);
    const int count = loaded.triangle_count;
    for (int t = 0; t < count; t++)
        own += loaded.own[t];
    print_message("%d of %d triangles may have colours of the frame's own\n", own, count);
    EXPECT_AT_LEAST(own, 0.1 * count);
    EXPECT_AT_MOST(own, 0.55 * count);
    loaded_frame_free(&loaded);
    frame_loader_close(&loader);
}

static int make(void **state)
{
    (void)state;
    struct likeness given;
    EXPECT_STATUS(rehearsed_open(&rehearsed, 1), OK);
    EXPECT_STATUS(likeness_make(&given, rehearsed.take, rehearsed.rays, 1, NULL), OK);
    EXPECT_STATUS(gpu_open(&gpu), OK);
    EXPECT_STATUS(gpu_target_open(&target, gpu, W, H), OK);
    EXPECT_STATUS(likeness_painter_open(&painter, gpu, rehearsed.take, rehearsed.rays, &lens, 0), OK);
    EXPECT_STATUS(likeness_painter_give(painter, &given), OK);
    EXPECT_TRUE(likeness_painter_bring(painter, SIZE_MAX));
    return 0;
}

static int end(void **state)
{
    (void)state;
    likeness_painter_close(&painter);
    gpu_target_close(&target);
    gpu_close(&gpu);
    rehearsed_close(&rehearsed);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_picture_is_the_same),
        cmocka_unit_test(most_have_nothing_of_the_frame),
    };
    return cmocka_run_group_tests(tests, make, end);
}
