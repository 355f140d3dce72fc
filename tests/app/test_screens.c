// Every screen of the app, drawn without a window: wide and upright, dark and light, with a camera that is localised
// and one that is not.
//
//     test_screens                          the tests
//     test_screens FILE CAMERA FOLDER       images of the screens, for the documents (see tests/screens)
#include "tests/support/test.h"

#include "app/ui/view_compositor.h"
#include "app/viewer/viewer_inside.h"
#include "base/clock.h"
#include "platform/files/file.h"
#include "platform/files/jpeg.h"
#include "platform/files/png.h"
#include "tests/support/glass.h"
#include "tests/support/rehearsal.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { LONG = GLASS_LONG, SHORT = GLASS_SHORT };

// Less where the CPU is emulated. SHARE: a screen's sides are those of a tablet divided by this.
#ifdef EMULATED
enum { SHARE = 4, WAYS_UP = 1 };
static const double FINEST_DPI = 220;
#else
enum { SHARE = SANITIZED ? 4 : 2, WAYS_UP = SANITIZED ? 1 : 2 };
static const double FINEST_DPI = SANITIZED ? 220 : 300;
#endif

static struct rehearsal rehearsal;

static void open_glass(struct glass *g, int width, int height, const char *file, const char *take, const char *camera)
{
    const struct viewer_options options = {.file = file,
                                           .take = take,
                                           .camera = camera,
                                           .photos = rehearsal.scratch.path,
                                           .fixed_resolution = true,
                                           .refresh_hz = 60};
    glass_open(g, width, height, &options);
}

static void test_takes_are_chosen_by_touch(void **state)
{
    (void)state;
    struct glass g;
    open_glass(&g, LONG / 2, SHORT / 2, rehearsal.file, NULL, NULL);
    struct view_state *s = g.state;
    glass_draw(&g);
    EXPECT_INT(s->page, PAGE_TAKES);
    glass_read(&g);
    EXPECT_AT_LEAST(glass_count_color(&g, theme_of(true)->ground, 2), LONG * SHORT / 16);
    // A finger taps the second card.
    glass_tap(&g, (struct ui_point){600, 300});
    EXPECT_INT(s->page, PAGE_WATCH);
    EXPECT_INT(s->take, 1);
    glass_close(&g);
}

// What was pressed before a page was seen is not meant for it, as in the studio: neither before the first frame nor
// while another page is still on the screen; and a finger that was lifted meanwhile presses nothing.
static void test_input_older_than_the_page_is_dropped(void **state)
{
    (void)state;
    static const struct window_event key = {.kind = WINDOW_KEY, .key = 'd'}, quit = {.kind = WINDOW_QUIT};
    struct window_event finger = {.kind = WINDOW_POINTER_DOWN, .pointer = 1, .x = 60, .y = 60};
    struct glass g;
    open_glass(&g, LONG / 2, SHORT / 2, rehearsal.file, NULL, NULL);
    const struct input_map *input = viewer_input(g.viewer);
    glass_event(&g, &key);
    EXPECT_TRUE(g.state->dark);
    glass_draw(&g);
    EXPECT_INT(g.state->page, PAGE_TAKES);
    glass_event(&g, &key);
    EXPECT_TRUE(!g.state->dark);
    EXPECT_TRUE(glass_event(&g, &finger) && input->pointer_down);
    view_state_choose_take(g.state, 0);
    viewer_update(g.viewer, clock_now_ns());
    EXPECT_INT(g.state->page, PAGE_WATCH); // opened, and not drawn yet
    finger.kind = WINDOW_POINTER_UP;
    EXPECT_TRUE(!glass_event(&g, &finger));
    EXPECT_TRUE(!input->pointer_down && !input->gesture.count && !input->gesture.tapped);
    glass_event(&g, &key);
    EXPECT_TRUE(!g.state->dark);
    glass_draw(&g);
    glass_event(&g, &key);
    EXPECT_TRUE(g.state->dark);
    view_state_do(g.state, DO_TAKES, clock_now_ns());
    EXPECT_INT(g.state->page, PAGE_TAKES);
    glass_event(&g, &quit); // but the window is closed whatever it shows
    EXPECT_TRUE(g.state->quit && viewer_query(g.viewer).quit);
    glass_close(&g);
}

