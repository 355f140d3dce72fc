// GPU costs of drawing, in the small world: few calls; nothing allocated, compiled or
// uploaded for what has not changed; memory within the documented bound.
#include "tests/support/test.h"

#include "reenact/render/actor_renderer.h"
#include "tests/support/compiled.h"
#include "tests/support/rehearsed.h"
#include "tests/support/retake.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// Numbers of views; fewer where drawing is emulated.
#ifdef EMULATED
enum { ROUND = 6, SIDES = 1 };
#else
enum { ROUND = 20, SIDES = 3 };
#endif

static struct rehearsed rehearsed;
static struct take *take; // of `rehearsed`
static struct gpu *gpu;
static struct renderer *of_one_frame; // keeps one frame layer; shared by three tests
static const struct lens lens = {320, 200, 260, 260, 159.5, 99.5, 0, 0, 0, 0, 0, 0, 0};

static struct pose orbit_pose(double angle) { return rehearsed_orbit_pose(&rehearsed, 0, angle); }

static struct renderer *renderer_at(enum detail detail, size_t texture_bytes)
{
    struct renderer_options o = renderer_default_options();
    struct renderer *p;
    struct place place;
    struct occluder_mesh room;
    o.detail = detail;
    o.texture_bytes = texture_bytes;
    o.shadow = o.sources = true;
    EXPECT_STATUS(renderer_open(&p, gpu, take, &lens, &o), OK);
    EXPECT_STATUS(recording_read_place(rehearsed.recording, &place), OK);
    if (occluder_mesh_make(&room, &place, take, NULL) == OK)
        EXPECT_STATUS(renderer_set_room(p, &room), OK);
    place_free(&place);
    return p;
}

static void draw(struct renderer *p, int64_t time_ns, double angle, const uint8_t *color)
{
    const struct pose viewer = orbit_pose(angle);
    const struct affine_map viewer_from_room = affine_from_pose(pose_inverse(viewer));
    struct renderer_view view = {
        .world_from_camera = viewer, .time_ns = time_ns, .color = color, .viewer_from_room = &viewer_from_room};
    struct renderer_result result;
    EXPECT_STATUS(renderer_draw(p, &view, &result), OK);
    EXPECT_AT_LEAST(result.parts, 8);
}

static void test_few_draw_calls_and_no_reupload(void **state)
{
    (void)state;
    uint8_t *grey = malloc((size_t)lens.width * (size_t)lens.height * 3);
    memset(grey, 128, (size_t)lens.width * (size_t)lens.height * 3);
    struct renderer *p = renderer_at(DETAIL_FULL, (size_t)64 << 20);
    renderer_set_sources(p, false);
    draw(p, 0, 0, grey);
    struct gpu_counts before = gpu_get_counts(gpu);
    for (int i = 1; i <= ROUND; i++) {
        draw(p, 0, 0.3 * i, grey);
        struct gpu_counts now = gpu_get_counts(gpu);
        EXPECT_AT_MOST(now.draws - before.draws, 6);
        EXPECT_INT(now.uploads - before.uploads, 3); // the camera image, the visible vertices, the triangles
        EXPECT_INT(now.made, before.made);
        before = now;
    }
    draw(p, take_entry(take, 2)->time_ns - take_entry(take, 0)->time_ns, 0, grey);
    struct gpu_counts now = gpu_get_counts(gpu);
    print_message("%lld draw calls and %lld uploads for another frame\n", (long long)(now.draws - before.draws),
                  (long long)(now.uploads - before.uploads));
    EXPECT_INT(now.uploads - before.uploads, 5); // and the frame's colour and depth
    draw(p, 0, 0, grey);
    before = now;
    now = gpu_get_counts(gpu);
    EXPECT_INT(now.uploads - before.uploads, 3); // both frames are resident
    EXPECT_INT(now.made, before.made);
    renderer_close(&p);
    free(grey);
}

