// Any bytes as a JPEG.
#include "platform/files/jpeg.h"
#include "tests/fuzz/fuzz.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    int width, height;
    uint8_t *plain;
    size_t count;
    if (fuzz_said(jpeg_without_metadata(data, size, &plain, &count)) == OK)
        FUZZ_CHECK(count <= size);
    free(plain);
    if (fuzz_said(jpeg_size(data, size, &width, &height)) != OK || (int64_t)width * height > 1 << 20)
        return 0;
    uint8_t *rgb = malloc((size_t)width * (size_t)height * 3);
    FUZZ_CHECK(rgb);
    fuzz_said(jpeg_decode(data, size, rgb, width, height));
    free(rgb);
    return 0;
}
