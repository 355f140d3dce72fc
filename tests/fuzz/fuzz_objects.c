// Any bytes as an objects.json, beside a picture p.png.
#include "objects/thing.h"
#include "platform/files/png.h"
#include "tests/fuzz/fuzz.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static const uint8_t pixels[24 * 24 * 3];
    static bool made;
    struct thing_list things;
    if (!made)
        FUZZ_CHECK(png_write(fuzz_path("p.png"), PNG_RGB8, pixels, 24, 24) == OK);
    made = true;
    if (fuzz_said(thing_list_read(fuzz_file("objects.json", data, size), &things)) != OK)
        return 0;
    FUZZ_CHECK(things.count > 0 && things.count <= THINGS_MOST);
    for (int i = 0; i < things.count; i++)
        FUZZ_CHECK(things.things[i].name[0] && things.things[i].width_m > 0 && things.things[i].picture.rgb);
    thing_list_free(&things);
    return 0;
}
