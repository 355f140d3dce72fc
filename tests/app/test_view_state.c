// The app's behaviour without a window: the take's time, fingers told apart, what
// keys and hints do, and the pace that is held.
#include "tests/support/test.h"

#include "app/state/resolution_governor.h"
#include "app/ui/input_map.h"
#include "app/state/frame_times.h"

#include <string.h>

static const int64_t S = 1000000000;
static const double PI = 3.14159265358979323846;

// ---------------------------------------------------------------- the player

static void test_time_runs_at_its_speed_and_round(void **state)
{
    (void)state;
    struct player p = player_start(9 * S, 10); // a frame a second
    EXPECT_INT(player_at(&p, 5 * S), 0);
    player_play(&p, 100 * S, true);
    EXPECT_INT(player_at(&p, 103 * S), 3 * S);
    player_set_speed(&p, 103 * S, 0.1);
    EXPECT_INT(player_at(&p, 113 * S), 4 * S);
    EXPECT_INT(player_at(&p, 108 * S), 3 * S + S / 2);
    player_set_speed(&p, 113 * S, 7);
    EXPECT_NEAR(p.speed, PLAYER_FASTEST, 0);
    EXPECT_INT(player_at(&p, 115 * S), 8 * S);
    EXPECT_INT(player_at(&p, 115 * S + 3 * S / 4), 9 * S); // the last frame stays as long as the others
    EXPECT_INT(player_at(&p, 116 * S + S / 2), S);
    EXPECT_TRUE(!player_tick(&p, 130 * S));
}

static void test_without_a_loop_it_stops_at_the_end_and_begins_anew(void **state)
{
    (void)state;
    struct player p = player_start(4 * S, 5);
    player_set_loop(&p, 0, false);
    player_play(&p, 0, true);
    EXPECT_TRUE(!player_tick(&p, 3 * S));
    EXPECT_TRUE(player_tick(&p, 5 * S));
    EXPECT_TRUE(!p.playing);
    EXPECT_INT(player_at(&p, 9 * S), 4 * S);
    player_play(&p, 10 * S, true);
    EXPECT_INT(player_at(&p, 11 * S), S);
}

static void test_steps_land_on_frames(void **state)
{
    (void)state;
    struct player p = player_start(3 * S, 4);
    player_play(&p, 0, true);
    player_step(&p, S + S / 10, 1);
    EXPECT_TRUE(!p.playing);
    EXPECT_INT(player_at(&p, 50 * S), 2 * S);
    player_step(&p, 50 * S, 2); // over the end
    EXPECT_INT(player_at(&p, 50 * S), 0);
    player_step(&p, 50 * S, -1);
    EXPECT_INT(player_at(&p, 50 * S), 3 * S);
    player_set_loop(&p, 50 * S, false);
    player_step(&p, 50 * S, 5);
    EXPECT_INT(player_at(&p, 50 * S), 3 * S);
    struct player one = player_start(0, 1); // a take of one frame
    player_play(&one, 0, true);
    player_step(&one, 0, 1);
    EXPECT_INT(player_at(&one, 5 * S), 0);
}

static void test_sleep_is_no_time(void **state)
{
    (void)state;
    struct player p = player_start(60 * S, 61);
    player_play(&p, 0, true);
    player_skip(&p, 10 * S, 1000 * S);
    EXPECT_INT(player_at(&p, 1001 * S), 11 * S);
}

// ---------------------------------------------------------------- fingers

static void test_one_finger_drags_two_spread_and_twist(void **state)
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
    EXPECT_TRUE(!gesture_take(&g).tapped); // that was resting
}

// ---------------------------------------------------------------- what is shown

static struct show watching(void)
{
    struct show s = show_start(2, true, 0);
    const struct orbit orbit = {v3(0, 0, 1), 0, 0, 3};
    show_choose(&s, 1);
    show_take(&s, 10 * S, 301, &orbit, 0);
    return s;
}

