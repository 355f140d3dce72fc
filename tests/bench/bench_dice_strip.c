// Strips of images of a random film with the true and the tracked skeleton.
#include "platform/files/file.h"
#include "platform/files/png.h"
#include "tests/bench/bench_dice.h"
#include "tests/support/skeleton_drawing.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { INSTANTS = 8, CELL_WIDTH = 320, CELL_HEIGHT = 240, GAP = 4 };

struct canvas {
    uint8_t *rgb;
    int stride, height;
};

static struct drawing cell_of(const struct canvas *c, int column, int row)
{
    const size_t from = (size_t)(row * (CELL_HEIGHT + GAP)) * (size_t)c->stride + (size_t)(column * (CELL_WIDTH + GAP));
    return (struct drawing){c->rgb + 3 * from, CELL_WIDTH, CELL_HEIGHT, c->stride};
}

static int instant_frame(const struct dice_film *film, int i) { return (film->plan.frames - 1) * i / (INSTANTS - 1); }

// Around the true joints in the image at all instants, and a little more; its sides are as a cell's.
static struct drawn_window window_of(const struct dice_film *film, const struct lens *l)
{
    double x0 = l->width, x1 = 0, y0 = l->height, y1 = 0;
    for (int i = 0; i < INSTANTS; i++)
        for (int j = 0; j < JOINT_COUNT; j++) {
            const struct dice_frame *f = &film->frame[instant_frame(film, i)];
            if (f->sight[j] == DICE_OUTSIDE)
                continue;
            const struct pixel px = lens_project(l, f->truth.joint[j]);
            x0 = fmin(x0, px.x), x1 = fmax(x1, px.x);
            y0 = fmin(y0, px.y), y1 = fmax(y1, px.y);
        }
    const double margin = 0.06 * l->width;
    if (x1 < x0)
        x0 = y0 = 0, x1 = l->width, y1 = l->height;
    const double width = fmin(l->width, fmax(x1 - x0 + 2 * margin, (y1 - y0 + 2 * margin) * CELL_WIDTH / CELL_HEIGHT));
    const double height = width * CELL_HEIGHT / CELL_WIDTH;
    x0 = fmin(fmax(0, (x0 + x1 - width) / 2), l->width - width);
    y0 = fmin(fmax(0, (y0 + y1 - height) / 2), l->height - height);
    return (struct drawn_window){x0, y0, CELL_WIDTH / width};
}

static void put_color(const struct drawing *d, const struct dice_camera *camera, const struct drawn_window *w)
{
    const struct lens *l = &camera->calibration.depth;
    for (int y = 0; y < d->height; y++)
        for (int x = 0; x < d->width; x++) {
            const int column = (int)fmin(l->width - 1, w->x0 + x / w->scale);
            const int row = (int)fmin(l->height - 1, w->y0 + y / w->scale);
            const size_t at = (size_t)row * (size_t)l->width + (size_t)column;
            uint8_t *to = d->rgb + 3 * ((size_t)y * (size_t)d->stride + (size_t)x);
            for (size_t k = 0; k < 3; k++)
                to[k] = (uint8_t)(camera->color[3 * at + k] * 3 / 4);
        }
}

static enum status draw(struct canvas *canvas, const struct dice_film *film, struct dice_camera *camera)
{
    const struct lens *l = &camera->calibration.depth;
    const struct drawn_window window = window_of(film, l);
    enum status status = OK;
    for (int i = 0; i < INSTANTS && status == OK; i++) {
        const int k = instant_frame(film, i);
        status = dice_camera_shoot(camera, k, true);
        for (int mode = 0; mode < film->modes && status == OK; mode++) {
            const struct drawing cell = cell_of(canvas, i, mode);
            if (mode % 2 == 0)
                put_color(&cell, camera, &window);
            else
                drawing_put_depth(&cell, l, camera->depth, &window);
            drawing_put_skeleton(&cell, l, &film->frame[k].track[mode], &window, false);
            drawing_put_skeleton(&cell, l, &film->frame[k].truth, &window, true);
        }
    }
    return status;
}

enum status dice_strip_write(const struct dice_film *film, const char *folder)
{
    struct dice_camera camera = {0};
    struct canvas canvas = {.stride = INSTANTS * (CELL_WIDTH + GAP) - GAP,
                            .height = film->modes * (CELL_HEIGHT + GAP) - GAP};
    char path[4096];
    snprintf(path, sizeof path, "%s/film_%d.png", folder, film->plan.index);
    canvas.rgb = calloc((size_t)canvas.stride * (size_t)canvas.height, 3);
    enum status status = canvas.rgb ? folder_make(folder) : fail(ERR_MEMORY, "no memory for a strip of images");
    if (status == OK)
        status = dice_camera_open(&camera, &film->plan);
    if (status == OK)
        status = draw(&canvas, film, &camera);
    if (status == OK)
        status = png_write(path, PNG_RGB8, canvas.rgb, canvas.stride, canvas.height);
    dice_camera_close(&camera);
    free(canvas.rgb);
    return status;
}
