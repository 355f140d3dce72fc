// Any bytes as what Record3D's archive holds, read as a sensor: the metadata, a 0, and one depth image; beside them a
// colour image and confidences that are sound. And as the archive itself.
#include "platform/files/jpeg.h"
#include "tests/fuzz/fuzz_source.h"
#include "tests/support/zip_writer.h"

#include <stdio.h>

static void add_color(struct zip_writer *zip)
{
    static const uint8_t pixels[FUZZ_WIDTH * FUZZ_HEIGHT * 3];
    static uint8_t *jpeg;
    static size_t count;
    if (!jpeg)
        FUZZ_CHECK(jpeg_encode(pixels, FUZZ_WIDTH, FUZZ_HEIGHT, 90, &jpeg, &count) == OK);
    zip_writer_add(zip, "rgbd/0.jpg", jpeg, count, false);
    zip_writer_add(zip, "rgbd/1.jpg", jpeg, count, false);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static const uint8_t confidence[FUZZ_WIDTH * FUZZ_HEIGHT] = {1, 2, 0};
    char uri[160];
    struct zip_writer zip = {.count = 0};
    const uint8_t *end = size ? memchr(data, 0, size) : NULL;
    const size_t first = end ? (size_t)(end - data) : size;
    zip_writer_add(&zip, "metadata", data, first, false);
    zip_writer_add(&zip, "rgbd/0.depth", end ? end + 1 : data, end ? size - first - 1 : size, false);
    zip_writer_add(&zip, "rgbd/1.depth", data, first, false);
    zip_writer_add(&zip, "rgbd/0.conf", confidence, sizeof confidence, false);
    add_color(&zip);
    zip_writer_end(&zip);
    snprintf(uri, sizeof uri, "r3d:%s", fuzz_file("film.r3d", zip.bytes, zip.count));
    zip_writer_free(&zip);
    fuzz_read_frames(uri, SOURCE_SENSOR, true);
    snprintf(uri, sizeof uri, "r3d:%s", fuzz_file("film.r3d", data, size));
    fuzz_read_frames(uri, SOURCE_SENSOR, true);
    return 0;
}
