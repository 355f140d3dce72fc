// Two takes of a recording compared in the app, without a sensor: on a thread, and as they are chosen on the screen.
//
//     test_take_comparison          the tests
//     test_take_comparison FOLDER   and pictures of the screens
#include "app/live/live_attempt.h"
#include "base/clock.h"
#include "platform/files/png.h"
#include "recording/recorded_expectation.h"
#include "tests/support/exercise.h"
#include "tests/support/glass.h"
#include "tests/support/recording_sample.h"

#include <stdatomic.h>

static const char *pictures; // NULL: none are wanted
static char path[200];
static atomic_int told;

static void notify(void *self) { atomic_fetch_add((atomic_int *)self, 1); }

static void write_take(struct recording_writer *w, const char *name, const struct exercise *e, bool person)
{
    const struct calibration calibration = sample_calibration();
    static struct sample_frame image;
    struct rng rng = {3};
    sample_frame_make(&image, 0);
    EXPECT_STATUS(recording_begin_take(w, name, &calibration), OK);
    for (int i = 0; i < (int)(e->seconds * 30); i++) {
        struct take_frame frame = {.time_ns = i * INT64_C(33333333),
                                   .world_from_camera = POSE_IDENTITY,
                                   .jpeg = image.jpeg,
                                   .jpeg_bytes = image.frame.jpeg_bytes,
                                   .has_skeleton = person};
        if (person)
            frame.skeleton = exercise_at(e, i / 30.0, &rng);
        EXPECT_STATUS(recording_add_frame(w, &frame), OK);
    }
    EXPECT_STATUS(recording_end_take(w), OK);
    free(image.jpeg);
}

static int set_up(void **state)
{
    struct recording_writer *w;
    struct exercise right = exercise_default(), wrong;
    if (sample_folder_make(state))
        return -1;
    snprintf(path, sizeof path, "%s", sample_path("two.reenact"));
    right.seconds = 3;
    wrong = right;
    wrong.right_elbow_rad = 0.7;
    wrong.wrong_to_s = 3;
    EXPECT_STATUS(recording_create(&w, path), OK);
    write_take(w, "teacher", &right, true);
    write_take(w, "pupil", &wrong, true);
    write_take(w, "nobody", &right, false);
    EXPECT_STATUS(recording_close(&w), OK);
    return 0;
}

// ---------------------------------------------------------------- on a thread

static struct live_attempt compare(const char *reference, const char *attempt)
{
    struct attempt_judge *judge;
    struct live_attempt out = {0};
    const struct takes_task task = {path, reference, path, attempt, 5, notify, &told};
    const int64_t until_ns = clock_now_ns() + 60 * (int64_t)1000000000;
    const int before = atomic_load(&told);
    EXPECT_STATUS(attempt_judge_start_takes(&judge, &task), OK);
    while (!attempt_judge_finished(judge, &out) && clock_now_ns() < until_ns)
        clock_sleep_until_ns(clock_now_ns() + 1000000);
    attempt_judge_close(&judge);
    EXPECT_INT(out.number, 5);
    EXPECT_INT(atomic_load(&told), before + 1);
    return out;
}

// The same numbers as reenact compare has.
static void test_takes_are_compared_on_a_thread(void **state)
{
    (void)state;
    struct movement movement[2];
    struct movement_source source;
    struct comparison c;
    EXPECT_STATUS(movement_read(path, "teacher", &movement[0], &source), OK);
    EXPECT_STATUS(movement_read(path, "pupil", &movement[1], &source), OK);
    EXPECT_STATUS(comparison_make(&movement[0], &movement[1], NULL, &c), OK);
    struct live_attempt a = compare("teacher", "pupil");
    EXPECT_TRUE(a.compared);
    EXPECT_NEAR(a.comparison.score, c.score, 0);
    EXPECT_INT(a.comparison.finding_count, c.finding_count);
    EXPECT_TRUE(strstr(a.comparison.findings[0].sentence, "Right elbow") != NULL);
    struct skeleton skeleton;
    EXPECT_TRUE(live_attempt_skeleton(&a, 1000000000, &skeleton));
    EXPECT_NEAR(live_attempt_reference(&a, 1000000000), 30, 3);
    comparison_free(&c);
    live_attempt_free(&a);
}

// A further reference in which no person was tracked is not used, and it is said.
static void test_what_is_expected_and_cannot_be_used_is_said(void **state)
{
    (void)state;
    struct recording *r;
    EXPECT_STATUS(recording_open(&r, path), OK);
    const int64_t teacher = recording_take_number(r, "teacher");
    struct take_expectation expected = {.reference_count = 1, .reference = {recording_take_number(r, "nobody")}};
    recording_free(&r);
    EXPECT_STATUS(recorded_expectation_write(path, teacher, &expected), OK);
    struct live_attempt a = compare("teacher", "pupil");
    print_message("%s\n", a.note);
    EXPECT_TRUE(a.compared && strstr(a.note, "'nobody' is left out"));
    live_attempt_free(&a);
    expected.reference_count = 0;
    EXPECT_STATUS(recorded_expectation_write(path, teacher, &expected), OK);
    a = compare("teacher", "pupil");
    EXPECT_TRUE(a.compared && !*a.note);
    live_attempt_free(&a);
}