// Draws the actor at that frame; returns the number of uploads.
static int64_t draw_frame(struct renderer *p, int64_t frame, uint8_t *actor)
{
    int64_t before = gpu_get_counts(gpu).uploads;
    draw(p, take_entry(take, frame)->time_ns - take_entry(take, 0)->time_ns, 0.4, NULL);
    int64_t uploads = gpu_get_counts(gpu).uploads - before;
    EXPECT_STATUS(renderer_read_actor(p, actor), OK);
    return uploads;
}

// A prefetched frame is not loaded again, and its image is the same byte for byte.
static void test_prefetched_image_is_identical(void **state)
{
    (void)state;
    const size_t bytes = (size_t)lens.width * (size_t)lens.height * 4;
    uint8_t *loaded_image = malloc(bytes), *other = malloc(bytes), *prefetched_image = malloc(bytes);
    struct renderer *p = of_one_frame;
    struct frame_layer_loader *loader;
    struct frame_layer loaded;
    int64_t loading = draw_frame(p, 3, loaded_image);
    draw_frame(p, 2, other);
    EXPECT_TRUE(renderer_nearest_resident_frame(p, 3, 0) < 0 && renderer_nearest_resident_frame(p, 2, 0) == 2);
    EXPECT_STATUS(frame_layer_loader_open(&loader, &rehearsed.source, renderer_avatar(p)), OK);
    EXPECT_STATUS(frame_layer_loader_load(loader, 3, &loaded), OK);
    EXPECT_STATUS(renderer_add_frame(p, &loaded), OK);
    EXPECT_TRUE(!loaded.shift); // the renderer took over its contents
    EXPECT_INT(renderer_nearest_resident_frame(p, 3, 0), 3);
    EXPECT_INT(loading - draw_frame(p, 3, prefetched_image), 2); // colour and depth are resident
    EXPECT_TRUE(memcmp(loaded_image, other, bytes));
    EXPECT_TRUE(!memcmp(loaded_image, prefetched_image, bytes));
    frame_layer_loader_close(&loader);
    free(loaded_image);
    free(other);
    free(prefetched_image);
}

// Reduces the mask to *columns columns in its middle.
static void narrow(void *self, struct retaken *f)
{
    const int *columns = self;
    int left = f->width, right = -1;
    for (int p = 0; p < f->width * f->height; p++)
        if (f->mask[p])
            left = p % f->width < left ? p % f->width : left, right = p % f->width > right ? p % f->width : right;
    const int first = (left + right - *columns) / 2;
    for (int p = 0; p < f->width * f->height; p++)
        f->mask[p] &= p % f->width >= first && p % f->width < first + *columns;
}

static bool power_of_two(int side) { return !(side & (side - 1)); }

// For a texture with such a side software rasterisers would compile programs once more, during playback.
static void test_no_texture_side_is_power_of_two(void **state)
{
    (void)state;
    bool tested = false;
    for (int columns = 14; columns <= 20; columns++) {
        char name[32];
        struct recording *recording;
        struct take *of;
        struct take_skeletons *skeletons;
        struct frame_layer_loader *loader;
        struct frame_layer f;
        snprintf(name, sizeof name, "%d columns", columns);
        retake(rehearsed.rehearsal.file, "turn", name, narrow, &columns);
        EXPECT_STATUS(recording_open(&recording, rehearsed.rehearsal.file), OK);
        EXPECT_STATUS(take_open(&of, recording, name), OK);
        EXPECT_STATUS(take_skeletons_open(&skeletons, of), OK);
        const struct frame_source source = {of, skeletons, rehearsed.rays};
        EXPECT_STATUS(frame_layer_loader_open(&loader, &source, renderer_avatar(of_one_frame)), OK);
        EXPECT_STATUS(frame_layer_loader_load(loader, 3, &f), OK);
        EXPECT_TRUE(f.has_images);
        print_message("%d columns: colours %d x %d, depth %d x %d\n", columns, f.color.width, f.color.height,
                      f.depth.width, f.depth.height);
        EXPECT_TRUE(!power_of_two(f.color.width) && !power_of_two(f.color.height));
        EXPECT_TRUE(!power_of_two(f.depth.width) && !power_of_two(f.depth.height));
        tested |= f.color.width == 17;
        frame_layer_free(&f);
        frame_layer_loader_close(&loader);
        take_skeletons_close(&skeletons);
        take_close(&of);
        recording_free(&recording);
    }
    EXPECT_TRUE(tested); // a width that would have been 16
}

