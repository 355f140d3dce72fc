// triangle_visibility_find is conservative: drawn without sampling the frame where it says no, the image is the same.
#include "tests/support/test.h"

#include "reenact/render/avatar_renderer.h"
#include "reenact/skeleton/skeleton_track.h"
#include "tests/support/rehearsed.h"

#include <stdlib.h>
#include <string.h>

enum { W = 320, H = 240, VIEWS = 5, FRAME = 2, ANOTHER = 3 };
static const struct lens lens = {W, H, 270, 270, (W - 1) / 2.0, (H - 1) / 2.0, 0, 0, 0, 0, 0, 0, 0};
static const double PI = 3.14159265358979323846;

static struct rehearsed rehearsed; // its avatar equals the renderer's
static struct gpu *gpu;
static struct gpu_target *target;
static struct avatar_renderer *renderer;

enum says { WHAT_IS_FOUND, ALL_MAY, NONE_MAY };

// Gives the renderer a frame to show. Its cache has no bytes for others, so the previous one is dropped.
static void give(struct frame_layer_loader *loader, int64_t frame, enum says says)
{
    struct frame_layer loaded;
    EXPECT_STATUS(frame_layer_loader_load(loader, frame, &loaded), OK);
    EXPECT_TRUE(loaded.has_images);
    if (says != WHAT_IS_FOUND)
        memset(loaded.triangle_visible, says == ALL_MAY, (size_t)loaded.triangle_count);
    EXPECT_STATUS(avatar_renderer_add_frame(renderer, &loaded), OK);
}

// Draws all views round the actor, the first from the sensor; returns the largest number of draw calls.
static int64_t draw_all(uint8_t *rgba)
{
    struct skeleton_track *motion;
    struct track_sample moment;
    int64_t most = 0;
    const struct take *take = rehearsed.take;
    EXPECT_STATUS(skeleton_track_open(&motion, take, rehearsed.skeletons), OK);
    EXPECT_STATUS(
        skeleton_track_at(motion, take_entry(take, FRAME)->time_ns - take_entry(take, 0)->time_ns, true, &moment), OK);
    skeleton_track_close(&motion);
    EXPECT_INT(moment.frame, FRAME);
    for (int v = 0; v < VIEWS; v++) {
        const struct pose viewer = rehearsed_orbit_pose(&rehearsed, FRAME, 2 * PI * v / VIEWS);
        const struct avatar_view view = {
            .frame = FRAME, .skeleton = moment.skeleton, .world_from_viewer = viewer, .actor = target};
        const int64_t before = gpu_get_counts(gpu).draws;
        struct gpu_box within;
        int parts;
        gpu_target_clear(target);
        EXPECT_STATUS(avatar_renderer_draw(renderer, &view, &parts, &within), OK);
        EXPECT_STATUS(gpu_target_read(target, rgba + 4 * (size_t)(W * H) * (size_t)v), OK);
        most = gpu_get_counts(gpu).draws - before > most ? gpu_get_counts(gpu).draws - before : most;
    }
    return most;
}

// Number of values that differ by more than `by`.
static long differ(const uint8_t *a, const uint8_t *b, int by)
{
    long count = 0;
    for (long i = 0; i < 4L * W * H * VIEWS; i++)
        count += abs(a[i] - b[i]) > by;
    return count;
}

static void test_image_is_unchanged(void **state)
{
    (void)state;
    static uint8_t rgba[3][4 * W * H * VIEWS];
    struct frame_layer_loader *loader;
    EXPECT_STATUS(frame_layer_loader_open(&loader, &rehearsed.source, &rehearsed.avatar), OK);
    for (enum says says = WHAT_IS_FOUND; says <= NONE_MAY; says++) {
        give(loader, FRAME, says);
        EXPECT_AT_MOST(draw_all(rgba[says]), 3);
        give(loader, ANOTHER, WHAT_IS_FOUND);
    }
    frame_layer_loader_close(&loader);
    print_message("%ld values differ from those drawn without the frame\n",
                  differ(rgba[WHAT_IS_FOUND], rgba[NONE_MAY], 1));
    EXPECT_INT(differ(rgba[WHAT_IS_FOUND], rgba[ALL_MAY], 1), 0);          // sums may be rounded differently
    EXPECT_AT_LEAST(differ(rgba[WHAT_IS_FOUND], rgba[NONE_MAY], 1), 4000); // 4959 measured
}

// About half of the actor faces away from the sensor.
static void test_most_triangles_are_not_visible(void **state)
{
    (void)state;
    struct frame_layer_loader *loader;
    struct frame_layer loaded;
    int own = 0;
    EXPECT_STATUS(frame_layer_loader_open(&loader, &rehearsed.source, &rehearsed.avatar), OK);
    EXPECT_STATUS(frame_layer_loader_load(loader, FRAME, &loaded), OK);
    const int count = loaded.triangle_count;
    for (int t = 0; t < count; t++)
        own += loaded.triangle_visible[t];
    print_message("%d of %d triangles may have colours of the frame's own\n", own, count);
    EXPECT_AT_LEAST(own, 0.45 * count);
    EXPECT_AT_MOST(own, 0.55 * count);
    frame_layer_free(&loaded);
    frame_layer_loader_close(&loader);
}

static int make(void **state)
{
    (void)state;
    struct avatar given;
    EXPECT_STATUS(rehearsed_open(&rehearsed, 1), OK);
    EXPECT_STATUS(
        avatar_make(&given, rehearsed.take, rehearsed.rays, &(struct avatar_options){.max_frames = 1, .threads = 4}),
        OK);
    EXPECT_STATUS(gpu_open(&gpu), OK);
    EXPECT_STATUS(gpu_target_open(&target, gpu, W, H), OK);
    EXPECT_STATUS(avatar_renderer_open(&renderer, gpu, &rehearsed.source, &lens, 0), OK);
    EXPECT_STATUS(avatar_renderer_set_avatar(renderer, &given), OK);
    EXPECT_TRUE(avatar_renderer_upload_step(renderer, SIZE_MAX));
    return 0;
}

static int end(void **state)
{
    (void)state;
    avatar_renderer_close(&renderer);
    gpu_target_close(&target);
    gpu_close(&gpu);
    rehearsed_close(&rehearsed);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_image_is_unchanged),
        cmocka_unit_test(test_most_triangles_are_not_visible),
    };
    return cmocka_run_group_tests(tests, make, end);
}
