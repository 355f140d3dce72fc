// The instants of the coming frames are predicted at any speed, over the take's end, and where frames are skipped;
// nothing is predicted in vain.
#include "tests/support/test.h"

#include "app/state/playback_clock.h"

#define MS ((int64_t)1000000)
static const int64_t EACH_NS = 100 * MS / 3, LENGTH_NS = 3000 * MS;

// A frame that shows the instant take_ms and is drawn at clock_ms; loading one frame takes load_ms.
static int predict(struct playback_predictor *p, double take_ms, double clock_ms, double load_ms, bool loop,
                   int64_t at_ns[PREDICTED_MAX])
{
    const struct playback_now now = {(int64_t)(take_ms * MS), LENGTH_NS, EACH_NS, true, loop, (int64_t)(clock_ms * MS),
                                     (int64_t)(load_ms * MS)};
    return playback_predict(p, &now, at_ns);
}

static bool predicted(const int64_t *at_ns, int count, double take_ms)
{
    for (int i = 0; i < count; i++)
        if (fabs((double)at_ns[i] * 1e-6 - take_ms) < 1e-3)
            return true;
    return false;
}

static void test_predicts_as_far_as_before(void **state)
{
    (void)state;
    static const double steps_ms[] = {3.3, 33.3, 66.6, 100};
    for (size_t i = 0; i < COUNT_OF(steps_ms); i++) {
        const double step = steps_ms[i];
        struct playback_predictor p = {0};
        int64_t at_ns[PREDICTED_MAX];
        predict(&p, 1000, 10000, 10, true, at_ns);
        predict(&p, 1000 + step, 10050, 10, true, at_ns);
        int count = predict(&p, 1000 + 2 * step, 10100, 10, true, at_ns);
        EXPECT_INT(count, PREDICTED_MAX);
        EXPECT_AT_MOST(fabs((double)at_ns[0] * 1e-6 - (1000 + 3 * step)), 1e-3); // the most likely first
        EXPECT_TRUE(predicted(at_ns, count, 1000 + 4 * step) && predicted(at_ns, count, 1000 + 5 * step));
        // One frame was skipped: the next ones are not.
        count = predict(&p, 1000 + 4 * step, 10200, 10, true, at_ns);
        EXPECT_TRUE(predicted(at_ns, count, 1000 + 5 * step));
    }
}

static void test_wraps_at_end(void **state)
{
    (void)state;
    for (int loop = 0; loop < 2; loop++) {
        struct playback_predictor p = {0};
        int64_t at_ns[PREDICTED_MAX];
        predict(&p, 2800, 10000, 10, loop, at_ns);
        int count = predict(&p, 2900, 10100, 10, loop, at_ns); // then 3000, 3100 and 3200
        EXPECT_TRUE(predicted(at_ns, count, 3000));
        EXPECT_INT(predicted(at_ns, count, 3100 - 3000 - (double)EACH_NS * 1e-6), loop);
        for (int i = 0; i < count; i++)
            EXPECT_TRUE(at_ns[i] >= 0 && at_ns[i] < LENGTH_NS + EACH_NS);
        EXPECT_TRUE(loop ? count == PREDICTED_MAX : count < PREDICTED_MAX);
    }
}

static void test_predicts_only_loadable_frames(void **state)
{
    (void)state;
    struct playback_predictor p = {0};
    int64_t at_ns[PREDICTED_MAX];
    predict(&p, 1000, 10000, 0, true, at_ns);
    int count = predict(&p, 1050, 10050, 70, true, at_ns); // loading takes longer than from one frame to the next
    EXPECT_TRUE(!predicted(at_ns, count, 1100));
    EXPECT_TRUE(predicted(at_ns, count, 1150) && predicted(at_ns, count, 1200));
}

static void test_no_prediction_while_paused(void **state)
{
    (void)state;
    struct playback_predictor p = {0};
    int64_t at_ns[PREDICTED_MAX];
    struct playback_now now = {1000 * MS, LENGTH_NS, EACH_NS, false, true, 0, 0};
    EXPECT_INT(playback_predict(&p, &now, at_ns), 0);
    now.playing = true;
    EXPECT_INT(playback_predict(&p, &now, at_ns), PREDICTED_MAX); // playing starts: frame by frame
    EXPECT_AT_MOST(fabs((double)(at_ns[0] - now.at_ns - EACH_NS)), 1);
}

// Where predictions are always wrong they are rarely made, and always again after one was right.
static void test_no_useless_prediction(void **state)
{
    (void)state;
    struct playback_predictor p = {0};
    int64_t at_ns[PREDICTED_MAX];
    int tried = 0;
    for (int i = 0; i < 200; i++) {
        playback_predictor_report(&p, false);
        tried += predict(&p, 10 * i, 10 * i, 1, true, at_ns) > 0;
    }
    EXPECT_AT_LEAST(tried, 30);
    EXPECT_AT_MOST(tried, 35);
    playback_predictor_report(&p, true);
    EXPECT_INT(predict(&p, 2000, 2000, 1, true, at_ns), PREDICTED_MAX);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_predicts_as_far_as_before),     cmocka_unit_test(test_wraps_at_end),
        cmocka_unit_test(test_predicts_only_loadable_frames), cmocka_unit_test(test_no_prediction_while_paused),
        cmocka_unit_test(test_no_useless_prediction),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
