// The live screens without a window: a film with known mistakes comes through the real source, is tracked and judged
// while it plays, and the picture shows what was wrong.
//
//     test_live_screens                           the tests
//     test_live_screens FILE SENSOR CAMERA FOLDER TAKE   images of the screens, for the documents (tests/live_screens)
#include "tests/support/test.h"

#include "app/viewer/viewer_inside.h"
#include "base/clock.h"
#include "platform/files/file.h"
#include "platform/files/png.h"
#include "recording/recorded_expectation.h"
#include "tests/openni_driver/keep_player.h"
#include "tests/support/live_glass.h"
#include "tests/support/live_rehearsal.h"
#include "tests/support/process.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double RAD = 180 / 3.14159265358979323846; // degrees in a radian

enum { LONG = GLASS_LONG, SHORT = GLASS_SHORT, FRAMES = 54 }; // FRAMES: the arms are out

static struct live_rehearsal rehearsal;

static bool is_kept(const struct glass *g) { return viewer_live_view(g->viewer).kept > 0; }

// A file that is there already is never replaced: the attempt gets the next name.
static void check_attempt_is_kept(struct glass *g)
{
    struct recording *r = NULL;
    struct take *take = NULL;
    struct recording_report report;
    scratch_text(&rehearsal.scratch, "exercise-attempt-1.reenact", "mine");
    view_state_do(g->state, DO_KEEP, glass_now_ns(g));
    live_glass_draw_until(g, is_kept);
    EXPECT_TRUE(strstr(g->state->notice, "exercise-attempt-2.reenact"));
    const char *path = scratch_file(&rehearsal.scratch, "exercise-attempt-2.reenact");
    EXPECT_STATUS(recording_verify(path, &report), OK);
    EXPECT_STATUS(recording_open(&r, path), OK);
    EXPECT_STATUS(take_open(&take, r, recording_take_name(r, 0)), OK);
    print_message("%lld frames kept as '%s'\n", (long long)take_frame_count(take), recording_take_name(r, 0));
    EXPECT_AT_LEAST(take_frame_count(take), 10);
    EXPECT_TRUE(take_is_complete(take));
    EXPECT_AT_LEAST(take_body(take)->representative_frame, 0);
    take_close(&take);
    recording_free(&r);
    uint8_t *bytes;
    size_t count;
    EXPECT_STATUS(file_read(scratch_file(&rehearsal.scratch, "exercise-attempt-1.reenact"), &bytes, &count), OK);
    EXPECT_INT(count, 4);
    free(bytes);
}

static void test_mistakes_are_shown_while_they_are_made(void **state)
{
    (void)state;
    struct glass g;
    live_glass_open(&g, LONG / 2, SHORT / 2, &(struct live_glass){.file = rehearsal.file, .sensor = rehearsal.wrong});
    live_glass_draw_until(&g, live_glass_sees_person);
    EXPECT_INT(g.state->page, PAGE_LIVE);
    const struct live_tally t = live_glass_do_attempt(&g);
    // A slow machine draws few of the frames, and which depends on it.
    EXPECT_AT_LEAST(t.frames, FRAMES / 6);
    EXPECT_AT_LEAST(t.different[PART_RIGHT_FOREARM], t.frames / 4);
    EXPECT_AT_MOST(t.different[PART_LEFT_FOREARM], t.different[PART_RIGHT_FOREARM] / 3);
    EXPECT_AT_LEAST(t.wrong_pixels, 40);
    EXPECT_TRUE(viewer_live_view(g.viewer).attempt->compared);
    EXPECT_TRUE(live_glass_finds(&g, "Right elbow") || live_glass_finds(&g, "Right forearm"));
    EXPECT_INT(g.state->live.result_count, 1);
    check_attempt_is_kept(&g);
    glass_close(&g);
}

static void test_the_same_again_is_right(void **state)
{
    (void)state;
    struct glass g;
    live_glass_open(&g, LONG / 2, SHORT / 2, &(struct live_glass){.file = rehearsal.file, .sensor = rehearsal.right});
    g.state->live.screen = LIVE_BESIDE;
    live_glass_draw_until(&g, live_glass_sees_person);
    g.state->live.screen = LIVE_BESIDE;
    const struct live_tally t = live_glass_do_attempt(&g);
    EXPECT_AT_LEAST(t.frames, FRAMES / 6);
    for (int p = 0; p < PART_COUNT; p++)
        EXPECT_AT_MOST(t.different[p], t.frames / 5);
    // That no body points are looked for is said, once, with what to do.
    EXPECT_TRUE(viewer_live_view(g.viewer).no_points_told);
    EXPECT_TRUE(strstr(live_sensor_query(viewer_live_view(g.viewer).sensor).no_body_points, "models --fetch"));
    EXPECT_AT_LEAST(viewer_live_view(g.viewer).attempt->comparison.score, 75);
    glass_close(&g);
}

