// The thread that judges takes: each answer is the verdict that is said everywhere, one at a time, and it ends when it
// is told to.
#include "app/viewer/take_judge.h"
#include "base/clock.h"
#include "capture/take_verdict.h"
#include "tests/support/recording_sample.h"

#include <stdatomic.h>

static atomic_int told;

static void notify(void *self) { atomic_fetch_add((atomic_int *)self, 1); }

static bool wait_for(struct take_judge *j, int *number, struct take_verdict *out, bool *good)
{
    const int64_t until_ns = clock_now_ns() + 60 * (int64_t)1000000000;
    while (clock_now_ns() < until_ns) {
        if (take_judge_take(j, number, out, good))
            return true;
        clock_sleep_until_ns(clock_now_ns() + 1000000);
    }
    return false;
}

static void test_takes_are_judged_one_by_one(void **state)
{
    (void)state;
    struct take_judge *j;
    struct recording *r;
    struct take_verdict verdict, wanted;
    int number;
    bool good;
    const char *path = sample_path("judged");
    sample_recording_write(path);
    EXPECT_STATUS(recording_open(&r, path), OK);
    EXPECT_STATUS(take_judge_start(&j, path, notify, &told), OK);
    EXPECT_TRUE(!take_judge_take(j, &number, &verdict, &good)); // nothing was asked for
    for (int i = 0; i < recording_take_count(r); i++) {
        char texts[2][VERDICT_TEXT_BYTES];
        EXPECT_TRUE(take_judge_ask(j, i, recording_take_name(r, i)));
        EXPECT_TRUE(!take_judge_ask(j, 7, "another")); // until the answer is taken
        EXPECT_TRUE(wait_for(j, &number, &verdict, &good));
        EXPECT_TRUE(good && number == i && atomic_load(&told) == i + 1);
        EXPECT_STATUS(take_verdict_get(r, recording_take_name(r, i), NULL, &wanted), OK);
        assert_string_equal(verdict_text(&verdict, texts[0]), verdict_text(&wanted, texts[1]));
        EXPECT_TRUE(!take_judge_take(j, &number, &verdict, &good)); // once
    }
    EXPECT_TRUE(take_judge_ask(j, 3, "no such take"));
    EXPECT_TRUE(wait_for(j, &number, &verdict, &good));
    EXPECT_TRUE(!good && number == 3);
    EXPECT_TRUE(take_judge_ask(j, 0, recording_take_name(r, 0)));
    take_judge_close(&j); // while it is judged
    EXPECT_TRUE(!j);
    take_judge_close(&j);
    recording_free(&r);
}

static bool goes_on(void *self)
{
    int *left = self;
    return (*left)-- > 0;
}

static void test_judging_ends_when_it_is_told_to(void **state)
{
    (void)state;
    int left = 3;
    struct recording *r;
    struct take_verdict verdict;
    const struct take_verdict_patience patience = {goes_on, &left};
    const char *path = sample_path("ended");
    sample_recording_write(path);
    EXPECT_STATUS(recording_open(&r, path), OK);
    EXPECT_STATUS(take_verdict_get(r, recording_take_name(r, 0), &patience, &verdict), NOTHING);
    EXPECT_INT(left, -1); // not asked again
    recording_free(&r);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_takes_are_judged_one_by_one),
        cmocka_unit_test(test_judging_ends_when_it_is_told_to),
    };
    return cmocka_run_group_tests(tests, sample_folder_make, sample_folder_remove);
}
