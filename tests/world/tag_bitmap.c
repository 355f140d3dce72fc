#include "tests/world/tag_bitmap.h"

#include <apriltag/apriltag.h>
#include <apriltag/tag36h11.h>

enum status tag_bitmap(int id, bool white[TAG_CELLS][TAG_CELLS])
{
    apriltag_family_t *family = tag36h11_create();
    if (!family)
        return fail(ERR_MEMORY, "out of memory for the tags");
    enum status status = OK;
    if (id < 0 || id >= (int)family->ncodes) {
        status = fail(ERR_INPUT, "tag36h11 has no number %d", id);
    } else {
        int margin = (family->total_width - family->width_at_border) / 2;
        assert(family->total_width == TAG_CELLS && margin == 1);
        for (int y = 0; y < TAG_CELLS; y++)
            for (int x = 0; x < TAG_CELLS; x++)
                white[y][x] = x < margin || y < margin || x >= TAG_CELLS - margin || y >= TAG_CELLS - margin;
        for (uint32_t i = 0; i < family->nbits; i++) // bits count from the black square's upper left
            white[(int)family->bit_y[i] + margin][(int)family->bit_x[i] + margin] =
                family->codes[id] >> (family->nbits - 1 - i) & 1;
    }
    tag36h11_destroy(family);
    return status;
}
