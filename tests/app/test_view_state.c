// The app's behaviour without a window: playback, gestures, keys and hints, the resolution governor, redraws.
#include "tests/support/test.h"

#include "app/state/frame_times.h"
#include "app/ui/input_map.h"
#include "app/view/take_view.h"

#include <string.h>

static const int64_t S = 1000000000;
static const double PI = 3.14159265358979323846;

// ---------------------------------------------------------------- playback

static void test_playback_speed_and_loop(void **state)
{
    (void)state;
    struct playback_clock p = playback_start(9 * S, 10); // a frame a second
    EXPECT_INT(playback_at(&p, 5 * S), 0);
    playback_play(&p, 100 * S, true);
    EXPECT_INT(playback_at(&p, 103 * S), 3 * S);
    playback_set_speed(&p, 103 * S, 0.1);
    EXPECT_INT(playback_at(&p, 113 * S), 4 * S);
    EXPECT_INT(playback_at(&p, 108 * S), 3 * S + S / 2);
    playback_set_speed(&p, 113 * S, 7);
    EXPECT_NEAR(p.speed, PLAYBACK_FASTEST, 0);
    EXPECT_INT(playback_at(&p, 115 * S), 8 * S);
    EXPECT_INT(playback_at(&p, 115 * S + 3 * S / 4), 9 * S); // the last frame stays as long as the others
    EXPECT_INT(playback_at(&p, 116 * S + S / 2), S);
    EXPECT_TRUE(!playback_tick(&p, 130 * S));
}

static void test_without_loop_stops_at_end_and_restarts(void **state)
{
    (void)state;
    struct playback_clock p = playback_start(4 * S, 5);
    playback_set_loop(&p, 0, false);
    playback_play(&p, 0, true);
    EXPECT_TRUE(!playback_tick(&p, 3 * S));
    EXPECT_TRUE(playback_tick(&p, 5 * S));
    EXPECT_TRUE(!p.playing);
    EXPECT_INT(playback_at(&p, 9 * S), 4 * S);
    playback_play(&p, 10 * S, true);
    EXPECT_INT(playback_at(&p, 11 * S), S);
}

static void test_steps_land_on_frames(void **state)
{
    (void)state;
    struct playback_clock p = playback_start(3 * S, 4);
    playback_play(&p, 0, true);
    playback_step(&p, S + S / 10, 1);
    EXPECT_TRUE(!p.playing);
    EXPECT_INT(playback_at(&p, 50 * S), 2 * S);
    playback_step(&p, 50 * S, 2); // over the end
    EXPECT_INT(playback_at(&p, 50 * S), 0);
    playback_step(&p, 50 * S, -1);
    EXPECT_INT(playback_at(&p, 50 * S), 3 * S);
    playback_set_loop(&p, 50 * S, false);
    playback_step(&p, 50 * S, 5);
    EXPECT_INT(playback_at(&p, 50 * S), 3 * S);
    struct playback_clock one = playback_start(0, 1); // a take of one frame
    playback_play(&one, 0, true);
    playback_step(&one, 0, 1);
    EXPECT_INT(playback_at(&one, 5 * S), 0);
}

static void test_suspend_takes_no_playback_time(void **state)
{
    (void)state;
    struct playback_clock p = playback_start(60 * S, 61);
    playback_play(&p, 0, true);
    playback_skip(&p, 10 * S, 1000 * S);
    EXPECT_INT(playback_at(&p, 1001 * S), 11 * S);
}

// ---------------------------------------------------------------- gestures

