// Any bytes as a PNG of each kind.
#include "base/pixels.h"
#include "platform/files/png.h"
#include "tests/fuzz/fuzz.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    enum { PIXELS_MAX = 1 << 20 }; // larger ones take long and show nothing new
    int width, height;
    if (png_size(data, size, "input", &width, &height) == OK && image_size_is_usable(width, height) &&
        (int64_t)width * height > PIXELS_MAX)
        return 0;
    static const enum png_kind kinds[] = {PNG_GRAY8, PNG_GRAY16, PNG_RGB8, PNG_RGBA8};
    for (size_t i = 0; i < COUNT_OF(kinds); i++) {
        struct png_layout layout = {.kind = kinds[i]};
        void *pixels = NULL;
        if (fuzz_said(png_decode(data, size, "input", &layout, &pixels)) == OK)
            FUZZ_CHECK(layout.width == width && layout.height == height);
        free(pixels);
    }
    return 0;
}