// The window fills the screen from the start where that is asked for, until the user says otherwise.
static void test_the_whole_screen_is_asked_for(void **state)
{
    (void)state;
    struct glass g;
    const struct viewer_options options = {.file = rehearsal.file, .fullscreen = true, .refresh_hz = 60};
    glass_open(&g, LONG / 2, SHORT / 2, &options);
    glass_draw(&g);
    EXPECT_TRUE(viewer_query(g.viewer).fullscreen && viewer_options_again(g.viewer).fullscreen);
    glass_press(&g, 'f');
    EXPECT_TRUE(!viewer_query(g.viewer).fullscreen);
    glass_close(&g);
}

static void test_orbit_follows_finger(void **state)
{
    (void)state;
    struct glass g;
    open_glass(&g, LONG / 2, SHORT / 2, rehearsal.file, "turn", NULL);
    struct view_state *s = g.state;
    glass_draw(&g);
    glass_seek(&g, 0.5);
    glass_draw(&g);
    glass_draw(&g);
    glass_body(&g);
    EXPECT_TRUE(s->orbiting && s->page == PAGE_WATCH);
    EXPECT_AT_LEAST(g.image->parts, 8);
    EXPECT_TRUE(view_state_hint(s) == NULL);
    const double scale = glass_scale(&g), angle = s->orbit.angle_rad;
    struct window_event e = {.kind = WINDOW_POINTER_DOWN, .pointer = 1, .x = 200 / scale, .y = 150 / scale};
    glass_event(&g, &e);
    glass_draw(&g);
    e.kind = WINDOW_POINTER_MOVE;
    e.x = 250 / scale;
    glass_event(&g, &e);
    glass_draw(&g);
    EXPECT_AT_LEAST(angle - s->orbit.angle_rad, 0.3);
    glass_close(&g);
}

#ifndef EMULATED
static void test_no_redraw_without_change(void **state)
{
    (void)state;
    struct glass g;
    open_glass(&g, LONG / 2, SHORT / 2, rehearsal.file, "turn", NULL);
    struct view_state *s = g.state;
    glass_draw(&g);
    glass_seek(&g, 0.5);
    // Until the avatar is built and the orbit has reached the actor.
    for (int64_t i = 0, until = clock_now_ns() + 200000000000; i < 40 || s->crossfade < 1 || !g.image->full; i++) {
        glass_draw_and_wait(&g);
        EXPECT_TRUE(clock_now_ns() < until);
    }
    s->changed = false;
    viewer_set_checked(g.viewer, clock_now_ns()); // the file is checked once a second
    int64_t now = clock_now_ns(), next = viewer_update(g.viewer, now);
    EXPECT_TRUE(!s->changed);
    EXPECT_AT_LEAST(next - now, 100000000);
    glass_close(&g);
}
#endif

static void test_actor_and_camera_are_synchronous(void **state)
{
    (void)state;
    struct glass g;
    open_glass(&g, LONG / 2, SHORT / 2, rehearsal.file, "turn", rehearsal.camera);
    glass_wait_located(&g, true);
    EXPECT_TRUE(g.image->camera && g.image->actor && !g.state->orbiting);
    for (int i = 0; i < 10; i++) {
        glass_draw(&g);
        EXPECT_INT(viewer_request(g.viewer)->camera_number, viewer_camera_frame(g.viewer)->number);
        EXPECT_INT(viewer_request(g.viewer)->time_ns,
                   playback_at(&g.state->playback, viewer_camera_frame(g.viewer)->received_ns));
        EXPECT_INT(memcmp(&viewer_request(g.viewer)->world_from_camera,
                          &viewer_camera_frame(g.viewer)->world_from_camera, sizeof(struct pose)),
                   0);
    }
    glass_close(&g);
}

