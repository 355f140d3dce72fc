// Strips of images of a random film with the true and the tracked skeleton.
#include "tests/bench/bench_dice.h"

#include "platform/file.h"
#include "platform/png.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { INSTANTS = 8, CELL_WIDTH = 320, CELL_HEIGHT = 240, GAP = 4 };

struct canvas {
    uint8_t *rgb;
    int stride, height;
};

// The part of the image that is shown, pixels; its sides are as a cell's.
struct window {
    double x0, y0, scale; // scale: cell's pixels to one of the image
};

struct cell { // of the canvas, and the image that it shows
    struct canvas *canvas;
    int x0, y0;
    const struct lens *lens;
    struct window window;
};

static int instant_frame(const struct dice_film *film, int i) { return (film->plan.frames - 1) * i / (INSTANTS - 1); }

// Around the true joints in the image at all instants, and a little more.
static struct window window_of(const struct dice_film *film, const struct lens *l)
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
    return (struct window){x0, y0, CELL_WIDTH / width};
}

static void paint_image(struct cell *c, const struct dice_camera *camera, bool color)
{
    for (int y = 0; y < CELL_HEIGHT; y++)
        for (int x = 0; x < CELL_WIDTH; x++) {
            const int column = (int)fmin(c->lens->width - 1, c->window.x0 + x / c->window.scale);
            const int row = (int)fmin(c->lens->height - 1, c->window.y0 + y / c->window.scale);
            const size_t at = (size_t)row * (size_t)c->lens->width + (size_t)column;
            uint8_t *to = c->canvas->rgb + 3 * ((size_t)(c->y0 + y) * (size_t)c->canvas->stride + (size_t)(c->x0 + x));
            const int mm = camera->depth[at];
            const uint8_t grey = (uint8_t)(mm ? fmax(30, 230 - 0.035 * mm) : 0);
            for (int k = 0; k < 3; k++)
                to[k] = color ? (uint8_t)(camera->color[3 * at + (size_t)k] * 3 / 4) : grey;
        }
}

// A line with round ends; a == b is a dot.
static void paint_line(struct cell *c, struct pixel a, struct pixel b, double radius, const uint8_t color[3])
{
    const double dx = b.x - a.x, dy = b.y - a.y, length2 = dx * dx + dy * dy;
    const int x0 = (int)fmax(0, fmin(a.x, b.x) - radius - 1),
              x1 = (int)fmin(CELL_WIDTH - 1, fmax(a.x, b.x) + radius + 1);
    const int y0 = (int)fmax(0, fmin(a.y, b.y) - radius - 1),
              y1 = (int)fmin(CELL_HEIGHT - 1, fmax(a.y, b.y) + radius + 1);
    for (int y = y0; y <= y1; y++)
        for (int x = x0; x <= x1; x++) {
            double t = length2 > 0 ? ((x - a.x) * dx + (y - a.y) * dy) / length2 : 0;
            t = fmin(1, fmax(0, t));
            const double cover = fmin(1, radius + 0.5 - hypot(x - a.x - t * dx, y - a.y - t * dy));
            uint8_t *to = c->canvas->rgb + 3 * ((size_t)(c->y0 + y) * (size_t)c->canvas->stride + (size_t)(c->x0 + x));
            for (int k = 0; k < 3 && cover > 0; k++)
                to[k] = (uint8_t)lround(to[k] + cover * (color[k] - to[k]));
        }
}

static bool place_joint(const struct cell *c, const struct skeleton *s, enum joint j, struct pixel *out)
{
    if (!(s->confidence[j] > 0) || !(s->joint[j].z > 0.1))
        return false;
    *out = lens_project(c->lens, s->joint[j]);
    out->x = (out->x + 0.5 - c->window.x0) * c->window.scale - 0.5;
    out->y = (out->y + 0.5 - c->window.y0) * c->window.scale - 0.5;
    return fabs(out->x) < 10 * CELL_WIDTH && fabs(out->y) < 10 * CELL_HEIGHT;
}

static const uint8_t *color_of(enum joint j)
{
    static const uint8_t left[3] = {255, 140, 0}, right[3] = {40, 120, 255}, middle[3] = {40, 190, 60};
    const char *name = joint_name(j);
    return !strncmp(name, "left_", 5) ? left : !strncmp(name, "right_", 6) ? right : middle;
}

static void paint_skeleton(struct cell *c, const struct skeleton *s, bool truth)
{
    static const uint8_t white[3] = {255, 255, 255};
    static const enum joint bone[][2] = {
        {JOINT_NECK, JOINT_HEAD},
        {JOINT_NECK, JOINT_TORSO},
        {JOINT_TORSO, JOINT_WAIST},
        {JOINT_NECK, JOINT_LEFT_SHOULDER},
        {JOINT_LEFT_SHOULDER, JOINT_LEFT_ELBOW},
        {JOINT_LEFT_ELBOW, JOINT_LEFT_HAND},
        {JOINT_NECK, JOINT_RIGHT_SHOULDER},
        {JOINT_RIGHT_SHOULDER, JOINT_RIGHT_ELBOW},
        {JOINT_RIGHT_ELBOW, JOINT_RIGHT_HAND},
        {JOINT_WAIST, JOINT_LEFT_HIP},
        {JOINT_LEFT_HIP, JOINT_LEFT_KNEE},
        {JOINT_LEFT_KNEE, JOINT_LEFT_FOOT},
        {JOINT_WAIST, JOINT_RIGHT_HIP},
        {JOINT_RIGHT_HIP, JOINT_RIGHT_KNEE},
        {JOINT_RIGHT_KNEE, JOINT_RIGHT_FOOT},
    };
    for (size_t k = 0; k < COUNT_OF(bone); k++) {
        const enum joint a = bone[k][0], b = bone[k][1];
        struct pixel from, to;
        if (!place_joint(c, s, a, &from) || !place_joint(c, s, b, &to))
            continue;
        const bool sure = s->confidence[a] >= 1 && s->confidence[b] >= 1;
        paint_line(c, from, to, truth ? 0.4 : sure ? 1.3 : 0.7, truth ? white : color_of(b));
        paint_line(c, to, to, truth ? 1 : s->confidence[b] >= 1 ? 3 : 1.5, truth ? white : color_of(b));
    }
}

static enum status draw(struct canvas *canvas, const struct dice_film *film, struct dice_camera *camera)
{
    const struct lens *l = &camera->calibration.depth;
    const struct window window = window_of(film, l);
    enum status status = OK;
    for (int i = 0; i < INSTANTS && status == OK; i++) {
        const int k = instant_frame(film, i);
        status = dice_camera_shoot(camera, k, true);
        for (int mode = 0; mode < film->modes && status == OK; mode++) {
            struct cell cell = {canvas, i * (CELL_WIDTH + GAP), mode * (CELL_HEIGHT + GAP), l, window};
            paint_image(&cell, camera, mode % 2 == 0);
            paint_skeleton(&cell, &film->frame[k].track[mode], false);
            paint_skeleton(&cell, &film->frame[k].truth, true);
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
