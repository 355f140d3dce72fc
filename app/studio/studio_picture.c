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

struct ui_box studio_picture_draw(const struct brush *brush, const struct gpu_texture *image, const struct lens *lens,
                                  struct ui_box box, bool mirrored)
{
    if (!image || lens->width <= 0) {
        ui_fill(brush->ui, box, ROUND, brush->theme->surface);
        return box;
    }
    const double aspect = (double)lens->width / lens->height;
    const double w = fmin(box.w, box.h * aspect), h = w / aspect;
    const struct ui_box at = {box.x + (box.w - w) / 2, box.y, w, h};
    const struct ui_uv_rect as_mirror = {1, 0, 0, 1}, as_is = {0, 0, 1, 1};
    ui_image(brush->ui, image, at, mirrored ? as_mirror : as_is, ROUND * 0.6, 0xffffffff);
    return at;
}

void studio_hint_draw(const struct brush *brush, enum icon icon, bool warns, const char *text, struct ui_box picture)
{
    static const double LEAST = 68, EDGE = 12, ICON_W = 36;
    const double text_w = picture.w - 32 - 2 * EDGE - ICON_W - GAP;
    enum face face = FACE_HEAD; // the largest in which it is not too high
    while (face > FACE_TINY && ui_text_height(brush->ui, (int)face, text, text_w) > fmax(LEAST - EDGE, 0.3 * picture.h))
        face--;
    const double text_h = ui_text_height(brush->ui, (int)face, text, text_w), h = fmax(LEAST, text_h + EDGE);
    const struct ui_box box = {picture.x + 16, picture.y + picture.h - 16 - h, picture.w - 32, h};
    ui_fill(brush->ui, box, ROUND, brush->theme->glass);
    ui_border(brush->ui, box, ROUND, 2, warns ? brush->theme->warn : brush->theme->hairline);
    struct ui_box line = inner(box, EDGE);
    icon_draw(brush->ui, icon, middle(cut_left(&line, ICON_W)), 30, warns ? brush->theme->warn : brush->theme->accent);
    ui_text_lines(brush->ui, (int)face, (struct ui_point){line.x, box.y + (h - text_h) / 2}, text_w, brush->theme->text,
                  text);
}