static void test_drag_pinch_and_twist_gestures(void **state)
{
    (void)state;
    struct gesture g = {0};
    gesture_down(&g, 7, 100, 100, 0);
    gesture_move(&g, 7, 110, 95);
    struct gesture seen = gesture_take(&g);
    EXPECT_NEAR(seen.drag_x, 10, 0);
    EXPECT_NEAR(seen.drag_y, -5, 0);
    EXPECT_NEAR(seen.spread, 1, 0);
    gesture_down(&g, 8, 210, 95, 0);
    gesture_move(&g, 8, 310, 95);  // twice as far apart
    gesture_move(&g, 8, 110, 295); // a quarter turn clockwise, y runs down
    seen = gesture_take(&g);
    EXPECT_NEAR(seen.spread, 2, 1e-9);
    EXPECT_NEAR(seen.twist, PI / 2, 1e-9);
    EXPECT_NEAR(seen.drag_x, 0, 0);
    EXPECT_NEAR(seen.push_x, -50, 1e-9);
    gesture_up(&g, 7, 10, S / 10);
    gesture_up(&g, 8, 10, S / 10);
    EXPECT_TRUE(!gesture_take(&g).tapped); // two fingers tap nothing
    gesture_down(&g, 9, 5, 5, S);
    gesture_up(&g, 9, 10, S + S / 10);
    EXPECT_TRUE(gesture_take(&g).tapped);
    gesture_down(&g, 9, 5, 5, S);
    gesture_up(&g, 9, 10, 3 * S);
    EXPECT_TRUE(!gesture_take(&g).tapped); // too long for a tap
}

// ---------------------------------------------------------------- view state

static struct view_state watching(void)
{
    struct view_state s = view_state_start(2, true, 0);
    const struct orbit orbit = {v3(0, 0, 1), 0, 0, 3};
    view_state_choose_take(&s, 1);
    view_state_open_take(&s, 10 * S, 301, &orbit, 0);
    return s;
}

static struct view_camera seeing(int64_t number, bool placed, int64_t received_ns)
{
    return (struct view_camera){true, true, true, true, true, received_ns, number, placed, "", 0, -1};
}

static void on_camera(struct view_state *s, struct view_camera camera, int64_t now_ns)
{
    view_state_on_camera(s, &camera, now_ns);
    view_state_tick(s, now_ns);
}

static void test_keys_match_buttons(void **state)
{
    (void)state;
    struct view_state s = watching();
    EXPECT_TRUE(s.playback.playing);
    view_state_do(&s, input_map_key(WINDOW_KEY_SPACE, false), S);
    EXPECT_TRUE(!s.playback.playing);
    view_state_do(&s, input_map_key('m', false), S);
    EXPECT_TRUE(s.placement.mirrored);
    view_state_do(&s, input_map_key('l', false), S);
    EXPECT_TRUE(!s.playback.loop);
    view_state_do(&s, input_map_key('-', false), S);
    EXPECT_NEAR(s.playback.speed, 0.75, 0);
    view_state_do(&s, input_map_button(PAD_RIGHT_SHOULDER), S);
    EXPECT_NEAR(s.playback.speed, 1, 0);
    view_state_do(&s, input_map_key(WINDOW_KEY_END, false), S);
    EXPECT_INT(playback_at(&s.playback, S), 10 * S);
    view_state_do(&s, DO_LAYERS, S);
    view_state_do(&s, DO_MOVE, S); // which closes the sheet
    EXPECT_TRUE(s.moving && s.sheet == SHEET_NONE);
    view_state_do(&s, input_map_key(WINDOW_KEY_ESCAPE, false), S);
    EXPECT_TRUE(!s.moving && s.page == PAGE_WATCH);
    view_state_do(&s, input_map_button(PAD_B), S);
    EXPECT_INT(s.page, PAGE_TAKES);
    view_state_do(&s, input_map_key(WINDOW_KEY_DOWN, false), S);
    EXPECT_INT(s.take, 0);
    view_state_do(&s, input_map_key(WINDOW_KEY_ENTER, false), S);
    EXPECT_TRUE(s.take_wanted);
    view_state_do(&s, DO_BACK, S);
    EXPECT_TRUE(s.quit);
}

