// Any bytes as the pictures of a folder's frame: the length of colour's (2 bytes, the low one first), colour, depth.
// Every pixel that a frame is said to have is read.
#include "tests/fuzz/fuzz_source.h"

#include <stdio.h>
#include <string.h>

// *at: moved behind the block.
static void write_block(const char *name, const uint8_t **at, size_t size)
{
    fuzz_file(name, *at, size);
    *at += size;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static const uint8_t colors[] = "1 c", depths[] = "1 d";
    struct source *s;
    struct frame frame;
    char uri[160];
    if (size < 2)
        return 0;
    const size_t said = data[0] | (size_t)data[1] << 8, color = said < size - 2 ? said : size - 2;
    const uint8_t *at = data + 2;
    fuzz_make_folder();
    write_block("folder/c", &at, color);
    write_block("folder/d", &at, size - 2 - color);
    fuzz_file("folder/rgb.txt", colors, sizeof colors - 1);
    fuzz_file("folder/depth.txt", depths, sizeof depths - 1);
    snprintf(uri, sizeof uri, "folder:%s", fuzz_path("folder"));
    if (fuzz_said(source_open(&s, uri, SOURCE_SENSOR)) != OK)
        return 0;
    if (fuzz_said(source_next(s, &frame)) == OK) {
        static uint8_t color_copy[FUZZ_WIDTH * FUZZ_HEIGHT * 3];
        static uint16_t depth_copy[FUZZ_WIDTH * FUZZ_HEIGHT];
        FUZZ_CHECK(frame.depth);
        memcpy(depth_copy, frame.depth, sizeof depth_copy);
        if (frame.color)
            memcpy(color_copy, frame.color, sizeof color_copy);
        if (frame.jpeg)
            FUZZ_CHECK(frame.jpeg_bytes > 0 && frame.jpeg_bytes <= size);
    }
    source_close(&s);
    return 0;
}
