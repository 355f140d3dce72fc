// The live screens without a window: a film with known mistakes comes through the real source, is tracked and judged
// while it plays, and the picture shows what was wrong.
//
//     test_live_screens                           the tests
//     test_live_screens FILE SENSOR CAMERA FOLDER TAKE   images of the screens, for the documents (tests/live_screens)
#include "tests/support/test.h"

#include "app/viewer.h"
#include "base/clock.h"
#include "platform/file.h"
#include "platform/png.h"
#include "tests/support/glass.h"
#include "tests/openni_driver/keep_player.h"
#include "tests/support/live_rehearsal.h"
#include "tests/support/process.h"
#include "tests/support/rehearsal.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { LONG = GLASS_LONG, SHORT = GLASS_SHORT, FRAMES = 54 }; // FRAMES: the arms are out

static struct live_rehearsal rehearsal;
static const char *shown_take; // NULL: the only one
static const char *camera;     // NULL: none
static int64_t patience_ns = 20000000000;

static void open_glass(struct glass *g, int width, int height, const char *file, const char *sensor)
{
    const struct viewer_options options = {.file = file,
                                           .take = shown_take,
                                           .camera = camera,
                                           .sensor = sensor,
                                           .fixed_resolution = true,
                                           .every_frame = true,
                                           .refresh_hz = 60};
    glass_open(g, width, height, &options);
}

// As the app's own loop: drawn when there is something new.
static void draw_what_is_new(struct glass *g)
{
    const int64_t now_ns = clock_now_ns();
    viewer_update(&g->viewer, now_ns);
    if (g->viewer.state.changed)
        glass_draw(g);
    else
        clock_sleep_until_ns(now_ns + 4000000);
}

static void draw_until(struct glass *g, bool (*done)(const struct glass *g))
{
    const int64_t until_ns = clock_now_ns() + patience_ns;
    do
        draw_what_is_new(g);
    while (!done(g) && clock_now_ns() < until_ns);
    if (!done(g))
        print_error("phase %d, %lld frames, in place %d, camera's frame %lld placed %d, presence %.2f, %s\n",
                    g->viewer.state.live.phase, (long long)g->viewer.state.live.sight.frame,
                    g->viewer.state.live.sight.in_place, (long long)g->viewer.state.camera.frame,
                    g->viewer.state.camera.placed, g->viewer.state.presence, g->viewer.state.live.trouble);
    EXPECT_TRUE(done(g));
}

static bool sees_person(const struct glass *g) { return g->viewer.state.live.person_ns != 0; }
static bool is_doing(const struct glass *g) { return g->viewer.state.live.phase == LIVE_DOING; }
static bool is_judged(const struct glass *g)
{
    const struct live_state *l = &g->viewer.state.live;
    return l->phase == LIVE_SUMMARY && l->judged == l->finished;
}

struct tally {
    int frames, different[PART_COUNT], same[PART_COUNT];
    int wrong_pixels; // of the colour for what differs, at most
};

// Draws the attempt to its end and counts the verdicts.
static struct tally do_attempt(struct glass *g)
{
    struct tally t = {0};
    int64_t seen = 0;
    view_state_do(&g->viewer.state, DO_PLAY_PAUSE, clock_now_ns());
    draw_until(g, is_doing);
    for (int64_t until_ns = clock_now_ns() + 120000000000; !is_judged(g) && clock_now_ns() < until_ns;) {
        draw_what_is_new(g);
        const struct live_page *page = &g->viewer.live.page;
        if (!is_doing(g) || !page->verdicts || g->viewer.live.frame->number == seen)
            continue;
        seen = g->viewer.live.frame->number;
        t.frames++;
        for (int p = 0; p < PART_COUNT; p++) {
            t.different[p] += page->verdicts[p] == VERDICT_DIFFERENT;
            t.same[p] += page->verdicts[p] == VERDICT_SAME;
        }
        if (page->verdicts[PART_RIGHT_FOREARM] == VERDICT_DIFFERENT && seen % 8 == 0) {
            glass_read(g);
            const int pixels = glass_count_color(g, theme_of(true)->wrong, 3);
            t.wrong_pixels = pixels > t.wrong_pixels ? pixels : t.wrong_pixels;
        }
    }
    return t;
}

static bool finds(const struct glass *g, const char *words)
{
    const struct comparison *c = &g->viewer.live.shown.comparison;
    for (int32_t i = 0; i < c->finding_count; i++)
        if (strstr(c->findings[i].sentence, words))
            return true;
    return false;
}

