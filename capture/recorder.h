// Films one take: pictures from a source, the person found and tracked in them,
// everything into a recording.
//
// Three threads pass frames along: the caller's reads the source, one locates,
// segments and tracks, one encodes and writes. A live source that gets ahead of
// them by more than the queues hold loses frames, which are counted; a recorded
// one waits. What is written depends on the frames alone, never on timing.
//
// When the take has ended and is complete, its depth is read again from the end
// to the beginning and the joints are told anew, with the future known (skeleton_smoother.h);
// unless the sensor was moved by 5 cm, a degree or more. That takes about as long as tracking did. Whoever
// stops or kills it meanwhile has the take with the joints as they were told at first.
#pragma once
#include "capture/recording/recording.h"
#include "platform/source.h"

struct recorder_options {
    bool (*should_stop)(void);       // asked before every frame read, and looked back at, where true leaves the joints
                                     // as they were told; NULL = never
    void (*on_frame)(void *context); // called on the caller's thread for every frame read; may be NULL
    void (*on_smoothing_begin)(void *context, int64_t frames); // so many are now looked back at; may be NULL
    void (*on_smoothed)(void *context);                        // on the caller's thread for each of them; may be NULL
    void *context;
};

struct recorder_result {
    int64_t frames;             // written
    int64_t tracked;            // of them with a person
    int64_t dropped;            // lost by the sensor or by us
    int64_t damaged;            // pictures that could not be read
    char first_damage[256];     // what the first of them said; "" when none
    bool located;               // the sensor was found in the place
    int sensor_moves;           // how often it was moved on the way
    int32_t tags_moved;         // of the place's, that hang elsewhere now; the lowest number of them is ...
    int32_t first_moved;        // ... this, else -1
    double slowest_ms, mean_ms; // locating, segmenting and tracking one frame
    double smoothing_ms;        // a frame, looking back; 0 where that was not done
};

// Films `source` to its end, or until should_stop, as take `name`. `place` may be
// NULL. *result is filled in any case. ERR_DEVICE: the sensor went away; what
// was filmed is a complete take all the same. ERR_IO: the disk refused; what was
// committed stays. ERR_EXISTS, ERR_MEMORY, ERR_INPUT. `writer` stays the
// caller's to close.
MUST_CHECK enum status recorder_run(struct source *source, struct recording_writer *writer, const char *name,
                                    const struct place *place, const struct recorder_options *options,
                                    struct recorder_result *result);
