// Copies what a recording holds of its place into another recording: the map, the things in it, and where a robot was
// driven. For repair, and for copies of takes. What is damaged costs itself alone and is counted.
#pragma once
#include "recording/frame_copier.h"

struct place_copy_counts {
    bool has_calibration; // of the sensor that recorded the place
    struct calibration calibration;
    bool lost_place; // it is there and cannot be read
    int32_t lost_views;
    bool lost_map_covariances; // or points' viewing directions
    int lost_things;           // things, and pictures or models of things
};

// Both are paths of recordings; `to` has no place. COPIER_READS_ALL: a place or a drive that cannot be read ends the
// copy with ERR_CORRUPT; damaged views and things are left out here, too. ERR_MEMORY, ERR_IO.
MUST_CHECK enum status place_copy(const char *path, const char *to, enum copier_reads reads,
                                  struct place_copy_counts *out);