// ---------------------------------------------------------------- the actor mirrored

// Who does as the mirrored actor does is right; by the actor as recorded, the other side was used.
static void test_the_actor_mirrored_is_the_reference(void **state)
{
    (void)state;
    struct glass g;
    live_glass_open(&g, LONG / 2, SHORT / 2, &(struct live_glass){.file = rehearsal.file, .sensor = rehearsal.wrong});
    live_glass_draw_until(&g, live_glass_sees_person);
    view_state_do(g.state, DO_MIRROR, glass_now_ns(&g));
    EXPECT_TRUE(g.state->live.mirrored);
    const struct live_tally t = live_glass_do_attempt(&g);
    EXPECT_TRUE(g.image->flip_x || !g.image->actor);
    EXPECT_TRUE(viewer_live_view(g.viewer).attempt->mirrored && viewer_live_view(g.viewer).page->mirrored);
    // The exercise is the same on both sides, so that the mistake, made on the right, is found all the same.
    EXPECT_AT_LEAST(t.frames, FRAMES / 6);
    EXPECT_AT_LEAST(t.different[PART_RIGHT_FOREARM], t.frames / 4);
    EXPECT_TRUE(viewer_live_view(g.viewer).attempt->compared);
    glass_close(&g);
}

// ---------------------------------------------------------------- what counts

static struct take_expectation take_back_expectation(void)
{
    struct recording *r;
    struct take *take;
    struct take_expectation kept;
    EXPECT_STATUS(recording_open(&r, rehearsal.file), OK);
    EXPECT_STATUS(take_open(&take, r, recording_take_name(r, 0)), OK);
    EXPECT_AT_LEAST(recorded_expectation_read(take, &kept), OK);
    const int64_t number = take_number(take);
    take_close(&take);
    recording_free(&r);
    // for the tests that follow
    EXPECT_STATUS(recorded_expectation_write(rehearsal.file, number, &(struct take_expectation){.ignored = 0}), OK);
    return kept;
}

// Arms that do not matter, by touch: not coloured, not in the summary, and kept for the next time, as are tolerances.
static void test_what_does_not_matter_is_not_judged(void **state)
{
    (void)state;
    struct glass g;
    const uint16_t arms =
        1 << PART_LEFT_UPPER_ARM | 1 << PART_LEFT_FOREARM | 1 << PART_RIGHT_UPPER_ARM | 1 << PART_RIGHT_FOREARM;
    live_glass_open(&g, LONG / 2, SHORT / 2, &(struct live_glass){.file = rehearsal.file, .sensor = rehearsal.wrong});
    live_glass_draw_until(&g, live_glass_sees_person);
    view_state_do(g.state, (enum view_action)(DO_COUNT + GROUP_ARMS), glass_now_ns(&g));
    for (int i = 0; i < 3; i++)
        view_state_do(g.state, (enum view_action)(DO_TOLERANCE + GROUP_LEGS), glass_now_ns(&g));
    const struct live_tally t = live_glass_do_attempt(&g);
    EXPECT_AT_LEAST(t.frames, FRAMES / 6);
    EXPECT_INT(t.different[PART_RIGHT_FOREARM], 0);
    EXPECT_TRUE(viewer_live_view(g.viewer).attempt->compared);
    EXPECT_INT(viewer_live_view(g.viewer).attempt->comparison.by.ignored, arms);
    EXPECT_TRUE(!live_glass_finds(&g, "elbow") && !live_glass_finds(&g, "orearm"));
    EXPECT_NEAR(viewer_live_view(g.viewer).attempt->comparison.expected.tolerance_rad[PART_LEFT_SHIN] * RAD, 20, 1e-9);
    glass_close(&g);
    const struct take_expectation kept = take_back_expectation();
    EXPECT_INT(kept.ignored, arms);
    EXPECT_NEAR(kept.tolerance_rad[PART_LEFT_SHIN] * RAD, 20, 1e-9);
    EXPECT_NEAR(kept.tolerance_rad[PART_HEAD], 0, 1e-9);
    EXPECT_INT(kept.to_ns, 0);
}

// ---------------------------------------------------------------- through OpenNI2

