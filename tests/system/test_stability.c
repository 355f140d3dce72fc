// The hard cases: all answers are right, none is wrong in silence, each is judged wrong without its guard, and all are
// the stored ones, whatever the compiler, its options and the processor.
#include "tests/support/test.h"

#include "tests/stability/stability.h"

#include <stdio.h>

enum { LEAST_CASES = 120, LINE_BYTES = 512 };

static void describe(const char *fault, const struct stability_result *r)
{
    char shipped[256], unguarded[256], reference[256];
    const struct answer exact = answer_values(r->reference, r->shipped.count > 0 ? r->shipped.count : 1);
    stability_print_answer(shipped, sizeof shipped, &r->shipped, 17);
    stability_print_answer(unguarded, sizeof unguarded, &r->unguarded, 17);
    stability_print_answer(reference, sizeof reference, &exact, 17);
    print_error("%s: %s, %s: answers %s, wanted %s %s within %g; without its guard %s\n", fault, r->stage->name,
                r->of->asked, shipped, answer_kind_names[r->of->expected],
                r->of->expected == ANSWER_VALUE ? reference : "", r->of->tolerance, unguarded);
}

static void test_every_answer_is_right_and_guarded(void **state)
{
    (void)state;
    int wrong = 0, unguarded = 0;
    EXPECT_AT_LEAST(stability_case_count(), LEAST_CASES);
    for (int i = 0; i < stability_case_count(); i++) {
        const struct stability_result r = stability_run(i);
        if (!r.right)
            describe(r.silent ? "wrong in silence" : "wrong", &r);
        if (!r.guard_seen)
            describe("right without its guard", &r);
        wrong += !r.right;
        unguarded += !r.guard_seen;
    }
    print_message("%d cases\n", stability_case_count());
    EXPECT_INT(wrong, 0);
    EXPECT_INT(unguarded, 0);
}

// Two cases that are asked alike could hide one another in the stored answers.
static void test_answers_are_the_stored_ones(void **state)
{
    (void)state;
    static char stored[LINE_BYTES], now[LINE_BYTES];
    int different = 0, lines = 0;
    FILE *file = fopen(SOURCE_DIR "/tests/stability/answers.txt", "r");
    assert_non_null(file);
    for (int i = 0; i < stability_case_count(); i++) {
        const struct stability_result r = stability_run(i);
        stability_print_stored(now, sizeof now, &r);
        if (!fgets(stored, sizeof stored, file))
            stored[0] = 0;
        stored[strcspn(stored, "\n")] = 0;
        lines += stored[0] != 0;
        if (strcmp(stored, now)) {
            print_error("stored: %s\nnow:    %s\n", stored, now);
            different++;
        }
    }
    EXPECT_TRUE(!fgets(stored, sizeof stored, file));
    fclose(file);
    EXPECT_INT(lines, stability_case_count());
    EXPECT_INT(different, 0); // reenact-bench stability --answers tests/stability/answers.txt stores them again
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_every_answer_is_right_and_guarded),
                                       cmocka_unit_test(test_answers_are_the_stored_ones)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
