// Any bytes as an Azure Kinect's recording (.mkv), read as a sensor. Without FFmpeg's libraries every file is refused.
#include "tests/fuzz/fuzz_source.h"

#include <stdio.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    char uri[160];
    snprintf(uri, sizeof uri, "mkv:%s", fuzz_file("film.mkv", data, size));
    fuzz_read_frames(uri, SOURCE_SENSOR, true);
    return 0;
}
