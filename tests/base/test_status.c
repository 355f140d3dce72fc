// A status and its sentence: fail(), and struct failure, which carries both over other failures.
#include "tests/support/test.h"

static void test_sentence_may_contain_the_last_one(void **state)
{
    (void)state;
    EXPECT_STATUS(fail(ERR_IO, "disk %d is full", 3), ERR_IO);
    EXPECT_STATUS(fail(ERR_INPUT, "saving: %s", status_message()), ERR_INPUT);
    assert_string_equal(status_message(), "saving: disk 3 is full");
}

static void test_failure_survives_other_failures(void **state)
{
    (void)state;
    struct failure first, none;
    failure_keep(&first, fail(ERR_CORRUPT, "the first"));
    failure_keep(&none, OK);
    EXPECT_STATUS(fail(ERR_IO, "a clean-up"), ERR_IO);
    EXPECT_STATUS(failure_restore(&none), OK);
    assert_string_equal(status_message(), "a clean-up");
    EXPECT_STATUS(failure_restore(&first), ERR_CORRUPT);
    assert_string_equal(status_message(), "the first");
    EXPECT_STATUS(failure_restore(&(struct failure){0}), OK);
}

static void test_longest_sentence_is_kept_whole(void **state)
{
    (void)state;
    char text[512];
    memset(text, 'x', sizeof text);
    text[sizeof text - 1] = 0;
    struct failure kept;
    failure_keep(&kept, fail(ERR_INPUT, "%s", text));
    EXPECT_STATUS(fail(ERR_IO, "short"), ERR_IO);
    EXPECT_STATUS(failure_restore(&kept), ERR_INPUT);
    assert_string_equal(status_message(), text);
}

static void test_no_sentence_holds_a_password(void **state)
{
    (void)state;
    static const struct {
        const char *given, *said;
    } cases[] = {{"'http://me:secret@host:80/a@b' is no sensor", "'http://host:80/a@b' is no sensor"},
                 {"https://me@host, ros:http://u:p@q@h/ and ://x", "https://host, ros:http://h/ and ://x"},
                 {"a@b and http://host/me@there", "a@b and http://host/me@there"},
                 {"ftp://u:p@", "ftp://"}};
    for (size_t i = 0; i < COUNT_OF(cases); i++) {
        EXPECT_STATUS(fail(ERR_INPUT, "%s", cases[i].given), ERR_INPUT);
        assert_string_equal(status_message(), cases[i].said);
    }
    char text[800] = "http://me:"; // the @ lies beyond what is kept
    memset(text + 10, 's', 600);
    strcpy(text + 610, "@host/ is not there");
    EXPECT_STATUS(fail(ERR_INPUT, "%s", text), ERR_INPUT);
    assert_string_equal(status_message(), "http://host/ is not there");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_sentence_may_contain_the_last_one),
        cmocka_unit_test(test_failure_survives_other_failures),
        cmocka_unit_test(test_longest_sentence_is_kept_whole),
        cmocka_unit_test(test_no_sentence_holds_a_password),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