static int pixels_of(const uint8_t *rgba, struct gpu_box within)
{
    int count = 0;
    for (int y = 0; y < lens.height; y++)
        for (int x = 0; x < lens.width; x++)
            count += rgba[4 * (y * lens.width + x) + 3] > 0 && x >= within.left && x < within.left + within.width &&
                     y >= within.top && y < within.top + within.height;
    return count;
}

// With view.within_ns a frame that is not resident is drawn in its own pose with the layer of a resident neighbour, and
// result.within bounds what was drawn.
static void test_substitute_frame_is_drawn(void **state)
{
    (void)state;
    enum { FRAME = 3, BEFORE = 2 };
    const int64_t step_ns = take_entry(take, FRAME)->time_ns - take_entry(take, BEFORE)->time_ns;
    const struct gpu_box all = {0, 0, lens.width, lens.height};
    const size_t bytes = (size_t)lens.width * (size_t)lens.height * 4;
    uint8_t *exact = malloc(bytes), *before = malloc(bytes), *substitute = malloc(bytes);
    struct renderer *p = of_one_frame;
    struct renderer_view view = {.world_from_camera = orbit_pose(0.4),
                                 .time_ns = take_entry(take, FRAME)->time_ns - take_entry(take, 0)->time_ns,
                                 .within_ns = step_ns};
    struct renderer_result result;
    draw_frame(p, FRAME, exact);
    draw_frame(p, BEFORE, before);
    EXPECT_INT(renderer_nearest_resident_frame(p, FRAME, step_ns), BEFORE);
    EXPECT_INT(renderer_nearest_resident_frame(p, FRAME, step_ns - 1), -1);
    EXPECT_STATUS(renderer_draw(p, &view, &result), OK);
    EXPECT_INT(renderer_nearest_resident_frame(p, FRAME, 0), -1); // it was not loaded
    EXPECT_STATUS(renderer_read_actor(p, substitute), OK);
    EXPECT_TRUE(memcmp(substitute, before, bytes) && memcmp(substitute, exact, bytes));
    const int pixels = pixels_of(substitute, all), should_be = pixels_of(exact, all);
    EXPECT_AT_LEAST(pixels, 0.9 * should_be);
    EXPECT_AT_MOST(pixels, 1.1 * should_be);
    EXPECT_INT(pixels_of(substitute, result.within), pixels);
    EXPECT_AT_MOST(result.within.width * result.within.height, 0.5 * lens.width * lens.height);
    view.within_ns = step_ns - 1; // none is so near: the frame is loaded
    EXPECT_STATUS(renderer_draw(p, &view, &result), OK);
    EXPECT_STATUS(renderer_read_actor(p, substitute), OK);
    EXPECT_TRUE(!memcmp(substitute, exact, bytes));
    free(exact);
    free(before);
    free(substitute);
}

static void test_memory_is_bounded(void **state)
{
    (void)state;
    const struct calibration *c = take_calibration(take);
    const size_t view_pixels = (size_t)lens.width * (size_t)lens.height,
                 frame_pixels = (size_t)c->color.width * (size_t)c->color.height;
    for (int detail = DETAIL_PAPER; detail <= DETAIL_FULL; detail++) {
        const size_t kept = 2 * frame_pixels * 4, before = gpu_get_counts(gpu).bytes_held;
        struct renderer *p = renderer_at((enum detail)detail, kept);
        size_t most = 0;
        for (int64_t i = 0; i < take_frame_count(take); i++)
            for (int a = 0; a < SIDES; a++) {
                draw(p, take_entry(take, i)->time_ns - take_entry(take, 0)->time_ns, 2.1 * a, NULL);
                size_t held = gpu_get_counts(gpu).bytes_held - before;
                most = held > most ? held : most;
            }
        size_t bound = kept + 8 * frame_pixels + 42 * view_pixels + ((size_t)(detail == DETAIL_PAPER ? 1 : 16) << 20);
        print_message("%zu bytes at most, documented bound %zu\n", most, bound);
        EXPECT_AT_MOST((double)most, (double)bound);
        renderer_close(&p);
        EXPECT_INT(gpu_get_counts(gpu).bytes_held, before); // all is released
    }
}

