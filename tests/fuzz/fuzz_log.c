// Any bytes as a write-ahead log beside a file that was being written to.
#include "tests/fuzz/fuzz_beside.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static struct fuzz_bytes file;
    if (!file.at)
        file = fuzz_killed("PRAGMA journal_mode = WAL; PRAGMA wal_autocheckpoint = 0",
                           "BEGIN IMMEDIATE; PRAGMA user_version = 3; DELETE FROM t WHERE id % 3 = 0; COMMIT;"
                           "INSERT INTO t(b) VALUES(zeroblob(1500)); UPDATE t SET b = zeroblob(90) WHERE id < 9");
    fuzz_beside(&file, "-wal", data, size);
    return 0;
}
