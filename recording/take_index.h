// A take's row and the index of its frames, read when the take is opened. Inside recording only.
#pragma once
#include "recording/recording_reader.h"

#include <stdatomic.h>

// What all handles on a take share. Immutable once it is read, but for the two counters; the last handle that closes
// frees it.
struct take_index {
    atomic_int handles;
    atomic_llong decoded; // frames; for take_frames_decoded
    int64_t id;
    struct calibration calibration;
    struct body body;
    bool complete;
    bool located;          // take_is_located
    bool drawn_from_depth; // its colour images: it has none of its own (take_open_drawn)
    int64_t dropped;
    int64_t lost_now;      // frames that this file once had
    int64_t lost;          // and those that it never had because a repair could not save them
    int64_t errors_lost;   // covariances of frames
    int64_t count_written; // that the take had when it ended; -1: not known
    int64_t uncounted;     // frames that are there beyond those
    bool out_of_range;     // the take's row holds what is not as the format says
    char note[TAKE_NOTE_BYTES + 1], alias[TAKE_NAME_BYTES + 1];
    struct take_entry *entries;
    int64_t count;
};

_Static_assert(sizeof(struct take_entry) <= 712, "recording.h states the memory of an hour");

// Fills an index whose id is set. ERR_CORRUPT, ERR_IO, ERR_MEMORY; take_index_release is needed also then.
MUST_CHECK enum status take_index_read(struct take_index *t, struct recording *r);

// One handle less; the last one frees it.
void take_index_release(struct take_index *t);