static void draw_turned(struct glass *g, int quarter_turns)
{
    const bool across = quarter_turns & 1;
    gpu_target_close(&g->target);
    EXPECT_STATUS(gpu_target_open(&g->target, g->gpu, across ? g->height : g->width, across ? g->width : g->height),
                  OK);
    const struct viewer_surface glass = {g->target, g->width, g->height, quarter_turns, glass_scale(g)};
    EXPECT_STATUS(viewer_draw(g->viewer, &glass, clock_now_ns()), OK);
    glass_read(g);
}

static void test_rotated_display_shows_the_same(void **state)
{
    (void)state;
    struct glass g;
    open_glass(&g, LONG / 2, SHORT / 2, rehearsal.file, NULL, NULL); // the page of takes, which does not move
    const int w = g.width, h = g.height;
    uint8_t *upright = malloc(4 * (size_t)w * (size_t)h);
    glass_draw(&g);
    draw_turned(&g, 0);
    memcpy(upright, g.rgba, 4 * (size_t)w * (size_t)h);
    for (int turns = 1; turns < 4; turns++) {
        draw_turned(&g, turns);
        double sum = 0;
        for (int y = 0; y < h; y++)
            for (int x = 0; x < w; x++) {
                const int column = turns == 1 ? h - 1 - y : turns == 2 ? w - 1 - x : y;
                const int row = turns == 1 ? x : turns == 2 ? h - 1 - y : w - 1 - x;
                const uint8_t *p = g.rgba + 4 * (row * (turns == 2 ? w : h) + column), *q = upright + 4 * (y * w + x);
                sum += abs(p[0] - q[0]) + abs(p[1] - q[1]) + abs(p[2] - q[2]);
            }
        EXPECT_AT_MOST(sum / (3.0 * w * h), 0.2); // edges may be rounded either way
    }
    free(upright);
    glass_close(&g);
}

static void test_touch_targets_are_large_enough(void **state)
{
    (void)state;
    static const double dpis[] = {96, 149, 220, 264, 320, 450};
    int least = 1 << 30, most = 0;
    for (size_t i = 0; i < COUNT_OF(dpis); i++) {
        const double scale = viewer_px_per_dp(dpis[i]), mm = TARGET * scale / dpis[i] * 25.4;
        EXPECT_AT_LEAST(mm, 9);
        if (dpis[i] < 149 || dpis[i] > FINEST_DPI)
            continue;
        // A screen of 20 x 13 cm at that resolution shows the same.
        struct glass g;
        open_glass(&g, (int)(7.9 * dpis[i]), (int)(5.1 * dpis[i]), rehearsal.file, "turn", NULL);
        const struct viewer_surface glass = {g.target, g.width, g.height, 0, scale};
        glass_prepare(&g); // else the progress bar is shown, too
        for (int n = 0; n < 2; n++) {
            viewer_update(g.viewer, clock_now_ns());
            EXPECT_STATUS(viewer_draw(g.viewer, &glass, clock_now_ns()), OK);
            glass_seek(&g, 0.5);
        }
        glass_read(&g);
        int accent = (int)(glass_count_color(&g, theme_of(true)->accent, 6) / (scale * scale));
        least = accent < least ? accent : least;
        most = accent > most ? accent : most;
        glass_close(&g);
    }
    print_message("accent: %d to %d\n", least, most);
    EXPECT_AT_LEAST(least, 8000);
    EXPECT_AT_MOST(most, 1.05 * least);
}

