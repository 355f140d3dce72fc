// Doing the move beside the actor: count-in, following, loops, tempo, who leaves and who comes, the summary.
#include "tests/support/test.h"

#include "app/state/view_state.h"

#include <string.h>

static const int64_t S = 1000000000, STEP = 20000000, LENGTH = 4000000000;

// A sitting with its clock, and a person who does what the test says.
struct sitting {
    struct live_state s;
    struct live_sight sight;
    int64_t now_ns;
    double lag_s; // the person is so far behind the actor; below 0: stands still at the beginning
};

static struct sitting begin(void)
{
    struct sitting t = {.s = live_state_start(false), .now_ns = 100 * S};
    const struct orbit orbit = {{0, 0, 1}, 0, 0.1, 3};
    live_state_open_take(&t.s, LENGTH, &orbit, t.now_ns);
    t.sight = (struct live_sight){.seeing = true, .person = true, .judged = true, .away_rad = 1};
    return t;
}

static void pass(struct sitting *t, double seconds)
{
    for (const int64_t end_ns = t->now_ns + (int64_t)(seconds * 1e9); t->now_ns < end_ns;) {
        t->now_ns += STEP;
        t->sight.frame++;
        const int64_t behind_ns = (int64_t)(t->lag_s * 1e9);
        t->sight.reference_ns = t->lag_s < 0 ? 0 : t->s.at_ns > behind_ns ? t->s.at_ns - behind_ns : 0;
        live_state_on_sight(&t->s, &t->sight, t->now_ns);
        live_state_tick(&t->s, t->now_ns);
    }
}

static void start(struct sitting *t)
{
    live_state_do(&t->s, LIVE_DO_START, t->now_ns);
    pass(t, 3.05);
    EXPECT_INT(t->s.phase, LIVE_DOING);
}

static void test_count_in_counts_down(void **state)
{
    (void)state;
    struct sitting t = begin();
    t.s.hands_free = false;
    pass(&t, 5);
    EXPECT_INT(t.s.phase, LIVE_READY);
    EXPECT_INT(live_state_count(&t.s), 0);
    live_state_do(&t.s, LIVE_DO_START, t.now_ns);
    for (int count = 3; count > 0; count--) {
        pass(&t, 0.5);
        EXPECT_INT(live_state_count(&t.s), count);
        EXPECT_INT(t.s.at_ns, 0); // the actor stands at the beginning
        pass(&t, 0.5);
    }
    pass(&t, 0.1);
    EXPECT_INT(t.s.phase, LIVE_DOING);
    EXPECT_INT(t.s.attempt, 1);
    EXPECT_AT_LEAST(t.s.at_ns, 1);
}

static void test_person_who_stands_there_is_counted_in(void **state)
{
    (void)state;
    struct sitting t = begin();
    t.sight.person = false;
    pass(&t, 10);
    EXPECT_INT(t.s.phase, LIVE_READY);
    EXPECT_TRUE(strstr(live_state_hint(&t.s), "Step into"));
    t.sight.person = true;
    pass(&t, 2);
    EXPECT_INT(t.s.phase, LIVE_READY);
    pass(&t, 1);
    EXPECT_INT(t.s.phase, LIVE_COUNT_IN);
    t.sight.person = false; // and who walks away is not
    pass(&t, 1);
    EXPECT_INT(t.s.phase, LIVE_READY);
    EXPECT_INT(t.s.attempt, 0);
}

static void test_actor_waits_for_who_stands_still(void **state)
{
    (void)state;
    struct sitting t = begin();
    t.lag_s = -1;
    start(&t);
    pass(&t, 6);
    EXPECT_TRUE(t.s.waits);
    EXPECT_AT_MOST(t.s.at_ns, S / 2);
    EXPECT_TRUE(strstr(live_state_hint(&t.s), "waits"));
    EXPECT_TRUE(!live_state_hint_warns(&t.s));
    t.lag_s = 0.2; // follows now
    pass(&t, 1);
    EXPECT_TRUE(!t.s.waits);
    EXPECT_NEAR((double)t.s.at_ns * 1e-9, 1.4, 0.15);
}

