// Cache-aligned memory: its alignment, and that all of it can be written, below, at and above a huge page.
#include "tests/support/test.h"

#include "base/memory.h"

#include <stdlib.h>
#include <string.h>

static void test_cache_aligned_and_complete(void **state)
{
    (void)state;
    const size_t page = 2 << 20,
                 sizes[] = {0, 1, CACHE_LINE_BYTES, CACHE_LINE_BYTES + 1, page - 1, page, page + 1, 3 * page};
    for (size_t i = 0; i < COUNT_OF(sizes); i++) {
        unsigned char *memory = alloc_cache_aligned(sizes[i]);
        EXPECT_TRUE(memory);
        EXPECT_INT((uintptr_t)memory % (sizes[i] < page ? CACHE_LINE_BYTES : page), 0);
        memset(memory, 1, sizes[i]); // the sanitizers check it
        free(memory);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_cache_aligned_and_complete),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