static void test_skipped_draws_lose_nothing(void **state)
{
    (void)state;
    struct glass g;
    open_glass(&g, LONG / 2, SHORT / 2, rehearsal.file, "turn", rehearsal.camera);
    glass_wait_located(&g, true);
    int64_t hidden = clock_now_ns(), at_ns = playback_at(&g.state->playback, hidden);
    EXPECT_TRUE(g.state->playback.playing);
    viewer_suspend(g.viewer, true, hidden);
    clock_sleep_until_ns(hidden + 300000000); // the camera is being closed
    int64_t received = viewer_feed_state(g.viewer).received;
    clock_sleep_until_ns(clock_now_ns() + 400000000);
    EXPECT_INT(viewer_feed_state(g.viewer).received, received);
    int64_t shown = clock_now_ns();
    viewer_suspend(g.viewer, false, shown);
    EXPECT_INT(playback_at(&g.state->playback, shown), at_ns);
    for (int64_t until = shown + 30000000000;
         viewer_feed_state(g.viewer).received == received && clock_now_ns() < until;)
        clock_sleep_until_ns(clock_now_ns() + 10000000);
    glass_wait_located(&g, true);
    EXPECT_AT_LEAST(viewer_feed_state(g.viewer).received, received + 1);
    glass_close(&g);
}

// How many pixels of that texture are outside of the box that it is drawn in; adds those inside to *within.
static int count_outside(struct glass *g, const struct gpu_texture *texture, struct ui_box box, int *within)
{
    const double scale = glass_scale(g);
    const struct ui_input input = {.width_px = g->width, .height_px = g->height, .px_per_dp = scale};
    const struct ui_box all = {0, 0, g->width / scale, g->height / scale};
    const struct lens *lens = &g->image->lens;
    struct cover cover = cover_of(lens, all);
    struct ui_box whole = {cover.x, cover.y, cover.scale * lens->width, cover.scale * lens->height};
    EXPECT_TRUE(texture);
    EXPECT_STATUS(ui_begin(viewer_ui(g->viewer), &input), OK);
    ui_fade(viewer_ui(g->viewer), all, 0xffffffff, 0xffffffff); // a background without soft edges
    ui_image(viewer_ui(g->viewer), texture, whole, (struct ui_uv_rect){0, 0, 1, 1}, 0, 0xffffffff);
    ui_end(viewer_ui(g->viewer));
    EXPECT_STATUS(ui_draw(viewer_ui(g->viewer), g->target, 0), OK);
    glass_read(g);
    int beyond = 0;
    for (int y = 0; y < g->height; y++)
        for (int x = 0; x < g->width; x++) {
            const uint8_t *rgba = g->rgba + 4 * (y * g->width + x);
            const double at_x = (x + 0.5) / scale, at_y = (y + 0.5) / scale;
            bool inside = at_x >= box.x && at_x <= box.x + box.w && at_y >= box.y && at_y <= box.y + box.h;
            bool actor = rgba[0] < 255 || rgba[1] < 255 || rgba[2] < 255;
            *within += actor && inside;
            beyond += actor && !inside;
        }
    return beyond;
}

static void test_whole_actor_is_drawn(void **state)
{
    (void)state;
    struct glass g;
    open_glass(&g, LONG / 2, SHORT / 2, rehearsal.file, "turn", NULL);
    glass_draw(&g);
    g.state->orbit.distance_m = 4;
    for (int i = 0; i < 8; i++) {
        const struct take_view_image *p = g.image;
        const struct ui_box all = {0, 0, g.width / glass_scale(&g), g.height / glass_scale(&g)};
        int within = 0, shaded = 0;
        glass_seek(&g, i / 7.0);
        g.state->orbit.angle_rad += 0.8;
        glass_draw(&g);
        const struct cover cover = cover_of(&p->lens, all);
        EXPECT_INT(count_outside(&g, p->actor, compositor_actor_box(p, cover, all), &within), 0);
        EXPECT_INT(count_outside(&g, p->shadow, compositor_shadow_box(p, cover, all), &shaded), 0);
        print_message("actor %d pixels, shadow %d\n", within, shaded);
        EXPECT_AT_LEAST(within, 2500);
        EXPECT_AT_LEAST(shaded, 8000);
    }
    glass_close(&g);
}

