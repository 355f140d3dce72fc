// Text files as editors of all systems leave them.
#include "tests/support/test.h"

#include "platform/files/file.h"
#include "platform/files/text_file.h"
#include "tests/support/scratch.h"

#include <string.h>

static struct scratch scratch;

static enum status open_text(struct text_file *t, const char *text)
{
    scratch_text(&scratch, "list.txt", text);
    return text_file_open(t, scratch_file(&scratch, "list.txt"));
}

static void expect_line(struct text_file *t, int number, const char *wanted)
{
    const char *line = text_file_line(t);
    assert_non_null(line);
    assert_string_equal(line, wanted);
    EXPECT_INT(t->line, number);
}

static void expect_end(struct text_file *t)
{
    EXPECT_TRUE(!text_file_line(t));
    EXPECT_TRUE(!text_file_line(t));
    text_file_close(t);
}

static void test_lines(void **state)
{
    (void)state;
    struct text_file t;
    EXPECT_STATUS(open_text(&t, "# seconds file\n1 a\n\n  \t\n \t2 b c \t\n  # 3 c\n4 d #e"), OK);
    EXPECT_INT(text_file_lines_left(&t), 7);
    expect_line(&t, 2, "1 a");
    EXPECT_INT(text_file_lines_left(&t), 5);
    expect_line(&t, 5, "2 b c");
    expect_line(&t, 7, "4 d #e");
    expect_end(&t);
}

static void test_what_other_systems_write(void **state)
{
    (void)state;
    struct text_file t;
    EXPECT_STATUS(open_text(&t, "\xef\xbb\xbf"
                                "1 a\r\n\r\n2 b\r\n"),
                  OK);
    expect_line(&t, 1, "1 a");
    expect_line(&t, 3, "2 b");
    expect_end(&t);
    EXPECT_STATUS(open_text(&t, "\xef\xbb\xbf# only a comment"), OK);
    expect_end(&t);
    EXPECT_STATUS(open_text(&t, "# comment\r1 a\r\r2 b\r"), OK);
    expect_line(&t, 2, "1 a");
    expect_line(&t, 4, "2 b");
    expect_end(&t);
}

static void test_nothing_to_read(void **state)
{
    (void)state;
    static const char *const texts[] = {"", "\n", "\r\n \n", "\xef\xbb\xbf", "#", "\xef\xbb", "\xef"};
    for (size_t i = 0; i < 5; i++) {
        struct text_file t;
        EXPECT_STATUS(open_text(&t, texts[i]), OK);
        expect_end(&t);
    }
    for (size_t i = 5; i < COUNT_OF(texts); i++) { // a cut mark is a line like any other
        struct text_file t;
        EXPECT_STATUS(open_text(&t, texts[i]), OK);
        expect_line(&t, 1, texts[i]);
        expect_end(&t);
    }
}

static void test_what_is_no_text(void **state)
{
    (void)state;
    struct text_file t;
    EXPECT_STATUS(file_write(scratch_file(&scratch, "u16.txt"),
                             "\xff\xfe"
                             "1\0 \0a\0",
                             8),
                  OK);
    EXPECT_STATUS(text_file_open(&t, scratch_file(&scratch, "u16.txt")), ERR_INPUT);
    EXPECT_SAYS("u16.txt is not a text file");
    EXPECT_STATUS(text_file_open(&t, scratch_file(&scratch, "none.txt")), ERR_MISSING);
    EXPECT_STATUS(text_file_open(&t, scratch.path), ERR_INPUT);
    EXPECT_TRUE(!t.text);
}

static int make(void **state)
{
    (void)state;
    scratch = scratch_make();
    return 0;
}

static int tidy(void **state)
{
    (void)state;
    scratch_remove(&scratch);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_lines),
        cmocka_unit_test(test_what_other_systems_write),
        cmocka_unit_test(test_nothing_to_read),
        cmocka_unit_test(test_what_is_no_text),
    };
    return cmocka_run_group_tests(tests, make, tidy);
}