static void print_tally(const struct glass *g, const struct tally *t)
{
    const struct comparison *c = &g->viewer.live.shown.comparison;
    print_message("%d frames judged; right forearm different in %d, same in %d; left forearm %d, %d; %d pixels; "
                  "score %.1f\n",
                  t->frames, t->different[PART_RIGHT_FOREARM], t->same[PART_RIGHT_FOREARM],
                  t->different[PART_LEFT_FOREARM], t->same[PART_LEFT_FOREARM], t->wrong_pixels, c->score);
    for (int32_t i = 0; i < c->finding_count; i++)
        print_message("    %s\n", c->findings[i].sentence);
}

static bool is_kept(const struct glass *g) { return g->viewer.live.kept > 0; }

// A file that is there already is never replaced: the attempt gets the next name.
static void check_attempt_is_kept(struct glass *g)
{
    struct recording *r = NULL;
    struct take *take = NULL;
    struct recording_report report;
    scratch_text(&rehearsal.scratch, "exercise-attempt-1.reenact", "mine");
    view_state_do(&g->viewer.state, DO_KEEP, clock_now_ns());
    draw_until(g, is_kept);
    EXPECT_TRUE(strstr(g->viewer.state.notice, "exercise-attempt-2.reenact"));
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
    open_glass(&g, LONG / 2, SHORT / 2, rehearsal.file, rehearsal.wrong);
    draw_until(&g, sees_person);
    EXPECT_INT(g.viewer.state.page, PAGE_LIVE);
    const struct tally t = do_attempt(&g);
    print_tally(&g, &t);
    // A slow machine draws few of the frames, and which depends on it.
    EXPECT_AT_LEAST(t.frames, FRAMES / 6);
    EXPECT_AT_LEAST(t.different[PART_RIGHT_FOREARM], t.frames / 4);
    EXPECT_AT_MOST(t.different[PART_LEFT_FOREARM], t.different[PART_RIGHT_FOREARM] / 3);
    EXPECT_AT_LEAST(t.wrong_pixels, 40);
    EXPECT_TRUE(g.viewer.live.shown.compared);
    EXPECT_TRUE(finds(&g, "Right elbow") || finds(&g, "Right forearm"));
    EXPECT_INT(g.viewer.state.live.result_count, 1);
    check_attempt_is_kept(&g);
    glass_close(&g);
}

static void test_the_same_again_is_right(void **state)
{
    (void)state;
    struct glass g;
    open_glass(&g, LONG / 2, SHORT / 2, rehearsal.file, rehearsal.right);
    g.viewer.state.live.screen = LIVE_BESIDE;
    draw_until(&g, sees_person);
    g.viewer.state.live.screen = LIVE_BESIDE;
    const struct tally t = do_attempt(&g);
    print_tally(&g, &t);
    EXPECT_AT_LEAST(t.frames, FRAMES / 6);
    for (int p = 0; p < PART_COUNT; p++)
        EXPECT_AT_MOST(t.different[p], t.frames / 5);
    EXPECT_AT_LEAST(g.viewer.live.shown.comparison.score, 75);
    glass_close(&g);
}

// ---------------------------------------------------------------- in the room

static bool is_in_the_room(const struct glass *g)
{
    const struct view_state *s = &g->viewer.state;
    return sees_person(g) && s->camera.placed && s->presence >= 1 && s->live.sight.in_place;
}

// Person and actor as the tablet's own camera sees the room: each where they are in it, the actor at the instant that
// is done, the mistakes in their colour.
static void test_both_stand_in_the_room(void **state)
{
    (void)state;
    struct glass g;
    camera = rehearsal.camera;
    open_glass(&g, LONG / 2, SHORT / 2, rehearsal.file, rehearsal.wrong);
    camera = NULL;
    struct viewer *v = &g.viewer;
    draw_until(&g, sees_person);
    v->state.live.hands_free = false;
    for (int i = 0; i < 2; i++)
        view_state_do(&v->state, DO_SCREEN, clock_now_ns());
    EXPECT_INT(v->state.live.screen, LIVE_ROOM);
    draw_until(&g, is_in_the_room);
    glass_draw(&g);
    EXPECT_TRUE(v->image.camera && v->image.actor && v->live.page.person);
    EXPECT_TRUE(!view_state_hint_warns(&v->state));
    const struct vec3 actor = v->image.skeleton.joint[JOINT_WAIST], person = v->live.page.person->joint[JOINT_WAIST];
    print_message("the person is %.2f, %.2f, %.2f m from the actor\n", person.x - actor.x, person.y - actor.y,
                  person.z - actor.z);
    EXPECT_NEAR(person.x - actor.x, LIVE_REHEARSAL_ASIDE_M, 0.1);
    EXPECT_NEAR(person.y - actor.y, 0, 0.15);
    const struct tally t = do_attempt(&g);
    print_tally(&g, &t);
    EXPECT_AT_LEAST(t.frames, FRAMES / 6);
    EXPECT_AT_LEAST(t.different[PART_RIGHT_FOREARM], t.frames / 4);
    EXPECT_AT_LEAST(t.wrong_pixels, 20);
    EXPECT_TRUE(v->live.shown.compared);
    glass_close(&g);
}