// Left and right go from take to take and round, up and down a row, Home and End to the first and the last.
static void test_keys_select_takes(void **state)
{
    (void)state;
    static const struct {
        int key, take;
    } steps[] = {{WINDOW_KEY_LEFT, 10}, {WINDOW_KEY_RIGHT, 0}, {WINDOW_KEY_UP, 0},  {WINDOW_KEY_DOWN, 4},
                 {WINDOW_KEY_DOWN, 8},  {WINDOW_KEY_DOWN, 8},  {WINDOW_KEY_UP, 4},  {WINDOW_KEY_END, 10},
                 {WINDOW_KEY_RIGHT, 0}, {WINDOW_KEY_END, 10},  {WINDOW_KEY_HOME, 0}};
    struct view_state s = view_state_start(11, true, 0);
    s.take_columns = 4;
    for (size_t i = 0; i < COUNT_OF(steps); i++) {
        view_state_do(&s, input_map_key(steps[i].key, false), S);
        EXPECT_INT(s.take, steps[i].take);
    }
}

static void test_scrubbing_restores_playback(void **state)
{
    (void)state;
    struct view_state s = watching();
    view_state_scrub(&s, true, 0.5, S);
    view_state_scrub(&s, true, 0.25, 2 * S);
    EXPECT_INT(playback_at(&s.playback, 5 * S), 2 * S + S / 2);
    view_state_scrub(&s, false, 0.25, 5 * S);
    EXPECT_INT(playback_at(&s.playback, 6 * S), 3 * S + S / 2);
    view_state_scrub(&s, false, 0.9, 6 * S); // a released slider moves nothing
    EXPECT_INT(playback_at(&s.playback, 6 * S), 3 * S + S / 2);
}

static void test_actor_fades_when_camera_is_lost(void **state)
{
    (void)state;
    struct view_state s = watching();
    int64_t now = S;
    for (int i = 1; i < 10; i++, now += S / 20)
        on_camera(&s, seeing(i, true, now), now);
    EXPECT_NEAR(s.presence, 1, 0);
    EXPECT_TRUE(!s.orbiting && !view_state_hint(&s));
    on_camera(&s, seeing(10, false, now), now);
    EXPECT_TRUE(s.presence > 0.5 && s.presence < 1); // not immediately
    EXPECT_TRUE(!view_state_hint(&s));
    for (int i = 11; i < 40; i++, now += S / 20)
        on_camera(&s, seeing(i, false, now), now);
    EXPECT_NEAR(s.presence, 0, 0);
    EXPECT_TRUE(view_state_hint(&s) && strstr(view_state_hint(&s), "tag"));
    for (int i = 40; i < 50; i++, now += S / 20)
        on_camera(&s, seeing(i, true, now), now);
    EXPECT_NEAR(s.presence, 1, 0);
}

static void test_frozen_or_lost_camera_is_reported(void **state)
{
    (void)state;
    struct view_state s = watching();
    on_camera(&s, seeing(1, true, S), S);
    s.playback.playing = false;
    s.changed = false;
    int64_t next = view_state_tick(&s, S + S / 2);
    EXPECT_AT_MOST(next, 3 * S);
    view_state_tick(&s, 3 * S);
    EXPECT_TRUE(s.changed && strstr(view_state_hint(&s), "stopped"));
    struct view_camera gone = seeing(1, true, S);
    gone.seeing = false;
    char trouble[40] = "the camera was unplugged"; // one buffer for all sentences, as in camera_feed_state
    gone.trouble = trouble;
    on_camera(&s, gone, 4 * S);
    EXPECT_TRUE(!strcmp(view_state_hint(&s), "the camera was unplugged"));
    strcpy(trouble, "no camera is there");
    s.changed = false;
    view_state_on_camera(&s, &gone, 4 * S);
    EXPECT_TRUE(s.changed && !strcmp(view_state_hint(&s), "no camera is there"));
    on_camera(&s, seeing(2, true, 5 * S), 5 * S);
    EXPECT_TRUE(!view_state_hint(&s));
    view_state_do(&s, DO_ORBIT, 5 * S);
    EXPECT_TRUE(s.orbiting);
    on_camera(&s, seeing(3, false, 5 * S), 5 * S);
    EXPECT_TRUE(!view_state_hint(&s)); // an orbit needs no tag
}