// A film through OpenNI2 and its driver for recordings takes the sensor's place: tracked, judged and summed up.
static void test_a_film_through_openni(void **state)
{
    (void)state;
    struct glass g;
    char oni[300], uri[320];
    keep_player();
    snprintf(oni, sizeof oni, "%s", scratch_file(&rehearsal.scratch, "wrong.oni"));
    snprintf(uri, sizeof uri, "oni:%s", oni);
    const struct process_result said =
        PROCESS(MAKE_ONI, "--from", scratch_file(&rehearsal.scratch, "wrong"), "--out", oni);
    if (said.exit_code)
        print_error("%s", said.err);
    EXPECT_INT(said.exit_code, 0);
    live_glass_open(&g, LONG / 2, SHORT / 2, &(struct live_glass){.file = rehearsal.file, .sensor = uri});
    live_glass_draw_until(&g, live_glass_sees_person);
    const struct live_tally t = live_glass_do_attempt(&g);
    EXPECT_AT_LEAST(t.frames, FRAMES / 6);
    EXPECT_AT_LEAST(t.different[PART_RIGHT_FOREARM], t.frames / 4);
    EXPECT_TRUE(live_glass_finds(&g, "Right elbow") || live_glass_finds(&g, "Right forearm"));
    glass_close(&g);
}

static int set_up(void **state)
{
    (void)state;
    rehearsal = live_rehearsal_make(FRAMES, 0.5);
    setenv("XDG_DATA_HOME", rehearsal.scratch.path, 1); // where no networks are: from depth alone, as everywhere
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    live_rehearsal_end(&rehearsal);
    return 0;
}

// ---------------------------------------------------------------- images of the screens

static void save(struct glass *g, const char *folder, const char *name)
{
    char path[600];
    for (int dark = 1; dark >= 0; dark--) {
        g->state->dark = dark;
        glass_draw(g);
        glass_read(g);
        snprintf(path, sizeof path, "%s/live-%s-%s-%s.png", folder, name, g->width < g->height ? "upright" : "wide",
                 dark ? "dark" : "light");
        EXPECT_STATUS(png_write(path, PNG_RGBA8, g->rgba, g->width, g->height), OK);
    }
}

static bool arms_are_wrong(const struct glass *g)
{
    const struct live_page *page = viewer_live_view(g->viewer).page;
    return page->verdicts && page->verdicts[PART_RIGHT_FOREARM] == VERDICT_DIFFERENT && page->person_ns > 1500000000;
}

static void save_screens(const struct live_glass *shown, const char *folder, bool upright)
{
    static const struct {
        const char *name;
        enum live_screen screen;
        bool over;
    } shots[] = {{"mirror", LIVE_MIRROR, false},
                 {"over", LIVE_MIRROR, true},
                 {"beside", LIVE_BESIDE, false},
                 {"room", LIVE_ROOM, false}};
    struct glass g;
    live_glass_open(&g, upright ? SHORT : LONG, upright ? LONG : SHORT, shown);
    struct view_state *s = g.state;
    live_glass_draw_until(&g, live_glass_sees_person);
    s->live.hands_free = false;
    for (int64_t until_ns = clock_now_ns() + 200000000000; s->crossfade < 1 && clock_now_ns() < until_ns;)
        glass_draw_and_wait(&g);
    save(&g, folder, "ready");
    for (size_t i = 0; i < COUNT_OF(shots); i++) {
        s->live.screen = shots[i].screen;
        s->live.over = shots[i].over;
        view_state_do(s, DO_PLAY_PAUSE, glass_now_ns(&g));
        if (i == 0) {
            glass_draw(&g);
            save(&g, folder, "count-in");
        }
        live_glass_draw_until(&g, arms_are_wrong);
        save(&g, folder, shots[i].name);
        if (i + 1 < COUNT_OF(shots))
            view_state_do(s, DO_BACK, glass_now_ns(&g));
    }
    live_glass_draw_until(&g, live_glass_is_judged);
    live_state_review(&s->live, 1700000000);
    save(&g, folder, "summary");
    glass_close(&g);
}

int main(int argc, char **argv)
{
    if (argc == 6) {
        const struct live_glass shown = {argv[1], argv[5], argv[2], argv[3]};
        for (int upright = 0; upright < 2; upright++)
            save_screens(&shown, argv[4], upright);
        return 0;
    }
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_mistakes_are_shown_while_they_are_made),
        cmocka_unit_test(test_the_same_again_is_right),
        cmocka_unit_test(test_the_actor_mirrored_is_the_reference),
        cmocka_unit_test(test_what_does_not_matter_is_not_judged),
        cmocka_unit_test(test_a_film_through_openni),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
