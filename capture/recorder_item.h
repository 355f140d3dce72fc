// One frame on its way through the recorder's threads.
#pragma once
#include "capture/body_points.h"
#include "platform/sensors/source.h"

// Owns copies of the sensor's images. NULL: it gave none.
struct recorder_item {
    int64_t time_ns;
    uint8_t *color, *jpeg, *mask;
    uint16_t *depth;
    size_t jpeg_bytes;
    struct pose world_from_camera;
    bool located, has_skeleton, body_changed, has_points, after_pause;
    struct body_points points;
    struct skeleton skeleton;
    struct body body;
};

// With copies of the frame's images, and a mask of zeros where there is depth. NULL: out of memory.
struct recorder_item *recorder_item_from_frame(const struct frame *frame, const struct calibration *calibration);
void recorder_item_free(struct recorder_item *item); // NULL is fine
