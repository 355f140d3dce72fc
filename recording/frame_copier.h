// Copies frames of one recording into another, checking all of them: for repair, and for copies of takes. What cannot
// be read is left out and counted.
#pragma once
#include "recording/async_writer.h"

struct frame_copier;

// What became of the frames of one take.
struct frame_copy_counts {
    int64_t saved, damaged;   // damaged: of the saved ones, those that lost an image
    int64_t covariances_lost; // of the saved ones, those whose joints' covariances cannot be read
    int64_t lost;             // missing, or of no use
    int64_t representative;   // the new number of the representative frame; -1: none, or lost
};

enum copier_reads {
    COPIER_READS_WHAT_IT_CAN, // repair: of a disk that fails, too, what it still gives
    COPIER_READS_ALL,         // a disk that fails ends the copy: ERR_IO. Damaged rows are left out here, too
};

// Both databases stay the caller's. `to` must be locked for writing, and belongs to the writer meanwhile. ERR_MEMORY,
// ERR_IO, ERR_CORRUPT; *out is then NULL.
MUST_CHECK enum status frame_copier_open(struct frame_copier **out, struct database *from, struct async_writer *to,
                                         enum copier_reads reads);
void frame_copier_close(struct frame_copier **c);

// Finds rows whose ids were damaged, in the whole file: those whose seal fits another id that differs in one bit; in
// older files, without seals, those whose images wait under such an id. For a file that is known to be damaged.
MUST_CHECK enum status frame_copier_find_strays(struct frame_copier *copier);

// Copies the frames of `take`, which calibration and body describe, as the take `new_id`. `located` false: poses are
// left out. The size of an image that does not fit the calibration makes it unusable. ERR_MEMORY, ERR_IO.
MUST_CHECK enum status frame_copier_copy(struct frame_copier *copier, const struct take_row *take, int64_t new_id,
                                         bool located, struct frame_copy_counts *out);

// For a take whose row is damaged: takes the sizes of its images from the first one that can be read.
MUST_CHECK enum status frame_copier_infer_sizes(struct frame_copier *copier, struct take_row *take);

// ---------------------------------------------------------------- place copier

// Copies what a recording holds of its place into another recording: the map, the things in it, and where a robot was
// driven. For repair, and for copies of takes. What is damaged costs itself alone and is counted.

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