static struct show_camera seeing(int64_t sight, bool placed, int64_t came_ns)
{
    return (struct show_camera){true, true, true, true, came_ns, sight, placed, "", 0, -1};
}

static void hear(struct show *s, struct show_camera camera, int64_t now_ns)
{
    show_hear(s, &camera, now_ns);
    show_tick(s, now_ns);
}

static void test_every_key_does_what_its_button_does(void **state)
{
    (void)state;
    struct show s = watching();
    EXPECT_TRUE(s.player.playing);
    show_do(&s, hands_key(SCREEN_KEY_SPACE, false), S);
    EXPECT_TRUE(!s.player.playing);
    show_do(&s, hands_key('m', false), S);
    EXPECT_TRUE(s.placement.mirrored);
    show_do(&s, hands_key('l', false), S);
    EXPECT_TRUE(!s.player.loop);
    show_do(&s, hands_key('-', false), S);
    EXPECT_NEAR(s.player.speed, 0.75, 0);
    show_do(&s, hands_button(PAD_RIGHT_SHOULDER), S);
    EXPECT_NEAR(s.player.speed, 1, 0);
    show_do(&s, hands_key(SCREEN_KEY_END, false), S);
    EXPECT_INT(player_at(&s.player, S), 10 * S);
    show_do(&s, DO_LAYERS, S);
    show_do(&s, DO_MOVE, S); // which closes the sheet
    EXPECT_TRUE(s.moving && s.sheet == SHEET_NONE);
    show_do(&s, hands_key(SCREEN_KEY_ESCAPE, false), S);
    EXPECT_TRUE(!s.moving && s.page == PAGE_WATCH);
    show_do(&s, hands_button(PAD_B), S);
    EXPECT_INT(s.page, PAGE_TAKES);
    show_do(&s, hands_key(SCREEN_KEY_DOWN, false), S);
    EXPECT_INT(s.take, 0);
    show_do(&s, hands_key(SCREEN_KEY_ENTER, false), S);
    EXPECT_TRUE(s.take_wanted);
    show_do(&s, DO_BACK, S);
    EXPECT_TRUE(s.quit);
}

static void test_scrubbing_goes_on_as_it_was(void **state)
{
    (void)state;
    struct show s = watching();
    show_scrub(&s, true, 0.5, S);
    show_scrub(&s, true, 0.25, 2 * S);
    EXPECT_INT(player_at(&s.player, 5 * S), 2 * S + S / 2);
    show_scrub(&s, false, 0.25, 5 * S);
    EXPECT_INT(player_at(&s.player, 6 * S), 3 * S + S / 2);
    show_scrub(&s, false, 0.9, 6 * S); // a slider that nobody holds moves nothing
    EXPECT_INT(player_at(&s.player, 6 * S), 3 * S + S / 2);
}

static void test_he_fades_when_the_camera_is_lost_and_the_screen_says_so(void **state)
{
    (void)state;
    struct show s = watching();
    int64_t now = S;
    for (int i = 1; i < 10; i++, now += S / 20)
        hear(&s, seeing(i, true, now), now);
    EXPECT_NEAR(s.presence, 1, 0);
    EXPECT_TRUE(!s.orbiting && !show_hint(&s));
    hear(&s, seeing(10, false, now), now);
    EXPECT_TRUE(s.presence > 0.5 && s.presence < 1); // not at once
    EXPECT_TRUE(!show_hint(&s));
    for (int i = 11; i < 40; i++, now += S / 20)
        hear(&s, seeing(i, false, now), now);
    EXPECT_NEAR(s.presence, 0, 0);
    EXPECT_TRUE(show_hint(&s) && strstr(show_hint(&s), "tag"));
    for (int i = 40; i < 50; i++, now += S / 20)
        hear(&s, seeing(i, true, now), now);
    EXPECT_NEAR(s.presence, 1, 0);
}

