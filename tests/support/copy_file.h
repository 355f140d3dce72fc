// Replaces one file by a copy of another.
#pragma once
#include "tests/support/test.h"

#include "platform/files/file.h"

#include <unistd.h>

static inline void copy_file(const char *from, const char *to)
{
    uint8_t *bytes;
    size_t count;
    EXPECT_STATUS(file_read(from, &bytes, &count), OK);
    unlink(to);
    EXPECT_STATUS(file_write(to, bytes, count), OK);
    free(bytes);
}
