// Tracks a film as `record` does: the online estimate, and the smoothed estimate once the end is known.
#pragma once
#include "capture/body/point_evidence.h"
#include "capture/tracking/skeleton_smoother.h"

struct smoothed_floor {
    struct vec3 up;
    double height_m;
};

// What a frame's errors were judged by (joint_error.h), and the covariances' scale that it gave.
struct film_evidence {
    struct joint_features pass[2][JOINT_COUNT]; // forward, backward; that of a frame without a person is all 0
    struct smoothed_features smoothed[JOINT_COUNT];
    struct skeleton found;                                              // by the network in this image alone
    float online_widening[JOINT_COUNT], smoothed_widening[JOINT_COUNT]; // of the covariances
};

struct smoothed_film {
    struct calibration calibration;
    int count, capacity;
    int64_t *time_ns;
    uint16_t **depth;
    struct skeleton *online, *smoothed; // all confidence 0: no person
    bool *found;
    struct film_evidence *evidence; // kept where with_evidence is set
    bool with_evidence;
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
