// Text from outside: what is UTF-8, what a terminal can show, and times as text.
#include "tests/support/test.h"

#include "base/text.h"
#include "tests/support/random.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void test_times_are_readable(void **state)
{
    (void)state;
    char out[SECONDS_TEXT_BYTES];
    assert_string_equal(seconds_text(-1500000000, 9, out), "-1.500000000");
    assert_string_equal(seconds_text(-1, 9, out), "-0.000000001");
    assert_string_equal(seconds_text(INT64_MIN, 3, out), "-9223372036.854");
    assert_string_equal(seconds_text(2033333333, 6, out), "2.033333");
    assert_string_equal(seconds_text(7, 0, out), "0");
    char date[DATE_TEXT_BYTES];
    assert_string_equal(date_text(1772619330LL * 1000000000, date), "2026-03-04T10:15:30Z");
    assert_string_equal(date_text(946684799999999999, date), "");
    assert_string_equal(date_text(0, date), "");
    assert_string_equal(date_text(INT64_MIN, date), "");
    assert_string_equal(date_text(INT64_MAX, date), "");
}

static void test_text_is_typed(void **state)
{
    (void)state;
    char name[8] = "";
    text_remove_last(name);
    EXPECT_TRUE(!*name);
    EXPECT_TRUE(text_append(name, sizeof name, "Kü"));
    assert_string_equal(name, "Kü");
    EXPECT_TRUE(text_append(name, sizeof name,
                            "\x1b[\xff"
                            "2\n")); // what is printable of it
    assert_string_equal(name, "Kü[2");
    EXPECT_TRUE(!text_append(name, sizeof name, "日")); // three bytes, of which two would fit
    EXPECT_TRUE(text_append(name, sizeof name, "éa"));
    assert_string_equal(name, "Kü[2é");
    EXPECT_TRUE(!text_append(name, sizeof name, "a"));
    static const char *const left[] = {"Kü[2", "Kü[", "Kü", "K", "", ""};
    for (size_t i = 0; i < COUNT_OF(left); i++) {
        text_remove_last(name);
        assert_string_equal(name, left[i]);
    }
}

static void test_text_is_found(void **state)
{
    (void)state;
    static const struct {
        const char *text, *part;
        bool found;
    } of[] = {
        {"Foam Roller", "roll", true},
        {"x", "", true},
        {"", "", true},
        {"band", "bands", false},
        {"band", "and", true},
        {"aab", "ab", true}, // begun in vain before
        {"a", "b", false},   // the last of both
        {"", "a", false},
        {"Gymnastikbälle", "BÄLLE", true},
        {"Ξύλινο κοντάρι", "ΚΟΝΤΆΡΙ", true},
        {"Ведро", "вЕДР", true},
        {"跳び箱", "箱", true},
        {"跳び箱", "\xae\xb1", false}, // bytes within a character
        {"caf\xe9", "F\xe9", true},    // not UTF-8
        {"caf\xe9", "\xc9", false},
        {"caf\xe9", "é", false},
    };
    for (size_t i = 0; i < COUNT_OF(of); i++) {
        if (text_contains(of[i].text, of[i].part) != of[i].found)
            print_error("'%s' in '%s'\n", of[i].part, of[i].text);
        EXPECT_TRUE(text_contains(of[i].text, of[i].part) == of[i].found);
    }
}

static void test_characters(void **state)
{
    (void)state;
    static const struct {
        const char *text;
        size_t bytes;
    } of[] = {
        {"", 0},
        {"a", 1},
        {"\n", 1},
        {"\xc2\x80", 2},         // U+0080
        {"\xdf\xbf", 2},         // U+07FF
        {"\xe0\xa0\x80", 3},     // U+0800
        {"\xed\x9f\xbf", 3},     // U+D7FF
        {"\xef\xbf\xbf", 3},     // U+FFFF
        {"\xf0\x90\x80\x80", 4}, // U+10000
        {"\xf4\x8f\xbf\xbf", 4}, // U+10FFFF
        {"\xf4\x90\x80\x80", 0}, // beyond
        {"\xf0\x8f\xbf\xbf", 0}, // overlong
        {"\xe0\x9f\xbf", 0},     // overlong
        {"\xc1\xbf", 0},         // overlong
        {"\xed\xa0\x80", 0},     // a surrogate
        {"\x80", 0},             // no first byte
        {"\xff", 0},
        {"\xe2\x82", 0}, // cut
    };
    for (size_t i = 0; i < COUNT_OF(of); i++)
        EXPECT_INT(text_character_bytes(of[i].text), of[i].bytes);
    EXPECT_INT(text_length("höher 🕺 日本"), 10);
    char text[] = "caf\xe9 \xc3\xa9\x1b\n\xff";
    text_make_utf8(text);
    assert_string_equal(text, "caf? \xc3\xa9\x1b\n?");
}

static void test_names_are_shown(void **state)
{
    (void)state;
    char long_name[2 * TEXT_SHOWN_BYTES], out[TEXT_SHOWN_BYTES];
    memset(long_name, 'x', sizeof long_name);
    long_name[sizeof long_name - 1] = 0;
    EXPECT_INT(strlen(text_shown(long_name, out)), TEXT_SHOWN_BYTES - 1);
    assert_string_equal(text_shown("a\x1b[31m\xff.reenact", out), "a?[31m?.reenact");
}