static void test_what_cannot_be_compared_says_why(void **state)
{
    (void)state;
    static const char *const pairs[][2] = {{"teacher", "nobody"}, {"nobody", "teacher"}, {"teacher", "no such take"}};
    for (size_t k = 0; k < COUNT_OF(pairs); k++) {
        struct live_attempt a = compare(pairs[k][0], pairs[k][1]);
        print_message("%s\n", a.why);
        EXPECT_TRUE(!a.compared && *a.why);
        live_attempt_free(&a);
    }
    struct attempt_judge *judge;
    const struct takes_task task = {path, "teacher", path, "pupil", 1, NULL, NULL};
    EXPECT_STATUS(attempt_judge_start_takes(&judge, &task), OK);
    attempt_judge_close(&judge); // while it is compared
    EXPECT_TRUE(!judge);
}

// ---------------------------------------------------------------- on the screen

static void open_list(struct glass *g, int width, int height)
{
    const struct viewer_options options = {.file = path, .refresh_hz = 60};
    glass_open(g, width, height, &options);
    glass_draw(g);
    EXPECT_INT(g->state->page, PAGE_TAKES);
}

static void draw_until_compared(struct glass *g)
{
    const int64_t until_ns = clock_now_ns() + 60 * (int64_t)1000000000;
    while (g->state->live.judged != g->state->live.finished && clock_now_ns() < until_ns)
        glass_draw(g);
    glass_draw(g);
    glass_draw(g);
}

static void save(struct glass *g, const char *name)
{
    char file[600];
    if (!pictures)
        return;
    glass_read(g);
    snprintf(file, sizeof file, "%s/comparison-%s-%dx%d.png", pictures, name, g->width, g->height);
    EXPECT_STATUS(png_write(file, PNG_RGBA8, g->rgba, g->width, g->height), OK);
}

static const struct ui_mark *find_mark(const struct glass *g, const char *name)
{
    int count = 0;
    const struct ui_mark *marks = ui_marks(viewer_ui(g->viewer), &count);
    for (int i = 0; i < count; i++)
        if (!strcmp(marks[i].text, name))
            return &marks[i];
    print_error("%s is not on the screen\n", name);
    return NULL;
}

static void tap(struct glass *g, const char *name)
{
    const struct ui_mark *m = find_mark(g, name);
    EXPECT_TRUE(m != NULL);
    glass_tap(g, (struct ui_point){m->box.x + m->box.w / 2, m->box.y + m->box.h / 2});
}

static void expect_result(struct glass *g)
{
    const struct view_state *s = g->state;
    const struct live_page *page = viewer_live_view(g->viewer).page;
    EXPECT_INT(s->page, PAGE_LIVE);
    EXPECT_TRUE(s->live.of_takes && s->live.phase == LIVE_SUMMARY);
    draw_until_compared(g);
    EXPECT_TRUE(page->comparison && page->attempt && page->reference);
    EXPECT_TRUE(strstr(page->comparison->findings[0].sentence, "Right elbow") != NULL);
    assert_string_equal(page->names[0], "teacher");
    assert_string_equal(page->names[1], "pupil");
    EXPECT_TRUE(find_mark(g, "pupil compared with teacher") && find_mark(g, "summary-takes"));
}

static void test_two_takes_are_chosen_by_touch(void **state)
{
    (void)state;
    static const int sizes[][2] = {{1280, 800}, {800, 480}, {800, 1280}};
    for (size_t k = 0; k < COUNT_OF(sizes); k++) {
        struct glass g;
        open_list(&g, sizes[k][0], sizes[k][1]);
        glass_draw(&g);
        save(&g, "list");
        tap(&g, "takes-compare");
        EXPECT_INT(g.state->compare.asked, CHOICE_REFERENCE);
        tap(&g, "take-0");
        EXPECT_INT(g.state->page, PAGE_TAKES);
        EXPECT_INT(g.state->compare.asked, CHOICE_ATTEMPT);
        glass_draw(&g);
        save(&g, "choose");
        tap(&g, "take-0"); // with itself: still asked
        EXPECT_INT(g.state->compare.asked, CHOICE_ATTEMPT);
        tap(&g, "take-1");
        EXPECT_TRUE(view_state_hint(g.state) && !view_state_hint_warns(g.state));
        glass_draw(&g);
        save(&g, "waits");
        expect_result(&g);
        save(&g, "result");
        tap(&g, "summary-takes");
        EXPECT_INT(g.state->page, PAGE_TAKES);
        tap(&g, "take-1"); // and is watched as ever
        EXPECT_TRUE(g.state->take == 1 && g.state->page != PAGE_LIVE);
        glass_close(&g);
    }
}

