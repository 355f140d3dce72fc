#include "app/studio/studio_snapshot.h"

#include "recording/depth_picture.h"

#include <stdlib.h>
#include <string.h>

void studio_snapshot_free(struct studio_snapshot *s)
{
    free(s->color);
    free(s->mask);
    free(s->depth);
    *s = (struct studio_snapshot){0};
}

bool studio_snapshot_size(struct studio_snapshot *s, const struct calibration *c)
{
    const size_t color = 3 * (size_t)c->color.width * (size_t)c->color.height,
                 depth = (size_t)c->depth.width * (size_t)c->depth.height;
    if (s->color_bytes == color && s->depth_pixels == depth)
        return true;
    free(s->color);
    free(s->mask);
    free(s->depth);
    s->color = malloc(color + 1);
    s->mask = calloc(depth + 1, 1);
    s->depth = calloc(depth + 1, sizeof *s->depth);
    s->color_bytes = color;
    s->depth_pixels = depth;
    if (s->color && s->mask && s->depth)
        return true;
    s->color_bytes = s->depth_pixels = 0;
    return false;
}

static bool same_size(const struct lens *a, const struct lens *b)
{
    return a->width == b->width && a->height == b->height;
}

void studio_snapshot_calibrate(struct studio_snapshot *s, const struct calibration *c)
{
    s->without_color = 0;
    s->has_color = s->has_color && same_size(&s->calibration.color, &c->color);
    s->has_depth = s->has_depth && same_size(&s->calibration.depth, &c->depth);
    s->calibration = *c;
}

void studio_snapshot_pictures(struct studio_snapshot *s, const uint8_t *color, const uint16_t *depth,
                              const uint8_t *mask)
{
    if (!studio_snapshot_size(s, &s->calibration))
        return;
    s->has_color = color != NULL;
    s->without_color = frames_without_color(s->without_color, color);
    s->has_depth = depth != NULL;
    if (color)
        memcpy(s->color, color, s->color_bytes);
    if (depth)
        memcpy(s->depth, depth, s->depth_pixels * sizeof *s->depth);
    if (mask)
        memcpy(s->mask, mask, s->depth_pixels);
    else
        memset(s->mask, 0, s->depth_pixels);
}

bool studio_snapshot_sees_color(const struct studio_snapshot *s)
{
    return s->calibration.color.width > 0 && (s->without_color < DEPTH_PICTURE_AFTER || !s->calibration.depth.width);
}

bool studio_snapshot_copy(const struct studio_snapshot *from, struct studio_snapshot *out)
{
    const bool fresh = from->number != out->number || from->doing != out->doing ||
                       from->takes_ready != out->takes_ready || from->judged != out->judged ||
                       from->room.ready != out->room.ready || from->room.not_kept != out->room.not_kept;
    if (!fresh || !studio_snapshot_size(out, &from->calibration))
        return false;
    const struct studio_snapshot kept = *out;
    *out = *from;
    out->color = kept.color;
    out->mask = kept.mask;
    out->depth = kept.depth;
    out->color_bytes = kept.color_bytes;
    out->depth_pixels = kept.depth_pixels;
    if (from->has_color)
        memcpy(out->color, from->color, from->color_bytes);
    if (from->has_depth) {
        memcpy(out->depth, from->depth, from->depth_pixels * sizeof *out->depth);
        memcpy(out->mask, from->mask, from->depth_pixels);
    }
    return true;
}
