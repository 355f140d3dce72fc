// Any bytes as LZFSE data: what is unpacked is of the size that was asked for, or refused.
#include "platform/files/lzfse.h"
#include "tests/fuzz/fuzz.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    const size_t first = lzfse_first_size(data, size);
    const size_t sizes[] = {0, 1, 1000, 65536, first < 1 << 20 ? first : 7};
    for (size_t i = 0; i < COUNT_OF(sizes); i++) {
        uint8_t *out = malloc(sizes[i] + 1);
        FUZZ_CHECK(out != NULL);
        fuzz_said(lzfse_decode(data, size, out, sizes[i]));
        free(out);
    }
    return 0;
}
