// No stalls during playback: once the take is prepared, no target or program is made and no shader is compiled when the
// resolution scale or the shown frame changes. (When the room first hides the actor: test_drawing_costs.) With a
// software rasteriser, compiling a shader makes one image take five times as long.
#include "tests/support/test.h"

#include "base/clock.h"
#include "tests/support/compiled.h"
#include "tests/support/glass.h"
#include "tests/support/rehearsal.h"
#include "tests/support/retake.h"

#include <stdlib.h>
#include <string.h>

static struct rehearsal rehearsal;
static struct glass glass;

static int64_t made(void) { return gpu_get_counts(glass.gpu).made; }

// Draws the first frame until the viewer is idle, at that level of the resolution governor.
static void draw_at(int level)
{
    viewer_governor(glass.viewer)->level = level;
    glass_wait_idle(&glass);
    EXPECT_NEAR(viewer_request(glass.viewer)->resolution_scale, governor_scale(viewer_governor(glass.viewer)), 0);
    EXPECT_TRUE(glass.image->prepared);
    EXPECT_AT_LEAST(glass.image->parts, 8);
}

// The image last drawn, without controls, with the actor or without.
static void draw_scene(bool with_actor)
{
    const struct ui_input input = {
        .width_px = glass.width, .height_px = glass.height, .px_per_dp = ui_px_per_dp(viewer_ui(glass.viewer))};
    const struct brush brush = {viewer_ui(glass.viewer), theme_of(true), NULL};
    struct view_state show = *glass.state;
    show.presence = with_actor;
    EXPECT_STATUS(ui_begin(viewer_ui(glass.viewer), &input), OK);
    compositor_draw(&brush,
                    (struct ui_box){0, 0, ui_width(viewer_ui(glass.viewer)), ui_height(viewer_ui(glass.viewer))},
                    glass.image, &show);
    ui_end(viewer_ui(glass.viewer));
    EXPECT_STATUS(ui_draw(viewer_ui(glass.viewer), glass.target, 0), OK);
    glass_read(&glass);
}

// Playback does not wait for a frame to load, however far from it the resident ones are.
static void test_playback_does_not_wait_for_frames(void **state)
{
    (void)state;
    struct playback_clock *player = &glass.state->playback;
    const int64_t made_before = made(), now = clock_now_ns();
    playback_set_speed(player, now, PLAYBACK_SLOWEST);
    playback_play(player, now, true);
    playback_seek(player, clock_now_ns(), player->length_ns - player->step_ns);
    glass_draw(&glass);
    EXPECT_TRUE(viewer_request(glass.viewer)->playing);
    EXPECT_AT_LEAST((double)viewer_request(glass.viewer)->time_ns, 4e9); // only the first frame is resident
    EXPECT_AT_LEAST(glass.image->parts, 8);
    EXPECT_INT(made(), made_before);
    glass_seek(&glass, 0);
    playback_set_speed(player, clock_now_ns(), 1);
    glass_wait_idle(&glass);
}

static void test_resolution_change_costs_nothing(void **state)
{
    (void)state;
    const size_t bytes = (size_t)glass.width * (size_t)glass.height * 4;
    uint8_t *fine = malloc(bytes);
    assert_true(fine);
    draw_at(0);
    draw_scene(true);
    memcpy(fine, glass.rgba, bytes);
    draw_scene(false);
    const double actor = glass_difference(&glass, fine); // the difference the actor makes
    const int64_t made_before = made();
    const int compiled_before = compiled_shader_count();
    for (int level = 1; level <= GOVERNOR_LEVELS; level++) {
        draw_at(level % GOVERNOR_LEVELS);
        draw_scene(true);
        const double off = glass_difference(&glass, fine);
        print_message("at %.2f: %lld made, %d compiled; difference %.3f, of the whole actor %.3f\n",
                      governor_scale(viewer_governor(glass.viewer)), (long long)(made() - made_before),
                      compiled_shader_count() - compiled_before, off, actor);
        EXPECT_AT_MOST(off, 0.1 * actor); // the same place and size
    }
    free(fine);
    EXPECT_INT(made(), made_before);
    EXPECT_INT(compiled_shader_count(), compiled_before);
}

// Whatever part of the image a frame's actor covers.
static void test_later_frames_cost_as_the_first(void **state)
{
    (void)state;
    draw_at(0);
    const int compiled_before = compiled_shader_count();
    const int64_t frames = take_view_frames(viewer_take_view(glass.viewer));
    for (int64_t i = 0; i < frames; i++) {
        glass_seek(&glass, (double)i / (double)(frames - 1));
        glass_wait_idle(&glass);
    }
    glass_seek(&glass, 0);
    glass_wait_idle(&glass);
    EXPECT_INT(compiled_shader_count(), compiled_before);
}

// Retimes the take to one frame a second.
static void slow_down(void *self, struct retaken *frame)
{
    (void)self;
    frame->time_ns = frame->number * 1000000000;
}

// Prepared, idle, on the first frame.
static int make(void **state)
{
    (void)state;
    rehearsal = rehearsal_make();
    retake(rehearsal.file, "turn", "slowly", slow_down, NULL);
    const struct viewer_options options = {.file = rehearsal.file, .take = "slowly", .refresh_hz = 60};
    glass_open(&glass, GLASS_LONG, GLASS_SHORT, &options);
    glass_draw(&glass);
    glass_seek(&glass, 0);
    glass.state->detail = DETAIL_FULL; // at every resolution
    glass_prepare(&glass);
    glass_wait_idle(&glass);
    if (strstr(gpu_renderer(glass.gpu), "llvmpipe"))
        EXPECT_AT_LEAST(compiled_shader_count(), 1); // they are counted
    return 0;
}

static int end(void **state)
{
    (void)state;
    glass_close(&glass);
    rehearsal_end(&rehearsal);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_playback_does_not_wait_for_frames),
        cmocka_unit_test(test_resolution_change_costs_nothing),
        cmocka_unit_test(test_later_frames_cost_as_the_first),
    };
    return cmocka_run_group_tests(tests, make, end);
}