// Within a pause of the actor all instants look alike: the pose counts.
static void test_a_hold_is_no_deadlock(void **state)
{
    (void)state;
    struct sitting t = begin();
    t.lag_s = -1;
    t.sight.away_rad = 0.05;
    start(&t);
    pass(&t, 2);
    EXPECT_TRUE(!t.s.waits);
    EXPECT_AT_LEAST(t.s.at_ns, 19 * S / 10);
}

static void test_keep_up_waits_for_no_one(void **state)
{
    (void)state;
    struct sitting t = begin();
    t.lag_s = -1;
    live_state_do(&t.s, LIVE_DO_PACE, t.now_ns);
    start(&t);
    pass(&t, 2);
    EXPECT_NEAR((double)t.s.at_ns * 1e-9, 2, 0.1);
    pass(&t, 2.8);
    EXPECT_INT(t.s.phase, LIVE_DOING); // a little time for who is late
    pass(&t, 0.5);
    EXPECT_INT(t.s.phase, LIVE_SUMMARY);
    EXPECT_INT(t.s.finished, 1);
    EXPECT_TRUE(strstr(live_state_hint(&t.s), "Judging"));
}

static void test_tempo(void **state)
{
    (void)state;
    struct sitting t = begin();
    live_state_do(&t.s, LIVE_DO_SLOWER, t.now_ns);
    live_state_do(&t.s, LIVE_DO_SLOWER, t.now_ns);
    EXPECT_NEAR(t.s.tempo, 0.5, 0);
    start(&t);
    pass(&t, 3);
    EXPECT_NEAR((double)t.s.at_ns * 1e-9, 1.5, 0.1);
    for (int i = 0; i < 9; i++)
        live_state_do(&t.s, LIVE_DO_FASTER, t.now_ns);
    EXPECT_NEAR(t.s.tempo, live_tempos[LIVE_TEMPOS - 1], 0);
    for (int i = 0; i < 9; i++)
        live_state_do(&t.s, LIVE_DO_SLOWER, t.now_ns);
    EXPECT_NEAR(t.s.tempo, live_tempos[0], 0);
}

static void test_marked_part_is_looped(void **state)
{
    (void)state;
    struct sitting t = begin();
    start(&t);
    pass(&t, 1);
    live_state_do(&t.s, LIVE_DO_MARK_FROM, t.now_ns);
    live_state_do(&t.s, LIVE_DO_MARK_TO, t.now_ns); // too short a part
    EXPECT_INT(t.s.marked_to_ns, LENGTH);
    pass(&t, 1);
    live_state_do(&t.s, LIVE_DO_MARK_TO, t.now_ns);
    EXPECT_NEAR((double)t.s.marked_from_ns * 1e-9, 1, 0.1);
    EXPECT_NEAR((double)t.s.marked_to_ns * 1e-9, 2, 0.1);
    EXPECT_TRUE(t.s.loop);
    for (int attempt = 1; attempt <= 3; attempt++) {
        EXPECT_INT(t.s.attempt, attempt);
        pass(&t, attempt == 1 ? 1.2 : 2.2);
        EXPECT_INT(t.s.finished, attempt); // judged while the person rests
        EXPECT_INT(t.s.phase, LIVE_DOING);
        const struct live_result r = {.score = 50, .length_s = 1, .compared = true};
        live_state_on_result(&t.s, &r, S, t.now_ns);
        EXPECT_INT(t.s.phase, LIVE_DOING);
        for (int i = 0; t.s.attempt == attempt && i < 500; i++) {
            EXPECT_AT_MOST(t.s.at_ns, t.s.marked_to_ns);
            pass(&t, 0.02);
        }
        EXPECT_NEAR((double)t.s.at_ns * 1e-9, (double)t.s.marked_from_ns * 1e-9, 0.05);
    }
    EXPECT_INT(t.s.result_count, 3);
    live_state_do(&t.s, LIVE_DO_START, t.now_ns); // stop
    EXPECT_INT(t.s.phase, LIVE_SUMMARY);
    EXPECT_INT(t.s.finished, 3); // the fourth, just begun, is not judged: the third is shown
    live_state_to_ready(&t.s, t.now_ns);
    live_state_do(&t.s, LIVE_DO_MARK_FROM, t.now_ns); // takes the marks back
    EXPECT_INT(t.s.marked_from_ns, 0);
    EXPECT_INT(t.s.marked_to_ns, LENGTH);
}

