#include "objects/texture_pyramid.h"

#include <stdlib.h>

enum status texture_pyramid(struct texture_level *level, int levels)
{
    for (int l = 1; l < levels; l++) {
        const struct texture_level *from = &level[l - 1];
        struct texture_level *to = &level[l];
        *to = (struct texture_level){(from->width + 1) / 2, (from->height + 1) / 2, NULL};
        to->rgb = malloc((size_t)to->width * (size_t)to->height * 3 * sizeof *to->rgb);
        if (!to->rgb)
            return fail(ERR_MEMORY, "no memory for an image pyramid");
        for (int y = 0; y < to->height; y++) {
            const float *a = from->rgb + (size_t)(2 * y) * (size_t)from->width * 3;
            const float *b = 2 * y + 1 < from->height ? a + from->width * 3 : a;
            float *out = to->rgb + (size_t)y * (size_t)to->width * 3;
            for (int x = 0; x < to->width; x++)
                for (int c = 0; c < 3; c++) {
                    const int i = 6 * x + c, k = 2 * x + 1 < from->width ? i + 3 : i;
                    out[3 * x + c] = 0.25F * ((a[i] + a[k]) + (b[i] + b[k]));
                }
        }
    }
    return OK;
}