static void test_two_takes_are_chosen_by_keys(void **state)
{
    (void)state;
    struct glass g;
    open_list(&g, 640, 400);
    glass_press(&g, 'c');
    glass_press(&g, WINDOW_KEY_ESCAPE); // asks no more
    EXPECT_TRUE(g.state->page == PAGE_TAKES && !g.state->quit && g.state->compare.asked == CHOICE_NONE);
    glass_press(&g, 'c');
    glass_press(&g, WINDOW_KEY_ENTER);
    glass_press(&g, WINDOW_KEY_RIGHT);
    glass_press(&g, WINDOW_KEY_ENTER);
    expect_result(&g);
    // What is done again or kept is an attempt; here it is neither.
    glass_press(&g, WINDOW_KEY_SPACE);
    glass_press(&g, 's');
    EXPECT_TRUE(g.state->live.phase == LIVE_SUMMARY && !g.state->live.keep_wanted);
    glass_press(&g, WINDOW_KEY_RIGHT); // plays on
    EXPECT_TRUE(g.state->live.reviewing);
    glass_press(&g, WINDOW_KEY_ESCAPE);
    EXPECT_TRUE(g.state->page == PAGE_TAKES && !g.state->quit && !g.state->live.of_takes);
    glass_close(&g);
}

// The attempt in another recording, whose takes are listed once the reference is chosen; back to this one's at the end.
static void test_two_recordings(void **state)
{
    (void)state;
    struct recording_writer *w;
    struct glass g;
    static char other[200];
    struct exercise wrong = exercise_default();
    wrong.seconds = 3;
    wrong.right_elbow_rad = 0.7;
    wrong.wrong_to_s = 3;
    snprintf(other, sizeof other, "%s", sample_path("other.reenact"));
    EXPECT_STATUS(recording_create(&w, other), OK);
    write_take(w, "pupil", &wrong, true);
    EXPECT_STATUS(recording_close(&w), OK);
    const struct viewer_options options = {.file = path, .compare_with = other, .refresh_hz = 60};
    glass_open(&g, 640, 400, &options);
    glass_draw(&g);
    EXPECT_INT(g.state->compare.asked, CHOICE_REFERENCE);
    tap(&g, "take-1"); // the pupil of this one: back, and the teacher
    EXPECT_TRUE(view_state_lists_other(g.state));
    glass_press(&g, WINDOW_KEY_ESCAPE);
    EXPECT_TRUE(g.state->compare.asked == CHOICE_NONE && g.state->take == 1 && g.state->take_count == 3);
    glass_press(&g, 'c');
    tap(&g, "take-0");
    EXPECT_TRUE(view_state_lists_other(g.state) && g.state->take_count == 1);
    EXPECT_TRUE(find_mark(&g, "other.reenact · one take") != NULL);
    tap(&g, "take-0");
    expect_result(&g);
    glass_press(&g, WINDOW_KEY_ESCAPE);
    EXPECT_TRUE(g.state->page == PAGE_TAKES && g.state->take_count == 3);
    glass_close(&g);
}

// A result that comes after it was left is not shown; and the next two wait for it.
static void test_it_is_left_while_it_compares(void **state)
{
    (void)state;
    struct glass g;
    open_list(&g, 640, 400);
    view_state_do(g.state, DO_COMPARE, glass_now_ns(&g));
    view_state_choose_take(g.state, 1);
    view_state_choose_take(g.state, 2);
    glass_draw(&g);
    glass_press(&g, WINDOW_KEY_ESCAPE);
    EXPECT_INT(g.state->page, PAGE_TAKES);
    view_state_do(g.state, DO_COMPARE, glass_now_ns(&g));
    view_state_choose_take(g.state, 0);
    view_state_choose_take(g.state, 1);
    expect_result(&g);
    glass_press(&g, WINDOW_KEY_ESCAPE);
    // Nobody is in the third: the summary says so.
    view_state_do(g.state, DO_COMPARE, glass_now_ns(&g));
    view_state_choose_take(g.state, 0);
    view_state_choose_take(g.state, 2);
    draw_until_compared(&g);
    EXPECT_TRUE(viewer_live_view(g.viewer).page->why_not && !viewer_live_view(g.viewer).page->comparison);
    glass_close(&g);
}

int main(int argc, char **argv)
{
    pictures = argc > 1 ? argv[1] : NULL;
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_takes_are_compared_on_a_thread),
        cmocka_unit_test(test_what_is_expected_and_cannot_be_used_is_said),
        cmocka_unit_test(test_what_cannot_be_compared_says_why),
        cmocka_unit_test(test_two_takes_are_chosen_by_touch),
        cmocka_unit_test(test_two_takes_are_chosen_by_keys),
        cmocka_unit_test(test_two_recordings),
        cmocka_unit_test(test_it_is_left_while_it_compares),
    };
    return cmocka_run_group_tests(tests, set_up, sample_folder_remove);
}
