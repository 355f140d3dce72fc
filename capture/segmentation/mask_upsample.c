// Upsamples the grid's mask to pixels: a pixel joins the person if its depth continues a neighbouring cell's.
#include "capture/segmentation/segment_internal.h"

#include <stdlib.h>
#include <string.h>

// Marks the pixels of cell (x, y) whose depth continues that of the person's cells around it, its own first.
static void upsample_cell(const struct segmenter *s, const uint16_t *image, int x, int y, uint8_t *mask)
{
    int neighbor_mm[9], count = 0, w = s->width, centre = y * w + x;
    if (s->person[centre])
        neighbor_mm[count++] = s->depth[centre];
    for (int j = -1; j <= 1; j++)
        for (int i = -1; i <= 1; i++)
            if ((i || j) && x + i >= 0 && x + i < w && y + j >= 0 && y + j < s->height && s->person[centre + j * w + i])
                neighbor_mm[count++] = s->depth[centre + j * w + i];
    if (!count || (!s->person[centre] && s->step == 1))
        return;
    for (int j = 0; j < s->step; j++)
        for (int i = 0; i < s->step; i++) {
            int px = x * s->step + i, py = y * s->step + j;
            if (px >= s->lens.width || py >= s->lens.height)
                continue;
            int d = image[py * s->lens.width + px];
            if (!d || (!s->person[centre] && !may_be_person(s, centre, d)))
                continue;
            int limit = by_depth(s->max_step_mm, d);
            for (int k = 0; k < count; k++)
                if (abs(neighbor_mm[k] - d) <= limit) {
                    mask[py * s->lens.width + px] = 255;
                    break;
                }
        }
}

void segmenter_upsample_mask(const struct segmenter *s, const uint16_t *image, uint8_t *mask)
{
    int w = s->width, left[3] = {w, w, w}, right[3] = {-1, -1, -1}; // of the person, in three neighbouring rows
    for (int y = -1; y < s->height; y++) {
        int next = (y + 2) % 3;
        left[next] = w;
        right[next] = -1;
        const uint8_t *row = s->person + (y + 1) * w, *first = y + 1 < s->height ? memchr(row, 1, (size_t)w) : NULL;
        if (first) {
            left[next] = (int)(first - row);
            for (right[next] = w - 1; !row[right[next]];)
                right[next]--;
        }
        int from = left[0] < left[1] ? left[0] : left[1], to = right[0] > right[1] ? right[0] : right[1];
        from = from < left[2] ? from : left[2];
        to = to > right[2] ? to : right[2];
        for (int x = from > 0 ? from - 1 : 0; y >= 0 && x <= to + 1 && x < w; x++)
            upsample_cell(s, image, x, y, mask);
    }
}