static void test_actor_without_a_position_is_looked_at_from_all_round(void **state)
{
    (void)state;
    struct view_state s = watching();
    struct view_camera camera = seeing(1, true, S);
    camera.take_located = false;
    on_camera(&s, camera, S);
    EXPECT_TRUE(s.orbiting && strstr(view_state_hint(&s), "recognised nothing"));
    on_camera(&s, seeing(2, true, S), S); // another take
    EXPECT_TRUE(!s.orbiting && !view_state_hint(&s));
}

static struct view_camera seeing_moved(int64_t number, int32_t count, int32_t first)
{
    struct view_camera camera = seeing(number, true, number * S);
    camera.moved_tags = count;
    camera.first_moved = first;
    return camera;
}

// As of frames that cannot be read, one after another: long enough to be read, drawn once, whatever becomes of a
// lasting problem meanwhile.
static void test_a_warning_said_again_stays(void **state)
{
    (void)state;
    struct view_state s = watching();
    view_state_warn(&s, "frame 7 is damaged", 1 * S);
    EXPECT_TRUE(s.changed);
    for (int i = 2; i < 12; i++) {
        s.changed = false;
        view_state_warn(&s, "frame 7 is damaged", i * S);
        view_state_set_problem(&s, NULL);
        EXPECT_TRUE(!s.changed);
        view_state_tick(&s, i * S + S / 2);
        EXPECT_TRUE(s.notice[0] && s.notice_warns);
    }
    s.changed = false;
    view_state_warn(&s, "frame 8 is damaged", 12 * S);
    EXPECT_TRUE(s.changed);
    view_state_tick(&s, 21 * S);
    EXPECT_TRUE(!s.notice[0]);
}

static void test_moved_tag_is_reported_once(void **state)
{
    (void)state;
    struct view_state s = watching();
    on_camera(&s, seeing_moved(1, 1, 0), S);
    on_camera(&s, seeing(2, true, 2 * S), 2 * S); // reported in one image only
    on_camera(&s, seeing_moved(3, 1, 0), 3 * S);
    on_camera(&s, seeing_moved(4, 1, 0), 4 * S);
    EXPECT_TRUE(!s.notice[0]);
    on_camera(&s, seeing_moved(5, 1, 0), 5 * S);
    EXPECT_TRUE(strstr(s.notice, "Tag 0 is not where") && s.notice_warns);
    on_camera(&s, seeing_moved(12, 1, 0), 12 * S);
    EXPECT_TRUE(s.notice[0]); // there is time to read it
    on_camera(&s, seeing_moved(14, 1, 0), 14 * S);
    EXPECT_TRUE(!s.notice[0]);
    on_camera(&s, seeing(20, true, 20 * S), 20 * S);
    on_camera(&s, seeing_moved(21, 1, 0), 21 * S);
    on_camera(&s, seeing_moved(24, 1, 0), 24 * S);
    EXPECT_TRUE(!s.notice[0]); // reported before
    on_camera(&s, seeing_moved(25, 2, 7), 25 * S);
    EXPECT_TRUE(strstr(s.notice, "Tag 7 and others are not where") && strstr(s.notice, "sweep again"));
    view_state_notify(&s, "Saved", 26 * S);
    EXPECT_TRUE(!s.notice_warns);
}

