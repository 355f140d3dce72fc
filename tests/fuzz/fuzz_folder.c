// Any bytes as a folder's lists: rgb.txt, a 0, depth.txt. Frames are read as a sensor's and as a camera's.
#include "platform/files/png.h"
#include "tests/fuzz/fuzz_source.h"

#include <stdio.h>
#include <string.h>

static void make_pictures(void)
{
    static bool made;
    static const uint8_t pixels[FUZZ_WIDTH * FUZZ_HEIGHT * 3];
    if (made)
        return;
    made = true;
    fuzz_make_folder();
    FUZZ_CHECK(png_write(fuzz_path("folder/c.png"), PNG_RGB8, pixels, FUZZ_WIDTH, FUZZ_HEIGHT) == OK);
    FUZZ_CHECK(png_write(fuzz_path("folder/d.png"), PNG_GRAY16, pixels, FUZZ_WIDTH, FUZZ_HEIGHT) == OK);
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