static void test_screenshot_omits_controls(void **state)
{
    (void)state;
    struct glass g;
    open_glass(&g, LONG / 2, SHORT / 2, rehearsal.file, "turn", rehearsal.camera);
    glass_wait_located(&g, true);
    view_state_do(g.state, DO_SCREENSHOT, clock_now_ns());
    glass_draw(&g);
    const char *notice = g.state->notice, *name = strstr(notice, "reenact-");
    EXPECT_TRUE(name);
    uint8_t *bytes, *rgb = malloc(640 * 480 * 3);
    size_t count;
    EXPECT_STATUS(file_read(scratch_file(&rehearsal.scratch, name), &bytes, &count), OK);
    EXPECT_STATUS(jpeg_decode(bytes, count, rgb, 640, 480), OK); // of the camera image's size
    double sum = 0;                                              // beside the actor it shows the camera's image
    for (int y = 0; y < 120; y++)
        for (int x = 0; x < 3 * 120; x++)
            sum += abs(rgb[y * 640 * 3 + x] - viewer_camera_frame(g.viewer)->rgb[y * 640 * 3 + x]);
    EXPECT_AT_MOST(sum / (120 * 360), 4);
    free(rgb);
    free(bytes);
    glass_close(&g);
}

static void test_removed_recording_plays_on(void **state)
{
    (void)state;
    char away[300];
    struct glass g;
    snprintf(away, sizeof away, "%s.away", rehearsal.file);
    open_glass(&g, LONG / 2, SHORT / 2, rehearsal.file, "turn", NULL);
    glass_draw(&g);
    EXPECT_INT(rename(rehearsal.file, away), 0);
    viewer_set_checked(g.viewer, 0);
    glass_seek(&g, 0.8);
    glass_draw(&g);
    EXPECT_TRUE(view_state_hint(g.state) && strstr(view_state_hint(g.state), "removed"));
    glass_body(&g);
    EXPECT_AT_LEAST(g.image->parts, 8);
    EXPECT_INT(rename(away, rehearsal.file), 0);
    viewer_set_checked(g.viewer, 0);
    glass_draw(&g);
    EXPECT_TRUE(!view_state_hint(g.state));
    glass_close(&g);
}

static void test_lost_camera_gives_advice(void **state)
{
    (void)state;
    struct glass g;
    open_glass(&g, LONG / 2, SHORT / 2, rehearsal.file, "turn", rehearsal.blind);
    glass_wait_located(&g, false);
    const char *hint = view_state_hint(g.state);
    EXPECT_TRUE(hint && strstr(hint, "tag"));
    glass_close(&g);
    // And a camera that does not exist.
    char nowhere[300];
    snprintf(nowhere, sizeof nowhere, "folder:%s", scratch_file(&rehearsal.scratch, "nowhere"));
    open_glass(&g, LONG / 2, SHORT / 2, rehearsal.file, "turn", nowhere);
    for (int i = 0; i < 500 && !*viewer_feed_state(g.viewer).trouble; i++) {
        viewer_update(g.viewer, clock_now_ns());
        clock_sleep_until_ns(clock_now_ns() + 10000000);
    }
    glass_draw(&g);
    hint = view_state_hint(g.state);
    EXPECT_TRUE(hint && strstr(hint, "nowhere"));
    EXPECT_TRUE(g.state->orbiting); // the take can be watched all the same
    glass_close(&g);
}

