#include "objects/sweep_pictures.h"

#include "platform/files/jpeg.h"

#include <stdlib.h>
#include <string.h>

// Chosen by hand. NEIGHBOURS: on either side, which show about the same; SHARP: of the sharpest of them.
enum { NEIGHBOURS = 3, QUALITY = 92 };
static const double SHARP = 0.5;

void sweep_pictures_start(struct sweep_pictures *s, const struct calibration *calibration)
{
    *s = (struct sweep_pictures){.calibration = *calibration, .stride = 1};
    struct lens *l = &s->depth_lens;
    *l = calibration->depth;
    if (!(l->width > 1 && l->height > 1)) {
        *l = (struct lens){0};
        return;
    }
    l->width /= 2, l->height /= 2; // every second sample, from the first on
    l->fx /= 2, l->fy /= 2, l->cx /= 2, l->cy /= 2;
}

static void free_picture(struct sweep_picture *p)
{
    free(p->jpeg);
    free(p->depth);
    *p = (struct sweep_picture){0};
}

void sweep_pictures_free(struct sweep_pictures *s)
{
    for (int i = 0; i < s->count; i++)
        free_picture(&s->pictures[i]);
    *s = (struct sweep_pictures){0};
}

// Of green: the variance of the difference of neighbours in a row, over that of values eight pixels apart. Motion blur
// and defocus take the first away and leave the second.
static double sharpness_of(const uint8_t *rgb, int width, int height)
{
    enum { FAR = 8 };
    double near = 0, far = 1;
    for (int y = 0; y < height; y += 2)
        for (int x = 0; x + FAR < width; x += 2) {
            const uint8_t *p = rgb + 3 * ((size_t)y * (size_t)width + (size_t)x) + 1;
            const int a = p[3] - p[0], b = p[(size_t)3 * FAR] - p[0];
            near += a * a;
            far += b * b;
        }
    return near / far;
}

static void thin_out(struct sweep_pictures *s)
{
    int kept = 0;
    for (int i = 0; i < s->count; i++)
        if (i % 2)
            free_picture(&s->pictures[i]);
        else
            s->pictures[kept++] = s->pictures[i];
    s->count = kept;
    s->stride *= 2;
}

static enum status copy_jpeg(const struct sweep_pictures *s, const struct frame *frame, struct sweep_picture *p)
{
    const struct lens *l = &s->calibration.color;
    if (!frame->jpeg)
        return jpeg_encode(frame->color, l->width, l->height, QUALITY, &p->jpeg, &p->jpeg_bytes);
    if (!(p->jpeg = malloc(frame->jpeg_bytes)))
        return fail(ERR_MEMORY, "no memory for a picture of the sweep");
    memcpy(p->jpeg, frame->jpeg, frame->jpeg_bytes);
    p->jpeg_bytes = frame->jpeg_bytes;
    return OK;
}

static enum status copy_depth(const struct sweep_pictures *s, const uint16_t *depth, struct sweep_picture *p)
{
    const struct lens *l = &s->depth_lens;
    if (!(p->depth = malloc(sizeof *p->depth * (size_t)l->width * (size_t)l->height)))
        return fail(ERR_MEMORY, "no memory for a depth picture of the sweep");
    for (int y = 0; y < l->height; y++)
        for (int x = 0; x < l->width; x++)
            p->depth[y * l->width + x] =
                depth[(size_t)2 * (size_t)y * (size_t)s->calibration.depth.width + 2 * (size_t)x];
    return OK;
}

enum status sweep_pictures_add(struct sweep_pictures *s, const struct frame *frame)
{
    if (!frame->color || s->seen++ % s->stride)
        return OK;
    if (s->count == SWEEP_PICTURES_MOST)
        thin_out(s);
    if ((s->seen - 1) % s->stride)
        return OK;
    struct sweep_picture *p = &s->pictures[s->count];
    const struct lens *l = &s->calibration.color;
    *p =
        (struct sweep_picture){.time_ns = frame->time_ns, .sharpness = sharpness_of(frame->color, l->width, l->height)};
    enum status status = copy_jpeg(s, frame, p);
    if (status == OK && frame->depth && s->depth_lens.width)
        status = copy_depth(s, frame->depth, p);
    if (status == OK)
        s->count++;
    else
        free_picture(p);
    return status;
}

bool sweep_picture_is_sharp(const struct sweep_pictures *s, int picture)
{
    double best = 0;
    for (int i = picture - NEIGHBOURS; i <= picture + NEIGHBOURS; i++)
        if (i >= 0 && i < s->count && s->pictures[i].sharpness > best)
            best = s->pictures[i].sharpness;
    return s->pictures[picture].sharpness >= SHARP * best;
}