// The actor's instant, not that of the player which watches takes.
static void test_the_room_shows_the_instant_that_is_done(void **state)
{
    (void)state;
    struct glass g;
    camera = rehearsal.camera;
    open_glass(&g, LONG / 2, SHORT / 2, rehearsal.file, rehearsal.right);
    camera = NULL;
    struct viewer *v = &g.viewer;
    v->state.live.screen = LIVE_ROOM;
    draw_until(&g, sees_person);
    v->state.live.screen = LIVE_ROOM;
    v->state.live.hands_free = false;
    draw_until(&g, is_in_the_room);
    view_state_do(&v->state, DO_PACE, clock_now_ns()); // keep up: it moves, whatever the person does
    view_state_do(&v->state, DO_PLAY_PAUSE, clock_now_ns());
    draw_until(&g, is_doing);
    int drawn = 0;
    double gap_m = 0;
    while (is_doing(&g) && drawn < 200) {
        draw_what_is_new(&g);
        const struct live_page *page = &v->live.page;
        if (!is_doing(&g) || !page->person || !v->image.has_skeleton || v->state.live.end_ns)
            continue;
        drawn++;
        const struct vec3 now = v->image.skeleton.joint[JOINT_RIGHT_HAND];
        struct take_view_request again = {.lens = v->image.lens,
                                          .world_from_camera = v->image.world_from_camera,
                                          .time_ns = v->state.live.at_ns,
                                          .camera_lost = true,
                                          .resolution_scale = 1};
        struct take_view_image there;
        EXPECT_STATUS(take_view_draw(v->take_view, &again, &there), OK);
        gap_m = fmax(gap_m, v3_distance(now, there.skeleton.joint[JOINT_RIGHT_HAND]));
    }
    print_message("%d drawings, the hand at most %.3f m from where it is at the instant that is done\n", drawn, gap_m);
    EXPECT_AT_LEAST(drawn, 5);
    EXPECT_AT_MOST(gap_m, 1e-3);
    glass_close(&g);
}

// Before a wall on which the place knows nothing, it is said what is missing.
static void test_the_room_says_what_is_missing(void **state)
{
    (void)state;
    struct glass g;
    char blind[300];
    rehearse_camera(&rehearsal.scratch, "blind", NULL, 1);
    snprintf(blind, sizeof blind, "folder:%s", scratch_file(&rehearsal.scratch, "blind"));
    camera = blind;
    open_glass(&g, LONG / 2, SHORT / 2, rehearsal.file, rehearsal.right);
    camera = NULL;
    struct view_state *s = &g.viewer.state;
    s->live.screen = LIVE_ROOM;
    draw_until(&g, sees_person);
    s->live.screen = LIVE_ROOM;
    s->live.hands_free = false;
    for (int64_t until_ns = clock_now_ns() + 60000000000; clock_now_ns() < until_ns;) {
        draw_what_is_new(&g);
        if (view_state_hint(s) && strstr(view_state_hint(s), "Point the camera at a tag"))
            break;
    }
    EXPECT_TRUE(view_state_hint(s) && strstr(view_state_hint(s), "Point the camera at a tag"));
    EXPECT_TRUE(view_state_hint_warns(s));
    s->live.sight.in_place = false; // a sensor that is not located in the place is said first
    EXPECT_TRUE(strstr(view_state_hint(s), "The sensor sees nothing of the room"));
    s->live.screen = LIVE_MIRROR; // where neither matters
    EXPECT_TRUE(!view_state_hint(s) || !strstr(view_state_hint(s), "room"));
    glass_close(&g);
}

