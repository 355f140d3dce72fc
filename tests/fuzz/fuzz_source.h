// For fuzz targets whose input is a sensor's or a camera's.
#pragma once
#include "tests/fuzz/fuzz.h"

#include "platform/source.h"

#include <string.h>

// Reads up to 50 frames: times rise, names have no folder. has_depth: every frame has depth.
static inline void fuzz_read_frames(const char *uri, enum source_wanted wanted, bool has_depth)
{
    struct source *s;
    if (fuzz_said(source_open(&s, uri, wanted)) != OK)
        return;
    int64_t last_ns = INT64_MIN;
    for (int i = 0; i < 50; i++) {
        struct frame frame;
        const enum status status = fuzz_said(source_next(s, &frame));
        if (status == NOTHING)
            break;
        if (status != OK)
            continue;
        FUZZ_CHECK(frame.time_ns > last_ns && !strchr(frame.name, '/'));
        FUZZ_CHECK(!has_depth || frame.depth);
        last_ns = frame.time_ns;
    }
    source_close(&s);
}