// A wall half-way between viewer and actor, up to the actor's waist.
static struct occluder_mesh wall_before(struct pose viewer, struct vec3 waist)
{
    static const uint16_t corners[6] = {0, 1, 2, 1, 2, 3};
    const struct vec3 middle = v3_mix(viewer.translation, waist, 0.5);
    const struct vec3 aside = v3_unit(v3_cross(v3_sub(waist, viewer.translation), v3(0, 0, 1)));
    struct occluder_mesh r = {.points = malloc(4 * sizeof *r.points),
                              .corners = malloc(sizeof corners),
                              .spheres = malloc(sizeof *r.spheres),
                              .point_count = 4,
                              .corner_count = 6,
                              .sphere_count = 1};
    assert_true(r.points && r.corners && r.spheres);
    for (int i = 0; i < 4; i++) {
        const struct vec3 p = v3_add(middle, v3_scale(aside, i & 1 ? 1 : -1));
        r.points[i][0] = (float)p.x, r.points[i][1] = (float)p.y, r.points[i][2] = i & 2 ? (float)middle.z : 0;
    }
    memcpy(r.corners, corners, sizeof corners);
    r.spheres[0] = (struct occluder_sphere){middle, 3, 0, 6};
    return r;
}

static int actor_pixels(struct renderer *p, uint8_t *rgba)
{
    const struct gpu_box all = {0, 0, lens.width, lens.height};
    EXPECT_STATUS(renderer_read_actor(p, rgba), OK);
    return pixels_of(rgba, all);
}

// As in an app: once all is uploaded, nothing is allocated or compiled when the room first hides the actor.
static void test_room_upload_costs_no_frame(void **state)
{
    (void)state;
    const struct pose viewer = orbit_pose(0.3);
    const struct take_entry *first = take_entry(take, 0);
    const struct affine_map viewer_from_room = affine_from_pose(pose_inverse(viewer));
    uint8_t *rgba = malloc((size_t)lens.width * (size_t)lens.height * 4);
    struct avatar avatar;
    struct renderer *p;
    struct renderer_options o = renderer_default_options();
    struct occluder_mesh room =
        wall_before(viewer, pose_apply(first->world_from_camera, first->skeleton.joint[JOINT_WAIST]));
    struct renderer_view view = {.world_from_camera = viewer};
    struct renderer_result result;
    o.avatar_later = o.shadow = true;
    EXPECT_STATUS(renderer_open(&p, gpu, take, &lens, &o), OK);
    EXPECT_STATUS(avatar_make(&avatar, take, rehearsed.rays, &(struct avatar_options){.max_frames = 2, .threads = 4}),
                  OK);
    EXPECT_STATUS(renderer_set_avatar(p, &avatar), OK);
    EXPECT_STATUS(renderer_set_room(p, &room), OK);
    for (int i = 0; i < 200 && (i == 0 || !renderer_upload_done(p)); i++)
        EXPECT_STATUS(renderer_draw(p, &view, &result), OK);
    EXPECT_STATUS(renderer_draw(p, &view, &result), OK);
    EXPECT_INT(result.level, DETAIL_FULL);
    const int all = actor_pixels(p, rgba), compiled = compiled_shader_count();
    const int64_t made = gpu_get_counts(gpu).made;
    view.viewer_from_room = &viewer_from_room;
    EXPECT_STATUS(renderer_draw(p, &view, &result), OK);
    const int left = actor_pixels(p, rgba);
    print_message("%d pixels of the actor, %d with the wall before; %d shaders compiled\n", all, left,
                  compiled_shader_count() - compiled);
    EXPECT_AT_LEAST(left, 0.1 * all);
    EXPECT_AT_MOST(left, 0.9 * all);
    EXPECT_INT(gpu_get_counts(gpu).made, made);
    EXPECT_INT(compiled_shader_count(), compiled);
    renderer_close(&p);
    free(rgba);
}