// ---------------------------------------------------------------- the actor mirrored

// Who does as the mirrored actor does is right; by the actor as recorded, the other side was used.
static void test_the_actor_mirrored_is_the_reference(void **state)
{
    (void)state;
    struct glass g;
    open_glass(&g, LONG / 2, SHORT / 2, rehearsal.file, rehearsal.wrong);
    struct viewer *v = &g.viewer;
    draw_until(&g, sees_person);
    view_state_do(&v->state, DO_MIRROR, clock_now_ns());
    EXPECT_TRUE(v->state.live.mirrored);
    const struct tally t = do_attempt(&g);
    print_tally(&g, &t);
    EXPECT_TRUE(v->image.flip_x || !v->image.actor);
    EXPECT_TRUE(v->live.shown.mirrored && v->live.page.mirrored);
    // The exercise is the same on both sides, so that the mistake, made on the right, is found all the same.
    EXPECT_AT_LEAST(t.frames, FRAMES / 6);
    EXPECT_AT_LEAST(t.different[PART_RIGHT_FOREARM], t.frames / 4);
    EXPECT_TRUE(v->live.shown.compared);
    glass_close(&g);
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
    open_glass(&g, LONG / 2, SHORT / 2, rehearsal.file, uri);
    draw_until(&g, sees_person);
    const struct tally t = do_attempt(&g);
    print_tally(&g, &t);
    EXPECT_AT_LEAST(t.frames, FRAMES / 6);
    EXPECT_AT_LEAST(t.different[PART_RIGHT_FOREARM], t.frames / 4);
    EXPECT_TRUE(finds(&g, "Right elbow") || finds(&g, "Right forearm"));
    glass_close(&g);
}

static int set_up(void **state)
{
    (void)state;
    rehearsal = live_rehearsal_make(FRAMES, 0.5);
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
        g->viewer.state.dark = dark;
        glass_draw(g);
        glass_read(g);
        snprintf(path, sizeof path, "%s/live-%s-%s-%s.png", folder, name, g->width < g->height ? "upright" : "wide",
                 dark ? "dark" : "light");
        EXPECT_STATUS(png_write(path, PNG_RGBA8, g->rgba, g->width, g->height), OK);
    }
}

static bool arms_are_wrong(const struct glass *g)
{
    const struct live_page *page = &g->viewer.live.page;
    return page->verdicts && page->verdicts[PART_RIGHT_FOREARM] == VERDICT_DIFFERENT && page->person_ns > 1500000000;
}

static void save_screens(const char *file, const char *sensor, const char *folder, bool upright)
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
    open_glass(&g, upright ? SHORT : LONG, upright ? LONG : SHORT, file, sensor);
    struct view_state *s = &g.viewer.state;
    draw_until(&g, sees_person);
    s->live.hands_free = false;
    for (int64_t until_ns = clock_now_ns() + 200000000000; s->crossfade < 1 && clock_now_ns() < until_ns;)
        glass_draw_and_wait(&g);
    save(&g, folder, "ready");
    for (size_t i = 0; i < COUNT_OF(shots); i++) {
        s->live.screen = shots[i].screen;
        s->live.over = shots[i].over;
        view_state_do(s, DO_PLAY_PAUSE, clock_now_ns());
        if (i == 0) {
            glass_draw(&g);
            save(&g, folder, "count-in");
        }
        draw_until(&g, arms_are_wrong);
        save(&g, folder, shots[i].name);
        if (i + 1 < COUNT_OF(shots))
            view_state_do(s, DO_BACK, clock_now_ns());
    }
    draw_until(&g, is_judged);
    live_state_review(&s->live, 1700000000);
    save(&g, folder, "summary");
    glass_close(&g);
}

int main(int argc, char **argv)
{
    if (argc == 6) {
        camera = argv[3];
        shown_take = argv[5];
        for (int upright = 0; upright < 2; upright++)
            save_screens(argv[1], argv[2], argv[4], upright);
        return 0;
    }
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_mistakes_are_shown_while_they_are_made),
        cmocka_unit_test(test_the_same_again_is_right),
        cmocka_unit_test(test_both_stand_in_the_room),
        cmocka_unit_test(test_the_room_shows_the_instant_that_is_done),
        cmocka_unit_test(test_the_room_says_what_is_missing),
        cmocka_unit_test(test_the_actor_mirrored_is_the_reference),
        cmocka_unit_test(test_a_film_through_openni),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
