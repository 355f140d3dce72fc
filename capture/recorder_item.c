#include "capture/recorder_item.h"

#include <stdlib.h>
#include <string.h>

void recorder_item_free(struct recorder_item *item)
{
    if (!item)
        return;
    free(item->color);
    free(item->jpeg);
    free(item->mask);
    free(item->depth);
    free(item);
}

static void *copy_bytes(const void *bytes, size_t count)
{
    void *to = malloc(count);
    return to ? memcpy(to, bytes, count) : NULL;
}

struct recorder_item *recorder_item_from_frame(const struct frame *frame, const struct calibration *calibration)
{
    struct recorder_item *item = calloc(1, sizeof *item);
    if (!item)
        return NULL;
    item->time_ns = frame->time_ns;
    item->world_from_camera = POSE_IDENTITY;
    bool whole = true;
    if (frame->color)
        whole &= (item->color = copy_bytes(frame->color, 3 * lens_pixels(&calibration->color))) != NULL;
    if (frame->jpeg) {
        whole &= (item->jpeg = copy_bytes(frame->jpeg, frame->jpeg_bytes)) != NULL;
        item->jpeg_bytes = frame->jpeg_bytes;
    }
    if (frame->depth) {
        whole &=
            (item->depth = copy_bytes(frame->depth, sizeof *frame->depth * lens_pixels(&calibration->depth))) != NULL;
        whole &= (item->mask = calloc(lens_pixels(&calibration->depth), 1)) != NULL;
    }
    if (!whole) {
        recorder_item_free(item);
        return NULL;
    }
    return item;
}