static struct renderer_result draw_from(struct renderer *p, double back_m, double error_px)
{
    struct renderer_view view = {.world_from_camera = orbit_pose(0)};
    struct renderer_result result;
    struct vec3 back = quat_rotate(view.world_from_camera.rotation, v3(0, 0, -back_m));
    view.world_from_camera.translation = v3_add(view.world_from_camera.translation, back);
    renderer_set_error(p, error_px);
    EXPECT_STATUS(renderer_draw(p, &view, &result), OK);
    return result;
}

// While costs are not measured DETAIL_AUTO draws the coarsest level whose predicted error is allowed; once they are,
// never one that takes longer than DETAIL_FULL. From farther away every level's predicted error is smaller.
static void test_auto_error_stays_within_bound(void **state)
{
    (void)state;
    struct renderer *p = renderer_at(DETAIL_AUTO, (size_t)64 << 20);
    double full_px[2], paper_px[2];
    for (int far = 0; far < 2; far++) {
        const double back_m = 3 * far;
        const struct renderer_result full = draw_from(p, back_m, 0), paper = draw_from(p, back_m, 1e3);
        EXPECT_INT(full.level, DETAIL_FULL);
        EXPECT_INT(paper.level, DETAIL_PAPER);
        full_px[far] = full.error_px, paper_px[far] = paper.error_px;
        EXPECT_AT_LEAST(paper_px[far], full_px[far]);
        const struct renderer_result below = draw_from(p, back_m, paper_px[far] * 0.99);
        EXPECT_TRUE(below.level != DETAIL_PAPER && below.error_px <= paper_px[far] * 0.99);
        EXPECT_INT(draw_from(p, back_m, paper_px[far] * 1.01).level, DETAIL_PAPER);
    }
    print_message("predicted: full %.2f and %.2f px, paper %.2f and %.2f px\n", full_px[0], full_px[1], paper_px[0],
                  paper_px[1]);
    EXPECT_AT_MOST(full_px[1], 0.7 * full_px[0]);
    EXPECT_AT_MOST(paper_px[1], 0.7 * paper_px[0]);
    EXPECT_STATUS(renderer_measure_costs(p), OK);
    const struct detail_costs *costs = renderer_costs(p);
    for (int level = 0; level < DETAIL_LEVELS; level++)
        print_message("%s: still %.2f and %.2f ms, playing %.2f and %.2f\n", detail_names[level],
                      costs->still_ms[level][0], costs->still_ms[level][1], costs->playing_ms[level][0],
                      costs->playing_ms[level][1]);
    const struct renderer_result measured = draw_from(p, 3, 1e3);
    EXPECT_TRUE(measured.share_of_full <= 1);
    EXPECT_INT(draw_from(p, 3, 0).level, DETAIL_FULL);
    renderer_close(&p);
}

static int make(void **state)
{
    (void)state;
    EXPECT_STATUS(rehearsed_open(&rehearsed, 0), OK);
    take = rehearsed.take;
    EXPECT_STATUS(gpu_open(&gpu), OK);
    of_one_frame = renderer_at(DETAIL_FULL, 0);
    return 0;
}

static int end(void **state)
{
    (void)state;
    renderer_close(&of_one_frame);
    gpu_close(&gpu);
    rehearsed_close(&rehearsed);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_few_draw_calls_and_no_reupload),
        cmocka_unit_test(test_prefetched_image_is_identical),
        cmocka_unit_test(test_substitute_frame_is_drawn),
        cmocka_unit_test(test_no_texture_side_is_power_of_two),
        cmocka_unit_test(test_memory_is_bounded),
        cmocka_unit_test(test_room_upload_costs_no_frame),
        cmocka_unit_test(test_auto_error_stays_within_bound),
    };
    return cmocka_run_group_tests(tests, make, end);
}
