// Any bytes as a rollback journal beside a file that was being changed.
#include "tests/fuzz/fuzz_beside.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static struct fuzz_bytes file;
    if (!file.at)
        file = fuzz_killed("PRAGMA cache_size = 2; BEGIN", "UPDATE t SET b = b || zeroblob(200)");
    fuzz_beside(&file, "-journal", data, size);
    return 0;
}