static void test_a_camera_that_freezes_or_goes_is_named(void **state)
{
    (void)state;
    struct show s = watching();
    hear(&s, seeing(1, true, S), S);
    s.player.playing = false;
    s.changed = false;
    int64_t next = show_tick(&s, S + S / 2);
    EXPECT_AT_MOST(next, 3 * S);
    show_tick(&s, 3 * S);
    EXPECT_TRUE(s.changed && strstr(show_hint(&s), "stopped"));
    struct show_camera gone = seeing(1, true, S);
    gone.seeing = false;
    char trouble[40] = "the camera was unplugged"; // one place for every sentence, as the camera's thread has it
    gone.trouble = trouble;
    hear(&s, gone, 4 * S);
    EXPECT_TRUE(!strcmp(show_hint(&s), "the camera was unplugged"));
    strcpy(trouble, "no camera is there");
    s.changed = false;
    show_hear(&s, &gone, 4 * S);
    EXPECT_TRUE(s.changed && !strcmp(show_hint(&s), "no camera is there"));
    hear(&s, seeing(2, true, 5 * S), 5 * S);
    EXPECT_TRUE(!show_hint(&s));
    show_do(&s, DO_ORBIT, 5 * S);
    EXPECT_TRUE(s.orbiting);
    hear(&s, seeing(3, false, 5 * S), 5 * S);
    EXPECT_TRUE(!show_hint(&s)); // who orbits needs no tag
}

static struct show_camera seeing_moved(int64_t sight, int32_t count, int32_t first)
{
    struct show_camera camera = seeing(sight, true, sight * S);
    camera.moved_tags = count;
    camera.first_moved = first;
    return camera;
}

static void test_a_tag_that_was_moved_is_named_once(void **state)
{
    (void)state;
    struct show s = watching();
    hear(&s, seeing_moved(1, 1, 0), S);
    hear(&s, seeing(2, true, 2 * S), 2 * S); // one picture showed it so, no more
    hear(&s, seeing_moved(3, 1, 0), 3 * S);
    hear(&s, seeing_moved(4, 1, 0), 4 * S);
    EXPECT_TRUE(!s.notice[0]);
    hear(&s, seeing_moved(5, 1, 0), 5 * S);
    EXPECT_TRUE(strstr(s.notice, "Tag 0 is not where") && s.notice_warns);
    hear(&s, seeing_moved(12, 1, 0), 12 * S);
    EXPECT_TRUE(s.notice[0]); // there is time to read it
    hear(&s, seeing_moved(14, 1, 0), 14 * S);
    EXPECT_TRUE(!s.notice[0]);
    hear(&s, seeing(20, true, 20 * S), 20 * S);
    hear(&s, seeing_moved(21, 1, 0), 21 * S);
    hear(&s, seeing_moved(24, 1, 0), 24 * S);
    EXPECT_TRUE(!s.notice[0]); // that was said
    hear(&s, seeing_moved(25, 2, 7), 25 * S);
    EXPECT_TRUE(strstr(s.notice, "Tag 7 and others are not where") && strstr(s.notice, "sweep again"));
    show_say(&s, "Photographed", 26 * S);
    EXPECT_TRUE(!s.notice_warns);
}

static void test_moving_follows_the_finger_over_the_floor(void **state)
{
    (void)state;
    struct show s = watching();
    struct gesture g = {0};
    show_do(&s, DO_MOVE, S);
    gesture_down(&g, 1, 10, 10, S);
    gesture_move(&g, 1, 50, 10);
    g = gesture_take(&g);
    const struct floor_drag drag = {1, 2, 1.5, 1.75};
    show_gesture(&s, &g, &drag, S);
    EXPECT_NEAR(s.placement.x_m, 0.5, 1e-12);
    EXPECT_NEAR(s.placement.y_m, -0.25, 1e-12);
    show_set_turn(&s, PI / 2);
    // Turned about where he stands, then moved.
    struct pose p = placement_pose(&s.placement, v3(3, 4, 0));
    EXPECT_AT_MOST(v3_distance(pose_apply(p, v3(3, 4, 1)), v3(3.5, 3.75, 1)), 1e-12);
    EXPECT_AT_MOST(v3_distance(pose_apply(p, v3(4, 4, 1)), v3(3.5, 4.75, 1)), 1e-12);
    show_do(&s, DO_PUT_BACK, S);
    EXPECT_NEAR(s.placement.x_m + s.placement.turn_rad, 0, 0);
}