// Stopped in the count-in or within a second, nothing is judged and nothing counted; a second is enough.
static void test_a_moment_is_not_judged(void **state)
{
    (void)state;
    static const double seconds[] = {0.02, 0.5, 0.9, 1.04, 2};
    for (size_t i = 0; i < 2 * COUNT_OF(seconds); i++) {
        struct sitting t = begin();
        const bool film = i % 2; // whose end stops it, instead of the person
        start(&t);
        pass(&t, seconds[i / 2]);
        if (film)
            t.sight.ended = true;
        else
            live_state_do(&t.s, LIVE_DO_START, t.now_ns);
        if (film)
            pass(&t, 0.01);
        EXPECT_INT(t.s.finished, seconds[i / 2] > 1);
        EXPECT_INT(t.s.phase, seconds[i / 2] > 1 ? LIVE_SUMMARY : LIVE_READY);
        t.s.hands_free = false;
        if (seconds[i / 2] < 1) {
            assert_non_null(live_state_hint(&t.s));
            EXPECT_TRUE(strstr(live_state_hint(&t.s), "too short"));
            t.sight.ended = false;
            start(&t); // another one
            pass(&t, 0.1);
            EXPECT_TRUE(!t.s.too_short);
        }
    }
    struct sitting t = begin(); // in the count-in
    live_state_do(&t.s, LIVE_DO_START, t.now_ns);
    pass(&t, 1);
    live_state_do(&t.s, LIVE_DO_START, t.now_ns);
    EXPECT_TRUE(t.s.phase == LIVE_READY && !t.s.attempt && !t.s.finished);
    // There for less than a second of an attempt that went on: no bar.
    for (int length = 0; length < 2; length++) {
        const struct live_result r = {.score = 16, .length_s = 0.6, .findings = 3, .compared = true};
        t = begin();
        start(&t);
        pass(&t, 3);
        live_state_do(&t.s, LIVE_DO_START, t.now_ns);
        live_state_on_result(&t.s, &r, length ? S : 6 * S / 10, t.now_ns);
        EXPECT_INT(t.s.result_count, length);
        EXPECT_INT(t.s.phase, length ? LIVE_SUMMARY : LIVE_READY);
        EXPECT_INT(t.s.judged, t.s.finished);
    }
}

static void test_leaving_is_said_and_forgiven(void **state)
{
    (void)state;
    struct sitting t = begin();
    start(&t);
    pass(&t, 1);
    t.sight.person = false;
    pass(&t, 0.4);
    EXPECT_TRUE(!live_state_hint(&t.s) || !strstr(live_state_hint(&t.s), "left")); // may be a lost frame or two
    pass(&t, 1);
    EXPECT_TRUE(strstr(live_state_hint(&t.s), "You left the picture"));
    EXPECT_TRUE(live_state_hint_warns(&t.s));
    const int64_t at_ns = t.s.at_ns;
    pass(&t, 2);
    EXPECT_INT(t.s.at_ns, at_ns); // the actor waits
    t.sight.person = true;
    pass(&t, 1);
    EXPECT_INT(t.s.attempt, 1);
    EXPECT_AT_LEAST(t.s.at_ns, at_ns + S / 2);
    t.sight.person = false; // for good
    pass(&t, 9);
    EXPECT_INT(t.s.phase, LIVE_READY);
    EXPECT_INT(t.s.finished, 0); // nothing to judge
}

static void test_second_person_is_said(void **state)
{
    (void)state;
    struct sitting t = begin();
    start(&t);
    pass(&t, 1);
    t.sight.second_person = true;
    pass(&t, 0.1);
    EXPECT_TRUE(strstr(live_state_hint(&t.s), "second person"));
    EXPECT_TRUE(live_state_hint_warns(&t.s));
    t.sight.second_person = false;
    pass(&t, 0.5);
    EXPECT_TRUE(live_state_hint(&t.s)); // long enough to be read
    pass(&t, 2);
    EXPECT_TRUE(!live_state_hint(&t.s));
    EXPECT_AT_LEAST(t.s.at_ns, 3 * S);
}

