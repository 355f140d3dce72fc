#include "app/studio/studio_snapshot.h"

#include "recording/depth_picture.h"

#include <stdlib.h>
#include <string.h>

void studio_snapshot_free(struct studio_snapshot *snapshot)
{
    free(snapshot->color);
    free(snapshot->mask);
    free(snapshot->depth);
    *snapshot = (struct studio_snapshot){0};
}

bool studio_snapshot_size(struct studio_snapshot *snapshot, const struct calibration *calibration)
{
    const size_t color = 3 * (size_t)calibration->color.width * (size_t)calibration->color.height,
                 depth = (size_t)calibration->depth.width * (size_t)calibration->depth.height;
    if (snapshot->color_bytes == color && snapshot->depth_pixels == depth)
        return true;
    free(snapshot->color);
    free(snapshot->mask);
    free(snapshot->depth);
    snapshot->color = malloc(color + 1);
    snapshot->mask = calloc(depth + 1, 1);
    snapshot->depth = calloc(depth + 1, sizeof *snapshot->depth);
    snapshot->color_bytes = color;
    snapshot->depth_pixels = depth;
    if (snapshot->color && snapshot->mask && snapshot->depth)
        return true;
    snapshot->color_bytes = snapshot->depth_pixels = 0;
    return false;
}

static bool same_size(const struct lens *a, const struct lens *b)
{
    return a->width == b->width && a->height == b->height;
}

void studio_snapshot_calibrate(struct studio_snapshot *snapshot, const struct calibration *calibration)
{
    snapshot->without_color = 0;
    snapshot->has_color = snapshot->has_color && same_size(&snapshot->calibration.color, &calibration->color);
    snapshot->has_depth = snapshot->has_depth && same_size(&snapshot->calibration.depth, &calibration->depth);
    snapshot->calibration = *calibration;
}

void studio_snapshot_pictures(struct studio_snapshot *snapshot, const uint8_t *color, const uint16_t *depth,
                              const uint8_t *mask)
{
    if (!studio_snapshot_size(snapshot, &snapshot->calibration))
        return;
    snapshot->has_color = color != NULL;
    snapshot->without_color = frames_without_color(snapshot->without_color, color);
    snapshot->has_depth = depth != NULL;
    if (color)
        memcpy(snapshot->color, color, snapshot->color_bytes);
    if (depth)
        memcpy(snapshot->depth, depth, snapshot->depth_pixels * sizeof *snapshot->depth);
    if (mask)
        memcpy(snapshot->mask, mask, snapshot->depth_pixels);
    else
        memset(snapshot->mask, 0, snapshot->depth_pixels);
}

bool studio_snapshot_sees_color(const struct studio_snapshot *snapshot)
{
    return snapshot->calibration.color.width > 0 &&
           (snapshot->without_color < DEPTH_PICTURE_AFTER || !snapshot->calibration.depth.width);
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
