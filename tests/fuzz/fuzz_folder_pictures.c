// Any bytes as the pictures of a folder's frame: the length of colour's (2 bytes, the low one first), colour, depth.
// Every pixel that a frame is said to have is read.
#include "tests/fuzz/fuzz_source.h"

#include <stdio.h>

static void make_lists(void)
{
    static bool made;
    static const uint8_t colors[] = "1 c", depths[] = "1 d";
    if (made)
        return;
    made = true;
    fuzz_make_folder();
    fuzz_file("folder/rgb.txt", colors, sizeof colors - 1);
    fuzz_file("folder/depth.txt", depths, sizeof depths - 1);
}

static void read_all(const void *bytes, size_t count)
{
    static volatile uint8_t last; // so that no read is left out
    for (size_t i = 0; i < count; i++)
        last = ((const uint8_t *)bytes)[i];
    (void)last;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct source *s;
    struct frame frame;
    char uri[160];
    if (size < 2)
        return 0;
    const size_t said = data[0] | (size_t)data[1] << 8, color = said < size - 2 ? said : size - 2;
    make_lists();
    fuzz_file("folder/c", data + 2, color);
    fuzz_file("folder/d", data + 2 + color, size - 2 - color);
    snprintf(uri, sizeof uri, "folder:%s", fuzz_path("folder"));
    if (fuzz_said(source_open(&s, uri, SOURCE_SENSOR)) != OK)
        return 0;
    if (fuzz_said(source_next(s, &frame)) == OK) {
        enum { PIXELS = FUZZ_WIDTH * FUZZ_HEIGHT };
        FUZZ_CHECK(frame.depth);
        read_all(frame.depth, PIXELS * sizeof *frame.depth);
        if (frame.color)
            read_all(frame.color, 3 * PIXELS);
        if (frame.jpeg)
            FUZZ_CHECK(frame.jpeg_bytes > 0 && frame.jpeg_bytes <= size);
    }
    source_close(&s);
    return 0;
}
