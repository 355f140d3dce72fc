// Any bytes as a folder's lists: rgb.txt, a 0, depth.txt. Frames are read as a sensor's and as a camera's.
#include "tests/fuzz/fuzz_source.h"

#include "platform/png.h"

#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

static void make_pictures(void)
{
    static bool made;
    static const uint8_t pixels[8 * 6 * 3];
    static const char calibration[] =
        "{\"color\": {\"width\": 8, \"height\": 6, \"fx\": 7, \"fy\": 7, \"cx\": 3.5, \"cy\": 2.5},"
        "\"depth\": {\"width\": 8, \"height\": 6, \"fx\": 7, \"fy\": 7, \"cx\": 3.5, \"cy\": 2.5}, \"registered\": "
        "true}";
    if (made)
        return;
    made = true;
    mkdir(fuzz_path("folder"), 0777);
    fuzz_file("folder/calibration.json", (const uint8_t *)calibration, sizeof calibration - 1);
    FUZZ_CHECK(png_write(fuzz_path("folder/c.png"), PNG_RGB8, pixels, 8, 6) == OK);
    FUZZ_CHECK(png_write(fuzz_path("folder/d.png"), PNG_GRAY16, pixels, 8, 6) == OK);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    char uri[160];
    make_pictures();
    const uint8_t *end = size ? memchr(data, 0, size) : NULL;
    const size_t first = end ? (size_t)(end - data) : size;
    fuzz_file("folder/rgb.txt", data, first);
    fuzz_file("folder/depth.txt", end ? end + 1 : data, end ? size - first - 1 : size);
    snprintf(uri, sizeof uri, "folder:%s", fuzz_path("folder"));
    fuzz_read_frames(uri, SOURCE_SENSOR, false);
    fuzz_read_frames(uri, SOURCE_CAMERA, false);
    return 0;
}