static void test_controls_go_while_it_plays_and_come_with_a_touch(void **state)
{
    (void)state;
    struct show s = watching();
    show_tick(&s, S);
    EXPECT_TRUE(show_controls(&s));
    show_tick(&s, 20 * S);
    EXPECT_TRUE(!show_controls(&s));
    struct gesture tap = {.spread = 1, .tapped = true};
    show_gesture(&s, &tap, NULL, 20 * S);
    EXPECT_TRUE(show_controls(&s));
    show_do(&s, DO_PLAY_PAUSE, 20 * S);
    show_tick(&s, 90 * S);
    EXPECT_TRUE(show_controls(&s)); // paused, they stay
}

// ---------------------------------------------------------------- the pace

static void test_the_governor_falls_and_rises_and_does_not_swing(void **state)
{
    (void)state;
    struct governor g = governor_start(16);
    int changes = 0;
    // A machine that needs 40 ms for every pixel, and time goes with pixels.
    for (int i = 0; i < 3000; i++) {
        double k = governor_scale(&g);
        changes += governor_drawn(&g, 40 * k * k);
    }
    EXPECT_AT_MOST(40 * governor_scale(&g) * governor_scale(&g), 16);
    EXPECT_AT_MOST(changes, 4);
    for (int i = 0; i < 3000; i++) // then it gets ten times faster
        governor_drawn(&g, 4 * governor_scale(&g) * governor_scale(&g));
    EXPECT_NEAR(governor_scale(&g), 1, 0);
    // One slow picture is no reason.
    EXPECT_TRUE(!governor_drawn(&g, 60));
    EXPECT_TRUE(!governor_drawn(&g, 4));
    EXPECT_INT(g.level, 0);
}

static void test_the_governor_stays_fine_where_coarse_saves_nothing(void **state)
{
    (void)state;
    struct governor g = governor_start(16);
    int fine = 0;
    for (int i = 0; i < 1000; i++) {
        governor_drawn(&g, 100);
        fine += g.level == 0;
    }
    EXPECT_AT_LEAST(fine, 950);
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

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_time_runs_at_its_speed_and_round),
        cmocka_unit_test(test_without_a_loop_it_stops_at_the_end_and_begins_anew),
        cmocka_unit_test(test_steps_land_on_frames),
        cmocka_unit_test(test_sleep_is_no_time),
        cmocka_unit_test(test_one_finger_drags_two_spread_and_twist),
        cmocka_unit_test(test_every_key_does_what_its_button_does),
        cmocka_unit_test(test_scrubbing_goes_on_as_it_was),
        cmocka_unit_test(test_he_fades_when_the_camera_is_lost_and_the_screen_says_so),
        cmocka_unit_test(test_a_camera_that_freezes_or_goes_is_named),
        cmocka_unit_test(test_a_tag_that_was_moved_is_named_once),
        cmocka_unit_test(test_moving_follows_the_finger_over_the_floor),
        cmocka_unit_test(test_controls_go_while_it_plays_and_come_with_a_touch),
        cmocka_unit_test(test_the_governor_falls_and_rises_and_does_not_swing),
        cmocka_unit_test(test_the_governor_stays_fine_where_coarse_saves_nothing),
        cmocka_unit_test(test_frame_times_keep_the_last),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