static void test_mirror_flips_actor(void **state)
{
    (void)state;
    struct glass g;
    open_glass(&g, LONG / 2, SHORT / 2, rehearsal.file, "turn", NULL);
    glass_draw(&g);
    glass_seek(&g, 0.5);
    glass_draw(&g);
    struct vec3 left = g.image->skeleton.joint[JOINT_LEFT_SHOULDER],
                right = g.image->skeleton.joint[JOINT_RIGHT_SHOULDER];
    view_state_do(g.state, DO_MIRROR, clock_now_ns());
    glass_draw(&g);
    struct vec3 mirrored = g.image->skeleton.joint[JOINT_LEFT_SHOULDER];
    EXPECT_TRUE(g.image->flip_x);
    // The left shoulder is where the right one was, except for how far the actor leans.
    EXPECT_AT_MOST(v3_distance(mirrored, right), v3_distance(mirrored, left));
    // Drawn with the skeleton.
    view_state_do(g.state, DO_SKELETON, clock_now_ns());
    glass_draw(&g);
    glass_body(&g);
    EXPECT_AT_LEAST(g.image->parts, 8);
    glass_close(&g);
}

static void test_file_without_take_is_reported(void **state)
{
    (void)state;
    struct glass g;
    open_glass(&g, SHORT / 2, LONG / 2, scratch_file(&rehearsal.scratch, "none.reenact"), NULL, NULL);
    glass_draw(&g);
    EXPECT_INT(g.state->page, PAGE_TROUBLE);
    EXPECT_TRUE(strstr(g.state->trouble, "none.reenact"));
    glass_close(&g);
    open_glass(&g, SHORT / 2, LONG / 2, rehearsal.file, "another take", NULL);
    glass_draw(&g);
    EXPECT_INT(g.state->page, PAGE_TROUBLE);
    EXPECT_TRUE(strstr(g.state->trouble, "another take"));
    glass_close(&g);
}

// ---------------------------------------------------------------- images of the screens

enum { SCREENS = 8 };
static const char *const screen_names[SCREENS] = {"takes", "place",   "orbit", "layers",
                                                  "speed", "sources", "move",  "lost"};

// Sets the view state for screen number n.
static void show_screen(struct glass *g, int n)
{
    struct view_state *s = g->state;
    int64_t now = clock_now_ns();
    glass_seek(g, 0.42);
    s->sheet = SHEET_NONE;
    s->orbiting = false;
    s->page = PAGE_WATCH;
    s->moving = s->sources = s->inset = s->frame_graph = s->skeleton = s->orbit_requested = false;
    s->placement = (struct placement){0};
    switch (n) {
    case 0: s->page = PAGE_TAKES; break;
    case 2:
        view_state_do(s, DO_ORBIT, now);
        s->orbit.angle_rad = take_view_orbit(viewer_take_view(g->viewer)).angle_rad;
        break;
    case 3:
        view_state_do(s, DO_ORBIT, now);
        s->orbit.angle_rad = take_view_orbit(viewer_take_view(g->viewer)).angle_rad + 0.4;
        s->skeleton = s->inset = s->frame_graph = true;
        s->sheet = SHEET_LAYERS;
        break;
    case 4: s->sheet = SHEET_SPEED; break;
    case 5:
        s->sources = true;
        view_state_do(s, DO_ORBIT, now);
        s->orbit.angle_rad = take_view_orbit(viewer_take_view(g->viewer)).angle_rad + 1;
        break;
    case 6:
        view_state_do(s, DO_MOVE, now);
        view_state_set_yaw(s, 0.6);
        break;
    default: break;
    }
}

static bool has_content(const struct glass *g)
{
    int first =
        glass_count_color(g, (uint32_t)g->rgba[0] << 24 | (uint32_t)g->rgba[1] << 16 | (uint32_t)g->rgba[2] << 8, 3);
    return first < g->width * g->height * 9 / 10;
}

