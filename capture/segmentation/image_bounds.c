#include "capture/segmentation/image_bounds.h"

// Depth samples along a row or column, of every fourth pixel.
static int count_depth_samples(const uint16_t *depth, const struct lens *lens, bool row, int at)
{
    int count = 0;
    for (int k = 0; k < (row ? lens->width : lens->height); k += 4)
        count += depth[row ? at * lens->width + k : k * lens->width + at] != 0;
    return count;
}

struct image_bounds find_image_bounds(const uint16_t *depth, const struct lens *lens)
{
    struct image_bounds all = {0, 0, lens->width - 1, lens->height - 1}, b = all;
    int valid = 0, total = 0;
    for (int y = 0; y < lens->height; y += 4) {
        valid += count_depth_samples(depth, lens, true, y);
        total += (lens->width + 3) / 4;
    }
    if (2 * valid < total) // the room itself is missing: there is no rim to find
        return all;
    // A row or column of the rim has depth at less than an eighth of its pixels; every fourth was counted.
    int few_across = lens->width / 32, few_down = lens->height / 32;
    while (b.top < lens->height / 4 && count_depth_samples(depth, lens, true, b.top) <= few_across)
        b.top++;
    while (b.bottom > lens->height * 3 / 4 && count_depth_samples(depth, lens, true, b.bottom) <= few_across)
        b.bottom--;
    while (b.left < lens->width / 4 && count_depth_samples(depth, lens, false, b.left) <= few_down)
        b.left++;
    while (b.right > lens->width * 3 / 4 && count_depth_samples(depth, lens, false, b.right) <= few_down)
        b.right--;
    return b;
}
