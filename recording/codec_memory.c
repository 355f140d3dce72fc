// Scratch memory of the depth and mask codecs (depth_codec.c), whose parts all grow it.
#include "recording/depth_pixels.h"

#include <stdlib.h>

enum status depth_coder_grow(uint8_t **bytes, size_t *capacity, size_t wanted)
{
    if (wanted <= *capacity)
        return OK;
    uint8_t *grown = realloc(*bytes, wanted);
    if (!grown)
        return fail(ERR_MEMORY, "no memory for %zu bytes of an image", wanted);
    *bytes = grown;
    *capacity = wanted;
    return OK;
}
