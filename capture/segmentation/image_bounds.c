#include "capture/segmentation/image_bounds.h"

// Depth samples along a row or column, of every fourth pixel.
static int count_depth_samples(const uint16_t *depth, const struct lens *l, bool row, int at)
{
    int count = 0;
    for (int k = 0; k < (row ? l->width : l->height); k += 4)
        count += depth[row ? at * l->width + k : k * l->width + at] != 0;
    return count;
}

struct image_bounds find_image_bounds(const uint16_t *depth, const struct lens *l)
{
    struct image_bounds all = {0, 0, l->width - 1, l->height - 1}, b = all;
    int valid = 0, total = 0;
    for (int y = 0; y < l->height; y += 4) {
        valid += count_depth_samples(depth, l, true, y);
        total += (l->width + 3) / 4;
    }
    if (2 * valid < total) // the room itself is missing: there is no rim to find
        return all;
    // A row or column of the rim has depth at less than an eighth of its pixels; every fourth was counted.
    int few_across = l->width / 32, few_down = l->height / 32;
    while (b.top < l->height / 4 && count_depth_samples(depth, l, true, b.top) <= few_across)
        b.top++;
    while (b.bottom > l->height * 3 / 4 && count_depth_samples(depth, l, true, b.bottom) <= few_across)
        b.bottom--;
    while (b.left < l->width / 4 && count_depth_samples(depth, l, false, b.left) <= few_down)
        b.left++;
    while (b.right > l->width * 3 / 4 && count_depth_samples(depth, l, false, b.right) <= few_down)
        b.right--;
    return b;
}