// Draws screen number n, dark and light; writes PNGs into `folder` unless NULL.
static void capture_screen(struct glass *g, int n, const char *folder)
{
    static uint8_t last[LONG * SHORT * 4];
    const size_t bytes = (size_t)g->width * (size_t)g->height * 4;
    for (int dark = 1; dark >= 0; dark--) {
        char path[600];
        g->state->dark = dark;
        show_screen(g, n);
        glass_draw(g);
        glass_draw(g); // the second shows what a tap changed
        if (folder && g->state->orbiting)
            glass_wait_idle(g);
        else if (folder)
            glass_wait_located(g, n < SCREENS - 1);
        glass_read(g);
        EXPECT_TRUE(has_content(g));
        if (!dark)
            EXPECT_AT_LEAST(glass_difference(g, last), 0.5);
        memcpy(last, g->rgba, bytes);
        if (!folder)
            continue;
        snprintf(path, sizeof path, "%s/%s-%s-%s.png", folder, screen_names[n],
                 g->width < g->height ? "upright" : "wide", dark ? "dark" : "light");
        EXPECT_STATUS(png_write(path, PNG_RGBA8, g->rgba, g->width, g->height), OK);
    }
}

static void capture_screens(const char *file, const char *take, const char *camera, const char *blind,
                            const char *folder, bool upright)
{
    struct glass g;
    const int share = folder ? 1 : SHARE, width = (upright ? SHORT : LONG) / share,
              height = (upright ? LONG : SHORT) / share;
    open_glass(&g, width, height, file, take, camera);
    g.state->take_wanted = true;
    glass_wait_located(&g, true);
    if (folder)
        glass_prepare(&g);
    for (int n = 0; n < SCREENS - 1; n++)
        capture_screen(&g, n, folder);
    glass_close(&g);
    open_glass(&g, width, height, file, take, blind);
    g.state->take_wanted = true;
    glass_wait_located(&g, false);
    capture_screen(&g, SCREENS - 1, folder);
    glass_close(&g);
}

static void test_every_screen_orientation_and_theme(void **state)
{
    (void)state;
    for (int upright = 0; upright < WAYS_UP; upright++)
        capture_screens(rehearsal.file, "turn", rehearsal.camera, rehearsal.blind, NULL, upright);
}

static int set_up(void **state)
{
    (void)state;
    rehearsal = rehearsal_make();
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    rehearsal_end(&rehearsal);
    return 0;
}

int main(int argc, char **argv)
{
    if (argc == 4) {
        rehearsal.scratch = scratch_make();
        rehearse_camera(&rehearsal.scratch, "wall", NULL, 1);
        snprintf(rehearsal.blind, sizeof rehearsal.blind, "folder:%s/wall", rehearsal.scratch.path);
        for (int upright = 0; upright < 2; upright++)
            capture_screens(argv[1], NULL, argv[2], rehearsal.blind, argv[3], upright);
        rehearsal_end(&rehearsal);
        return 0;
    }
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_takes_are_chosen_by_touch),
        cmocka_unit_test(test_input_older_than_the_page_is_dropped),
        cmocka_unit_test(test_the_whole_screen_is_asked_for),
        cmocka_unit_test(test_orbit_follows_finger),
#ifndef EMULATED // which would build the avatar twice
        cmocka_unit_test(test_no_redraw_without_change),
#endif
        cmocka_unit_test(test_actor_and_camera_are_synchronous),
        cmocka_unit_test(test_whole_actor_is_drawn),
        cmocka_unit_test(test_rotated_display_shows_the_same),
        cmocka_unit_test(test_touch_targets_are_large_enough),
        cmocka_unit_test(test_skipped_draws_lose_nothing),
        cmocka_unit_test(test_screenshot_omits_controls),
        cmocka_unit_test(test_removed_recording_plays_on),
        cmocka_unit_test(test_lost_camera_gives_advice),
        cmocka_unit_test(test_mirror_flips_actor),
        cmocka_unit_test(test_file_without_take_is_reported),
        cmocka_unit_test(test_every_screen_orientation_and_theme),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
