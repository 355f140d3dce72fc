// Tracks a film as `record` does: the online estimate, and the smoothed estimate once the end is known.
#pragma once
#include "capture/recording/skeleton.h"
#include "base/lens.h"

struct smoothed_film {
    struct calibration calibration;
    int count, capacity;
    int64_t *time_ns;
    uint16_t **depth;
    struct skeleton *online, *smoothed; // all confidence 0: no person
    bool *found;
};

// Zero the struct with {0} and set its calibration first. Copies the image. ERR_MEMORY.
MUST_CHECK enum status smoothed_film_add(struct smoothed_film *f, int64_t time_ns, const uint16_t *depth);
// Fills online, smoothed and found. ERR_MEMORY.
MUST_CHECK enum status smoothed_film_track(struct smoothed_film *f);
void smoothed_film_free(struct smoothed_film *f);
