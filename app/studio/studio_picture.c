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
    if (!image || lens->width <= 0) {
        ui_fill(b->ui, box, ROUND, b->theme->surface);
        return box;
    }
    const double aspect = (double)lens->width / lens->height;
    const double w = fmin(box.w, box.h * aspect), h = w / aspect;
    const struct ui_box at = {box.x + (box.w - w) / 2, box.y, w, h};
    const struct ui_uv_rect as_mirror = {1, 0, 0, 1}, as_is = {0, 0, 1, 1};
    ui_image(b->ui, image, at, mirrored ? as_mirror : as_is, ROUND * 0.6, 0xffffffff);
    return at;
}

void studio_hint_draw(const struct brush *b, enum icon icon, bool warns, const char *text, struct ui_box picture)
{
    const struct ui_box box = {picture.x + 16, picture.y + picture.h - 84, picture.w - 32, 68};
    ui_fill(b->ui, box, ROUND, b->theme->glass);
    ui_border(b->ui, box, ROUND, 2, warns ? b->theme->warn : b->theme->hairline);
    struct ui_box line = inner(box, 12);
    icon_draw(b->ui, icon, middle(cut_left(&line, 36)), 30, warns ? b->theme->warn : b->theme->accent);
    if (ui_text_width(b->ui, FACE_HEAD, text) <= line.w) {
        label(b, FACE_HEAD, line, b->theme->text, text);
        return;
    }
    const enum face face = ui_text_height(b->ui, FACE_BODY, text, line.w) <= line.h + 8 ? FACE_BODY : FACE_SMALL;
    const double h = ui_text_height(b->ui, face, text, line.w);
    ui_text_lines(b->ui, face, (struct ui_point){line.x, line.y + (line.h - h) / 2}, line.w, b->theme->text, text);
}
