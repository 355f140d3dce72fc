// What decides about a recording's joints and images calls no function of the C library whose last bits depend on the
// processor (base/portable_math.h has our own). Read from the rooms' libraries. The rooms that localise are not among
// them: the libraries they use differ between processors anyway.
#include "tests/support/test.h"

#include <stdio.h>
#include <string.h>

static const char *const varying[] = {
    "acos", "acosh",  "asin",  "asinh",  "atan",  "atan2",  "atanh", "cbrt",  "cos",   "cosh",  "erf",
    "erfc", "exp",    "exp2",  "expm1",  "hypot", "lgamma", "log",   "log10", "log1p", "log2",  "pow",
    "sin",  "sincos", "sinh",  "tan",    "tanh",  "tgamma", "fma",   "acosf", "asinf", "atanf", "atan2f",
    "cosf", "expf",   "exp2f", "hypotf", "logf",  "log2f",  "powf",  "sinf",  "tanf",
};

static bool is_varying(const char *symbol)
{
    for (size_t i = 0; i < COUNT_OF(varying); i++)
        if (!strcmp(symbol, varying[i]))
            return true;
    return false;
}

// Undefined symbols of the libraries, LIBRARY[OBJECT]: SYMBOL U.
static int count_varying(const char *command, int *symbols)
{
    FILE *nm = popen(command, "r");
    assert_non_null(nm);
    char line[4096], object[256], name[256];
    int found = 0;
    *symbols = 0;
    while (fgets(line, sizeof line, nm)) {
        const char *inside = strchr(line, '[');
        if (!inside || sscanf(inside, "[%255[^]]]: %255s", object, name) != 2)
            continue;
        ++*symbols;
        if (is_varying(name)) {
            print_error("%s calls %s\n", object, name);
            found++;
        }
    }
    EXPECT_INT(pclose(nm), 0);
    return found;
}

static void test_only_portable_functions(void **state)
{
    (void)state;
    int symbols;
    EXPECT_INT(count_varying("nm -A -P -u " LIBRARIES " 2>/dev/null", &symbols), 0);
    EXPECT_AT_LEAST(symbols, 500);
}

// The check itself: this program's own object names one of them.
static void test_a_call_is_found(void **state)
{
    (void)state;
    int symbols;
    EXPECT_AT_LEAST(count_varying("echo 'lib.a[x.c.o]: atan2 U'", &symbols), 1);
    EXPECT_INT(count_varying("echo 'lib.a[x.c.o]: sqrt U'", &symbols), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_only_portable_functions),
        cmocka_unit_test(test_a_call_is_found),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