static void test_sensor_trouble_is_said(void **state)
{
    (void)state;
    struct sitting t = begin();
    t.sight = (struct live_sight){.trouble = "openni: unplugged"};
    pass(&t, 1);
    EXPECT_TRUE(!strcmp(live_state_hint(&t.s), "openni: unplugged"));
    t.sight = (struct live_sight){0};
    pass(&t, 1);
    EXPECT_TRUE(strstr(live_state_hint(&t.s), "Waiting for the sensor"));
}

static void test_end_of_a_film_ends_the_attempt(void **state)
{
    (void)state;
    struct sitting t = begin();
    start(&t);
    pass(&t, 1);
    t.sight.ended = true;
    pass(&t, 0.1);
    EXPECT_INT(t.s.phase, LIVE_SUMMARY);
    EXPECT_INT(t.s.finished, 1);
}

static void test_summary_plays_the_place_that_is_touched(void **state)
{
    (void)state;
    struct sitting t = begin();
    start(&t);
    live_state_review(&t.s, S); // not now
    EXPECT_TRUE(!t.s.reviewing);
    pass(&t, 1);
    live_state_do(&t.s, LIVE_DO_START, t.now_ns);
    EXPECT_INT(t.s.phase, LIVE_SUMMARY);
    const struct live_result r = {.score = 64, .length_s = 8, .findings = 2, .compared = true, .worst_ns = 3 * S};
    live_state_on_result(&t.s, &r, 8 * S, t.now_ns);
    EXPECT_TRUE(!live_state_hint(&t.s));
    EXPECT_INT(t.s.review_at_ns, 3 * S); // the worst moment is shown, and stands still
    EXPECT_TRUE(!t.s.reviewing);
    live_state_review(&t.s, 2 * S);
    pass(&t, 1);
    EXPECT_NEAR((double)t.s.review_at_ns * 1e-9, 3, 0.1);
    pass(&t, 3);
    EXPECT_TRUE(!t.s.reviewing);
    EXPECT_INT(t.s.review_at_ns, 2 * S);
    live_state_do(&t.s, LIVE_DO_BACK_STEP, t.now_ns);
    EXPECT_INT(t.s.review_from_ns, 3 * S / 2);
    live_state_review(&t.s, 99 * S);
    EXPECT_INT(t.s.review_from_ns, 8 * S);
    live_state_do(&t.s, LIVE_DO_KEEP, t.now_ns);
    EXPECT_TRUE(t.s.keep_wanted);
}

static void test_progress_keeps_the_last_attempts(void **state)
{
    (void)state;
    struct sitting t = begin();
    for (int i = 0; i < LIVE_ATTEMPTS + 5; i++) {
        const struct live_result r = {.score = i, .length_s = 1, .compared = true};
        live_state_on_result(&t.s, &r, S, t.now_ns);
    }
    EXPECT_INT(t.s.result_count, LIVE_ATTEMPTS);
    EXPECT_INT(t.s.results_ever, LIVE_ATTEMPTS + 5);
    EXPECT_NEAR(t.s.results[LIVE_ATTEMPTS - 1].score, LIVE_ATTEMPTS + 4, 0);
    EXPECT_NEAR(t.s.results[0].score, 5, 0);
}

// An attempt has one reference throughout: who mirrors the actor while it is made begins again.
static void test_actor_is_mirrored(void **state)
{
    (void)state;
    struct sitting t = begin();
    live_state_do(&t.s, LIVE_DO_MIRROR, t.now_ns);
    EXPECT_TRUE(t.s.mirrored);
    EXPECT_INT(t.s.phase, LIVE_READY);
    start(&t);
    EXPECT_TRUE(t.s.attempt_mirrored);
    pass(&t, 1);
    live_state_do(&t.s, LIVE_DO_MIRROR, t.now_ns);
    EXPECT_TRUE(!t.s.mirrored);
    EXPECT_INT(t.s.phase, LIVE_COUNT_IN);
    EXPECT_INT(t.s.finished, 0);
    EXPECT_INT(t.s.at_ns, 0);
    pass(&t, 3.05);
    EXPECT_INT(t.s.attempt, 2);
    EXPECT_TRUE(!t.s.attempt_mirrored);
    pass(&t, 1);
    live_state_do(&t.s, LIVE_DO_START, t.now_ns); // stop
    EXPECT_INT(t.s.phase, LIVE_SUMMARY);
    live_state_do(&t.s, LIVE_DO_MIRROR, t.now_ns); // for the next one
    EXPECT_TRUE(t.s.mirrored && !t.s.attempt_mirrored);
    EXPECT_INT(t.s.phase, LIVE_SUMMARY);
    enum live_action action; // by the pad, while nothing moves
    EXPECT_TRUE(live_action_of(DO_STEP_ON, LIVE_READY, &action));
    EXPECT_INT(action, LIVE_DO_MIRROR);
}

