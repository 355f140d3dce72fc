// Any bytes as the code of a depth image. What decodes is encoded again and gives the same image.
#include "recording/depth_codec.h"
#include "tests/fuzz/fuzz.h"

#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    enum { SIDE_MAX = 64 };
    static uint16_t depth[SIDE_MAX * SIDE_MAX], again[SIDE_MAX * SIDE_MAX];
    struct depth_coder *coder;
    if (size < 5)
        return 0;
    const int width = 1 + (data[1] | data[2] << 8) % SIDE_MAX, height = 1 + (data[3] | data[4] << 8) % SIDE_MAX;
    FUZZ_CHECK(depth_coder_open(&coder) == OK);
    uint8_t *code = malloc(size);
    FUZZ_CHECK(code);
    memcpy(code, data, size);
    code[1] = (uint8_t)width, code[2] = 0, code[3] = (uint8_t)height, code[4] = 0; // a size that the reader expects
    if (fuzz_said(depth_decode(coder, code, size, depth, width, height)) == OK) {
        const uint8_t *bytes;
        size_t count;
        FUZZ_CHECK(depth_encode(coder, depth, width, height, &bytes, &count) == OK);
        FUZZ_CHECK(depth_decode(coder, bytes, count, again, width, height) == OK);
        FUZZ_CHECK(!memcmp(depth, again, sizeof *depth * (size_t)width * (size_t)height));
    }
    free(code);
    depth_coder_close(&coder);
    return 0;
}
