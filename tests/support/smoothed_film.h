// Tracks a film as `record` does: the online estimate, and the smoothed estimate once the end is known.
#pragma once
#include "capture/body/point_evidence.h"
#include "capture/tracking/tracker.h"

struct smoothed_floor {
    struct vec3 up;
    double height_m;
};

struct smoothed_film {
    struct calibration calibration;
    int count, capacity;
    int64_t *time_ns;
    uint16_t **depth;
    struct skeleton *online, *smoothed; // all confidence 0: no person
    bool *found;
    // What is known of the room beforehand; left 0: nothing.
    const uint16_t *background;         // as for tracker_set_background
    const struct smoothed_floor *floor; // as for tracker_set_floor
    // Points of each frame's colour image, and which frames' images were looked at; left NULL: none.
    const struct body_points *points;
    const bool *looked;
};

// Zero the struct with {0} and set its calibration first. Copies the image. ERR_MEMORY.
MUST_CHECK enum status smoothed_film_add(struct smoothed_film *f, int64_t time_ns, const uint16_t *depth);
// Fills online, smoothed and found, again when called again. ERR_MEMORY.
MUST_CHECK enum status smoothed_film_track(struct smoothed_film *f);
void smoothed_film_free(struct smoothed_film *f);