static void test_drag_follows_finger_on_floor(void **state)
{
    (void)state;
    struct view_state s = watching();
    struct gesture g = {0};
    view_state_do(&s, DO_MOVE, S);
    gesture_down(&g, 1, 10, 10, S);
    gesture_move(&g, 1, 50, 10);
    g = gesture_take(&g);
    const struct floor_drag drag = {1, 2, 1.5, 1.75};
    view_state_gesture(&s, &g, &drag, S);
    EXPECT_NEAR(s.placement.x_m, 0.5, 1e-12);
    EXPECT_NEAR(s.placement.y_m, -0.25, 1e-12);
    view_state_set_yaw(&s, PI / 2);
    // Rotated about where the actor stands, then moved.
    struct pose p = placement_pose(&s.placement, v3(3, 4, 0));
    EXPECT_AT_MOST(v3_distance(pose_apply(p, v3(3, 4, 1)), v3(3.5, 3.75, 1)), 1e-12);
    EXPECT_AT_MOST(v3_distance(pose_apply(p, v3(4, 4, 1)), v3(3.5, 4.75, 1)), 1e-12);
    view_state_do(&s, DO_RESET_PLACEMENT, S);
    EXPECT_NEAR(s.placement.x_m + s.placement.yaw_rad, 0, 0);
}

static void test_controls_hide_and_return_on_touch(void **state)
{
    (void)state;
    struct view_state s = watching();
    view_state_tick(&s, S);
    EXPECT_TRUE(view_state_controls_shown(&s));
    view_state_tick(&s, 20 * S);
    EXPECT_TRUE(!view_state_controls_shown(&s));
    struct gesture tap = {.spread = 1, .tapped = true};
    view_state_gesture(&s, &tap, NULL, 20 * S);
    EXPECT_TRUE(view_state_controls_shown(&s));
    view_state_do(&s, DO_PLAY_PAUSE, 20 * S);
    view_state_tick(&s, 90 * S);
    EXPECT_TRUE(view_state_controls_shown(&s)); // paused, they stay
}

// ---------------------------------------------------------------- resolution governor

static void test_governor_does_not_oscillate(void **state)
{
    (void)state;
    struct resolution_governor g = governor_start(16);
    int changes = 0;
    // A machine that needs 40 ms for all pixels, and a time proportional to their number.
    for (int i = 0; i < 3000; i++) {
        double k = governor_scale(&g);
        changes += governor_update(&g, 40 * k * k);
    }
    EXPECT_AT_MOST(40 * governor_scale(&g) * governor_scale(&g), 16);
    EXPECT_AT_MOST(changes, 3);
    for (int i = 0; i < 300; i++) // then it gets ten times faster
        governor_update(&g, 4 * governor_scale(&g) * governor_scale(&g));
    EXPECT_NEAR(governor_scale(&g), 1, 0);
    // A single slow frame changes nothing.
    EXPECT_TRUE(!governor_update(&g, 60));
    EXPECT_TRUE(!governor_update(&g, 4));
    EXPECT_INT(g.level, 0);
}

static void test_governor_keeps_resolution_without_gain(void **state)
{
    (void)state;
    struct resolution_governor g = governor_start(16);
    int full = 0;
    for (int i = 0; i < 1000; i++) {
        governor_update(&g, 100);
        full += g.level == 0;
    }
    EXPECT_AT_LEAST(full, 960);
}

static void test_frame_times_keep_the_last(void **state)
{
    (void)state;
    static struct frame_times t;
    EXPECT_NEAR(frame_times_median(&t), 0, 0);
    EXPECT_TRUE(!frame_times_at(&t, 0));
    for (int i = 1; i <= FRAMES_KEPT + 5; i++)
        frame_times_add(&t, (const double[FRAME_STAGES]){[FRAME_LOCATE] = i, [FRAME_SHOW] = 1});
    EXPECT_NEAR((double)frame_times_at(&t, 0)[FRAME_LOCATE], FRAMES_KEPT + 5, 0);
    EXPECT_NEAR((double)frame_times_at(&t, FRAMES_KEPT - 1)[FRAME_LOCATE], 6, 0);
    EXPECT_TRUE(!frame_times_at(&t, FRAMES_KEPT));
    EXPECT_NEAR(frame_times_median(&t), 6 + FRAMES_KEPT / 2 + 1, 0);
    EXPECT_NEAR(t.total_worst_ms, FRAMES_KEPT + 6, 0);
}

