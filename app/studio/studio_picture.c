#include "app/studio/studio_picture.h"

#include <math.h>

void studio_depth_colors(const uint16_t *depth, int width, int height, uint8_t *out)
{
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++) {
            const int mm = depth[y * width + x];
            uint8_t *rgb = out + 3 * (y * width + x);
            if (!mm) { // no reading: hatched, so that it is not taken for near or far
                const uint8_t grey = (x + y) / 4 % 3 ? 22 : 70;
                rgb[0] = rgb[1] = rgb[2] = grey;
                continue;
            }
            const double near = fmin(fmax((5000 - mm) / 4400.0, 0), 1); // 0.6 m to 5 m
            rgb[0] = (uint8_t)(40 + 205 * near);
            rgb[1] = (uint8_t)(70 + 120 * (1 - fabs(2 * near - 1)));
            rgb[2] = (uint8_t)(215 - 180 * near);
        }
}

struct ui_box studio_picture_draw(const struct brush *b, const struct gpu_texture *image, const struct lens *lens,
                                  struct ui_box box, bool mirrored)
{
    ui_fill(b->ui, box, ROUND, 0x000000ff);
    if (!image || lens->width <= 0)
        return box;
    const double aspect = (double)lens->width / lens->height;
    const double w = fmin(box.w, box.h * aspect), h = w / aspect;
    const struct ui_box at = {box.x + (box.w - w) / 2, box.y + (box.h - h) / 2, w, h};
    const struct ui_uv_rect as_mirror = {1, 0, 0, 1}, as_is = {0, 0, 1, 1};
    ui_image(b->ui, image, at, mirrored ? as_mirror : as_is, ROUND * 0.6, 0xffffffff);
    return at;
}
