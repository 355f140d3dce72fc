// Any bytes as an Azure Kinect's recording (.mkv), read as a sensor. Without FFmpeg's libraries every file is refused.
#include "tests/fuzz/fuzz.h"

#include "platform/source.h"

#include <stdio.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    char uri[160];
    struct source *s;
    snprintf(uri, sizeof uri, "mkv:%s", fuzz_file("film.mkv", data, size));
    if (fuzz_said(source_open(&s, uri, SOURCE_SENSOR)) != OK)
        return 0;
    int64_t last_ns = INT64_MIN;
    for (int i = 0; i < 20; i++) {
        struct frame frame;
        const enum status status = fuzz_said(source_next(s, &frame));
        if (status == NOTHING)
            break;
        if (status != OK)
            continue;
        FUZZ_CHECK(frame.time_ns > last_ns && frame.depth);
        last_ns = frame.time_ns;
    }
    source_close(&s);
    return 0;
}
