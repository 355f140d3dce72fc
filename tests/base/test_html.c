// Text from outside in an HTML page, and bytes as base64: the vectors of RFC 4648, section 10.
#include "tests/support/test.h"

#include "base/text.h"

#include <stdlib.h>
#include <string.h>

static void expect_written(void (*put)(FILE *, const char *), const char *given, const char *wanted)
{
    char *text;
    size_t count;
    FILE *to = open_memstream(&text, &count);
    put(to, given);
    EXPECT_INT(fclose(to), 0);
    if (strcmp(text, wanted))
        print_error("'%s' instead of '%s'\n", text, wanted);
    EXPECT_TRUE(!strcmp(text, wanted));
    free(text);
}

static void put_bytes(FILE *to, const char *text) { html_put_base64(to, (const uint8_t *)text, strlen(text)); }

static void test_text(void **state)
{
    (void)state;
    expect_written(html_put_text, "", "");
    expect_written(html_put_text, "a <b> & \"c\" 'd' é", "a &lt;b&gt; &amp; &quot;c&quot; 'd' é");
    expect_written(html_put_text, "caf\xe9 <\xff>", "caf? &lt;?&gt;");
}

static void test_base64(void **state)
{
    (void)state;
    static const char *const vectors[][2] = {{"", ""},
                                             {"f", "Zg=="},
                                             {"fo", "Zm8="},
                                             {"foo", "Zm9v"},
                                             {"foob", "Zm9vYg=="},
                                             {"fooba", "Zm9vYmE="},
                                             {"foobar", "Zm9vYmFy"},
                                             {"\xfb\xff\xfe", "+//+"}};
    for (size_t i = 0; i < COUNT_OF(vectors); i++)
        expect_written(put_bytes, vectors[i][0], vectors[i][1]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_text), cmocka_unit_test(test_base64)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