// The bits of strtod, of short numbers and long ones; nothing that is no decimal number.
static void test_numbers(void **state)
{
    (void)state;
    static const char *const good[] = {"0",
                                       "-0",
                                       "12",
                                       "-12.5",
                                       ".5",
                                       "5.",
                                       "0.1",
                                       "1e3",
                                       "1E-3",
                                       "-1.5e+2",
                                       "0.0000001",
                                       "123456789012345",
                                       "1234567890.12345",
                                       "1234567890.123456",
                                       "0.30000000000000004",
                                       "1e400"};
    static const char *const none[] = {"",   "-",   ".",   "-.",  "+1",  " 1",    "1 ", "0x10",
                                       "1e", "1e+", "nan", "inf", "1,5", "1.2.3", "1a"};
    double value;
    for (size_t i = 0; i < COUNT_OF(good); i++) {
        EXPECT_TRUE(text_number(good[i], &value));
        const double wanted = strtod(good[i], NULL);
        assert_memory_equal(&value, &wanted, sizeof value);
    }
    for (size_t i = 0; i < COUNT_OF(none); i++)
        EXPECT_TRUE(!text_number(none[i], &value));
    static const char *const no_index[] = {"",    "-1",  "+1",  " 1",   "1 ",
                                           "0x1", "1.0", "1e1", "1000", "99999999999999999999"};
    int index = -1;
    for (size_t i = 0; i < COUNT_OF(no_index); i++)
        EXPECT_TRUE(!text_index(no_index[i], 999, &index));
    EXPECT_INT(index, -1);
    EXPECT_TRUE(text_index("0", 999, &index) && index == 0);
    EXPECT_TRUE(text_index("0999", 999, &index) && index == 999);
    struct rng rng = {17};
    for (int i = 0; i < 20000; i++) {
        char text[64];
        const int decimals = (int)(rng_uniform(&rng) * 10), size = (int)(rng_uniform(&rng) * 10);
        const double number = rng_between(&rng, -1, 1) * pow(10, size);
        snprintf(text, sizeof text, "%.*f", decimals, number);
        EXPECT_TRUE(text_number(text, &value));
        const double wanted = strtod(text, NULL);
        assert_memory_equal(&value, &wanted, sizeof value);
    }
}

static void test_printable_text(void **state)
{
    (void)state;
    // the joiners belong to Persian words and to families of emoji
    EXPECT_TRUE(text_is_printable("höher 🕺 日本 می\u200cخواهم 👨\u200d👩\u200d👧 שלום"));
    static const char *const bad[] = {"\x1b[31m",     "caf\xe9",  "\xc2\x9b\x33\x31m",
                                      "\xed\xa0\x80", "\xc0\xaf", "a\xf0\x9f\x95"};
    for (size_t i = 0; i < COUNT_OF(bad); i++) {
        char text[32];
        EXPECT_TRUE(!text_is_printable(bad[i]));
        snprintf(text, sizeof text, "%s", bad[i]);
        text_make_printable(text);
        EXPECT_TRUE(text_is_printable(text));
    }
}

// The first and the last of each range that Unicode's tables give as control characters, separators, or format
// characters that turn or hide text; and the neighbours of some, which are shown.
static void test_hidden_characters(void **state)
{
    (void)state;
    static const char *const bad[] = {
        "\x01",   "\x1f",       "\x7f",       "\xc2\x80",   "\xc2\x9f",   "\u00ad",     "\u061c",
        "\u180e", "\u200b",     "\u200e",     "\u200f",     "\u2028",     "\u2029",     "\u202a",
        "\u202e", "\u2060",     "\u2066",     "\u2069",     "\u206f",     "\ufeff",     "\ufff9",
        "\ufffb", "\U0001d173", "\U0001d17a", "\U000e0001", "\U000e007f", "\U000e0fff", "\U000e0020",
    };
    static const char *const good[] = {"\u00a0", "\u00ac", "\u00ae", "\u061b", "\u200c", "\u200d",    "\u2010",
                                       "\u2027", "\u202f", "\u2070", "\ufefe", "\ufffd", "\U000e1000"};
    char text[32], wanted[32];
    for (size_t i = 0; i < COUNT_OF(bad); i++) {
        snprintf(text, sizeof text, "a%sb%sc", bad[i], bad[i]);
        EXPECT_TRUE(!text_is_printable(text));
        text_make_printable(text);
        assert_string_equal(text, "a?b?c");
        char typed[8] = "x";
        EXPECT_TRUE(!text_append(typed, sizeof typed, bad[i]));
        assert_string_equal(typed, "x");
    }
    for (size_t i = 0; i < COUNT_OF(good); i++) {
        snprintf(wanted, sizeof wanted, "a%sb", good[i]);
        snprintf(text, sizeof text, "%s", wanted);
        EXPECT_TRUE(text_is_printable(text));
        text_make_printable(text);
        assert_string_equal(text, wanted);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_times_are_readable),
        cmocka_unit_test(test_text_is_typed),
        cmocka_unit_test(test_text_is_found),
        cmocka_unit_test(test_characters),
        cmocka_unit_test(test_numbers),
        cmocka_unit_test(test_printable_text),
        cmocka_unit_test(test_hidden_characters),
        cmocka_unit_test(test_names_are_shown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