// ---------------------------------------------------------------- redraws

// Every field set, one by one, so that the padding keeps what was there before.
static void fill_request(struct take_view_request *r)
{
    r->lens.width = 640, r->lens.height = 480;
    r->lens.fx = r->lens.fy = 500, r->lens.cx = 320, r->lens.cy = 240;
    r->lens.k1 = r->lens.k2 = r->lens.p1 = r->lens.p2 = r->lens.k3 = 0.01;
    r->lens.readout_s = r->lens.focal_sigma = 0;
    r->world_from_camera = POSE_IDENTITY;
    r->time_ns = 7;
    r->playing = r->loop = true;
    r->placement.x_m = r->placement.y_m = r->placement.yaw_rad = 0.5;
    r->placement.mirrored = false;
    r->resolution_scale = 0.8;
    r->detail = DETAIL_AUTO;
    r->error_px = 1;
    r->sources = r->inset = r->camera_lost = r->in_room = r->sensor = false;
    r->camera = NULL;
    r->camera_number = 3;
    r->overlay = NULL;
}

static void test_padding_causes_no_redraw(void **state)
{
    (void)state;
    struct take_view_request zeros, ones;
    memset(&zeros, 0, sizeof zeros);
    memset(&ones, 0xff, sizeof ones);
    fill_request(&zeros);
    fill_request(&ones);
    EXPECT_TRUE(memcmp(&zeros, &ones, sizeof zeros) != 0); // there is padding, and it differs
    EXPECT_TRUE(take_view_request_equal(&zeros, &ones));
}

// Fills two requests, changes one field of the second, and compares them.
#define EXPECT_REDRAW(change)                                                                                          \
    do {                                                                                                               \
        struct take_view_request a, b;                                                                                 \
        fill_request(&a);                                                                                              \
        fill_request(&b);                                                                                              \
        b.change;                                                                                                      \
        EXPECT_TRUE(!take_view_request_equal(&a, &b));                                                                 \
    } while (0)

static void test_every_field_causes_a_redraw(void **state)
{
    (void)state;
    static const char pixel;
    EXPECT_REDRAW(lens.width = 641);
    EXPECT_REDRAW(lens.fx = 501);
    EXPECT_REDRAW(lens.k3 = 0.02);
    EXPECT_REDRAW(world_from_camera.rotation.z = 0.1);
    EXPECT_REDRAW(world_from_camera.translation.y = 0.1);
    EXPECT_REDRAW(time_ns = 8);
    EXPECT_REDRAW(playing = false);
    EXPECT_REDRAW(loop = false);
    EXPECT_REDRAW(placement.x_m = 1);
    EXPECT_REDRAW(placement.y_m = 1);
    EXPECT_REDRAW(placement.yaw_rad = 1);
    EXPECT_REDRAW(placement.mirrored = true);
    EXPECT_REDRAW(resolution_scale = 1);
    EXPECT_REDRAW(detail = DETAIL_FULL);
    EXPECT_REDRAW(error_px = 2);
    EXPECT_REDRAW(sources = true);
    EXPECT_REDRAW(inset = true);
    EXPECT_REDRAW(camera_lost = true);
    EXPECT_REDRAW(sensor = true);
    EXPECT_REDRAW(camera = (const struct gpu_texture *)&pixel);
    EXPECT_REDRAW(camera_number = 4);
    EXPECT_REDRAW(overlay = (const struct overlay *)(const void *)&pixel);
}

