// For fuzz targets whose input is a sensor's or a camera's.
#pragma once
#include "platform/sensors/source.h"
#include "tests/fuzz/fuzz.h"

#include <string.h>
#include <sys/stat.h>

enum { FUZZ_WIDTH = 8, FUZZ_HEIGHT = 6 };

// The folder "folder" with a calibration of that size, for colour and depth. Once in a process.
static inline void fuzz_make_folder(void)
{
    static const char calibration[] =
        "{\"color\": {\"width\": 8, \"height\": 6, \"fx\": 7, \"fy\": 7, \"cx\": 3.5, \"cy\": 2.5},"
        "\"depth\": {\"width\": 8, \"height\": 6, \"fx\": 7, \"fy\": 7, \"cx\": 3.5, \"cy\": 2.5}, \"registered\": "
        "true}";
    mkdir(fuzz_path("folder"), 0777);
    fuzz_file("folder/calibration.json", (const uint8_t *)calibration, sizeof calibration - 1);
}

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