// What does not matter is switched by group; one always counts.
static void test_what_counts_is_switched(void **state)
{
    (void)state;
    struct sitting t = begin();
    enum live_action action;
    EXPECT_TRUE(live_action_of((enum view_action)(DO_COUNT + GROUP_ARMS), LIVE_READY, &action));
    live_state_do(&t.s, action, t.now_ns);
    EXPECT_TRUE(!t.s.counting.counts[GROUP_ARMS] && t.s.counting.counts[GROUP_HEAD] && t.s.counting_changed);
    live_state_do(&t.s, action, t.now_ns);
    EXPECT_TRUE(t.s.counting.counts[GROUP_ARMS]);
    for (int g = 0; g < LIVE_GROUPS; g++)
        live_state_do(&t.s, (enum live_action)(LIVE_DO_COUNT + g), t.now_ns);
    EXPECT_TRUE(t.s.counting.counts[LIVE_GROUPS - 1]);
    for (int g = 0; g + 1 < LIVE_GROUPS; g++)
        EXPECT_TRUE(!t.s.counting.counts[g]);
}

// Each touch takes the next tolerance, after the largest none again; what was given otherwise goes on from there.
static void test_tolerances_go_round(void **state)
{
    (void)state;
    static const double wanted_deg[] = {5, 10, 20, 30, 0, 5};
    struct sitting t = begin();
    enum live_action action;
    EXPECT_TRUE(live_action_of((enum view_action)(DO_TOLERANCE + GROUP_LEGS), LIVE_READY, &action));
    for (size_t i = 0; i < COUNT_OF(wanted_deg); i++) {
        live_state_do(&t.s, action, t.now_ns);
        EXPECT_NEAR(t.s.counting.tolerance_deg[GROUP_LEGS], wanted_deg[i], 1e-9);
    }
    EXPECT_TRUE(t.s.counting_changed);
    EXPECT_NEAR(t.s.counting.tolerance_deg[GROUP_ARMS], 0, 1e-9);
    t.s.counting.tolerance_deg[GROUP_LEGS] = 12;
    live_state_do(&t.s, action, t.now_ns);
    EXPECT_NEAR(t.s.counting.tolerance_deg[GROUP_LEGS], 20, 1e-9);
    t.s.counting.tolerance_deg[GROUP_LEGS] = -1; // varied
    live_state_do(&t.s, action, t.now_ns);
    EXPECT_NEAR(t.s.counting.tolerance_deg[GROUP_LEGS], 5, 1e-9);
}

// The marked part counts alone from then on, also when the marks are taken back; without marks a sentence says how.
static void test_the_marked_part_counts(void **state)
{
    (void)state;
    struct sitting t = begin();
    enum live_action marked, all;
    EXPECT_TRUE(live_action_of(DO_COUNT_MARKED, LIVE_READY, &marked));
    EXPECT_TRUE(live_action_of(DO_COUNT_ALL, LIVE_READY, &all));
    t.s.sight.seeing = true;
    live_state_do(&t.s, marked, t.now_ns);
    EXPECT_TRUE(!t.s.counting_changed);
    EXPECT_TRUE(strstr(live_state_hint(&t.s), "Mark a part"));
    t.s.marked_from_ns = 1000000000;
    t.s.marked_to_ns = 2500000000;
    live_state_do(&t.s, marked, t.now_ns);
    EXPECT_TRUE(t.s.counting_changed);
    EXPECT_TRUE(!strstr(live_state_hint(&t.s), "Mark a part"));
    live_state_do(&t.s, LIVE_DO_MARK_FROM, t.now_ns); // where nothing moves: takes the marks back
    EXPECT_TRUE(!live_state_is_marked(&t.s));
    EXPECT_INT(t.s.counting.from_ns, 1000000000);
    EXPECT_INT(t.s.counting.to_ns, 2500000000);
    live_state_do(&t.s, all, t.now_ns);
    EXPECT_INT(t.s.counting.to_ns, 0);
}