// Each side by its key, of an actor who faces east; two quick taps, or 0, lead back to the first view.
static void test_sides_of_an_orbit(void **state)
{
    (void)state;
    const struct orbit start = {v3(0, 0, 1), 0.3, 0.12, 3};
    struct view_state s = view_state_start(1, true, 0);
    view_state_open_take(&s, 10 * S, 301, &start, 0);
    view_state_do(&s, DO_SEE_BACK, 0); // where the actor faces is not known yet: by the first view
    EXPECT_NEAR(remainder(s.orbit.angle_rad - 0.3 - PI, 2 * PI), 0, 1e-12);
    view_state_set_facing(&s, PI / 2);
    s.orbit.distance_m = 5;
    const struct {
        enum view_action action;
        double x, y, z;                                           // from the actor to the camera; east is x, north y
    } cases[] = {{DO_SEE_FRONT, 1, 0, 0}, {DO_SEE_SIDE, 0, 1, 0}, // the left of one who faces east
                 {DO_SEE_SIDE, 0, -1, 0}, {DO_SEE_SIDE, 0, 1, 0}, {DO_SEE_BACK, -1, 0, 0}, {DO_SEE_ABOVE, 0, 0, 1}};
    for (size_t i = 0; i < COUNT_OF(cases); i++) {
        view_state_do(&s, cases[i].action, 0);
        const struct vec3 from = v3_scale(v3_sub(orbit_world_from_camera(&s.orbit).translation, s.orbit.centre), 0.2);
        EXPECT_NEAR(v3_distance(from, v3(cases[i].x, cases[i].y, cases[i].z)), 0, 0.2); // and a little from above
    }
    EXPECT_NEAR(s.orbit.distance_m, 5, 0);
    view_state_do(&s, DO_SEE_START, 0);
    EXPECT_NEAR(s.orbit.angle_rad, 0.3, 0);
    EXPECT_NEAR(s.orbit.rise_rad, 0.12, 0);
    EXPECT_NEAR(s.orbit.distance_m, 3, 0);
    const struct gesture tap = {.spread = 1, .tapped = true}, drag = {.spread = 1, .drag_x = 0.2};
    for (int slow = 1; slow >= 0; slow--) {
        view_state_gesture(&s, &drag, NULL, 0);
        const double turned = s.orbit.angle_rad;
        view_state_gesture(&s, &tap, NULL, 10 * S);
        view_state_gesture(&s, &tap, NULL, 10 * S + (slow ? S / 2 : S / 4));
        EXPECT_NEAR(s.orbit.angle_rad, slow ? turned : 0.3, 0);
        s.tapped_ns = 0;
    }
    EXPECT_INT(input_map_key('1', false), DO_SEE_FRONT);
    EXPECT_INT(input_map_key('0', false), DO_SEE_START);
    // Through a camera nothing is turned.
    s.orbiting = false;
    view_state_do(&s, DO_SEE_BACK, 0);
    EXPECT_NEAR(s.orbit.angle_rad, 0.3, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_sides_of_an_orbit),
        cmocka_unit_test(test_playback_speed_and_loop),
        cmocka_unit_test(test_without_loop_stops_at_end_and_restarts),
        cmocka_unit_test(test_steps_land_on_frames),
        cmocka_unit_test(test_suspend_takes_no_playback_time),
        cmocka_unit_test(test_drag_pinch_and_twist_gestures),
        cmocka_unit_test(test_keys_match_buttons),
        cmocka_unit_test(test_keys_select_takes),
        cmocka_unit_test(test_scrubbing_restores_playback),
        cmocka_unit_test(test_actor_fades_when_camera_is_lost),
        cmocka_unit_test(test_frozen_or_lost_camera_is_reported),
        cmocka_unit_test(test_actor_without_a_position_is_looked_at_from_all_round),
        cmocka_unit_test(test_moved_tag_is_reported_once),
        cmocka_unit_test(test_a_warning_said_again_stays),
        cmocka_unit_test(test_drag_follows_finger_on_floor),
        cmocka_unit_test(test_controls_hide_and_return_on_touch),
        cmocka_unit_test(test_governor_does_not_oscillate),
        cmocka_unit_test(test_governor_keeps_resolution_without_gain),
        cmocka_unit_test(test_frame_times_keep_the_last),
        cmocka_unit_test(test_padding_causes_no_redraw),
        cmocka_unit_test(test_every_field_causes_a_redraw),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