static void test_screens_without_and_with_a_camera(void **state)
{
    (void)state;
    struct live_state s = live_state_start(false);
    live_state_do(&s, LIVE_DO_SCREEN, 0);
    EXPECT_INT(s.screen, LIVE_BESIDE);
    live_state_do(&s, LIVE_DO_SCREEN, 0);
    EXPECT_INT(s.screen, LIVE_MIRROR);
    s = live_state_start(true);
    for (int i = 0; i < 2; i++)
        live_state_do(&s, LIVE_DO_SCREEN, 0);
    EXPECT_INT(s.screen, LIVE_ROOM);
}

// Everything can be done by the game pad and by keys: each live action has an action of the view state.
static void test_pad_and_keys_reach_everything(void **state)
{
    (void)state;
    bool reached[LIVE_DO_ON_STEP + 1] = {0};
    for (int a = 0; a <= DO_COUNT_ALL; a++)
        for (int phase = LIVE_READY; phase <= LIVE_SUMMARY; phase++) {
            enum live_action action;
            if (live_action_of((enum view_action)a, (enum live_phase)phase, &action))
                reached[action] = true;
        }
    for (int i = 0; i <= LIVE_DO_ON_STEP; i++)
        EXPECT_TRUE(reached[i]);
}

static void test_page_of_the_view_state(void **state)
{
    (void)state;
    struct view_state s = view_state_start(2, true, S);
    const struct orbit orbit = {{0, 0, 1}, 0, 0.1, 3};
    s.live = live_state_start(false);
    view_state_open_take(&s, LENGTH, 120, &orbit, S);
    EXPECT_INT(s.page, PAGE_LIVE);
    EXPECT_TRUE(view_state_hint(&s));
    view_state_do(&s, DO_PLAY_PAUSE, S);
    EXPECT_INT(s.live.phase, LIVE_COUNT_IN);
    view_state_do(&s, DO_BACK, S); // leaves the attempt, then the page
    EXPECT_INT(s.live.phase, LIVE_READY);
    view_state_do(&s, DO_BACK, S);
    EXPECT_INT(s.page, PAGE_TAKES);
    view_state_open_take(&s, LENGTH, 120, &orbit, S);
    const struct gesture g = {.drag_x = 0.1, .spread = 1};
    view_state_gesture(&s, &g, NULL, S);
    EXPECT_TRUE(s.live.orbit.angle_rad != orbit.angle_rad);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_count_in_counts_down),
        cmocka_unit_test(test_person_who_stands_there_is_counted_in),
        cmocka_unit_test(test_actor_waits_for_who_stands_still),
        cmocka_unit_test(test_a_hold_is_no_deadlock),
        cmocka_unit_test(test_keep_up_waits_for_no_one),
        cmocka_unit_test(test_tempo),
        cmocka_unit_test(test_marked_part_is_looped),
        cmocka_unit_test(test_a_moment_is_not_judged),
        cmocka_unit_test(test_leaving_is_said_and_forgiven),
        cmocka_unit_test(test_second_person_is_said),
        cmocka_unit_test(test_sensor_trouble_is_said),
        cmocka_unit_test(test_end_of_a_film_ends_the_attempt),
        cmocka_unit_test(test_summary_plays_the_place_that_is_touched),
        cmocka_unit_test(test_progress_keeps_the_last_attempts),
        cmocka_unit_test(test_actor_is_mirrored),
        cmocka_unit_test(test_what_counts_is_switched),
        cmocka_unit_test(test_tolerances_go_round),
        cmocka_unit_test(test_the_marked_part_counts),
        cmocka_unit_test(test_screens_without_and_with_a_camera),
        cmocka_unit_test(test_pad_and_keys_reach_everything),
        cmocka_unit_test(test_page_of_the_view_state),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
