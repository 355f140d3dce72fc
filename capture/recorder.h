// Records one take: frames from a source, the actor segmented and tracked in them, everything into a recording.
//
// Three threads pass frames along in bounded queues: the caller's reads the source; one locates the sensor, segments
// and tracks; one encodes and writes. With body points a fourth looks for them in every third colour image, between
// reading and tracking. A live source that is faster than they are loses frames, which are counted; a
// recorded one waits. What is written depends on the frames alone, never on timing; of a live source, also on whether
// the network keeps up: where 15 frames wait, images are left out rather than frames lost.
//
// When the take has ended and is complete, its depth is read again from the end to the beginning, and the online joints
// are replaced by smoothed ones (skeleton_smoother.h); not if the sensor was moved by 5 cm, a degree or more. That
// takes about as long as tracking did. If it is stopped or killed meanwhile, the take keeps the online joints.
//
// A kill or a power cut costs what is on its way. A recorded source is therefore read no further than 0.9 s of film
// ahead of what is in the file, however fast it could be read; a live one has at most the queues' frames on the way.
//
// While a take pauses, frames are read and thrown away. In the file the pause is closed: the first frame after it comes
// RECORDER_PAUSE_NS after the last one before it, longer than anything that joins one frame to the next (the smoother's
// and the skeleton track's gaps), and the person is looked for again, so that nothing is interpolated across.
//
// Memory: 1.9 MB for each of up to 85 waiting frames at 640 x 480, and for smoothing 2.5 KiB a frame: 335 MB for an
// hour at 30 Hz, because the array doubles. Where that cannot be had, recording goes on without smoothing.
#pragma once
#include "capture/sensor_pose.h"
#include "platform/sensors/source.h"
#include "recording/recording.h"

#define RECORDER_PAUSE_NS 1000000000

// A frame as it was seen, for coaching and preview. The images are borrowed until the callback returns.
struct recorder_seen {
    int64_t time_ns;
    const uint8_t *color;            // RGB; NULL: none
    const uint16_t *depth;           // millimetres; NULL: none
    const uint8_t *mask;             // of the depth image; NULL: no person
    const struct skeleton *skeleton; // online estimate, colour camera's axes; NULL: no person
    bool located;                    // the sensor's pose in the place is known
    struct sensor_sight sight;       // how well, and by which tags; without a place all 0
    int sensor_moves;                // so far
};

// How the recording goes, for those who watch it.
struct recorder_state {
    int waiting;         // frames between the sensor and the file
    int64_t dropped;     // so far
    double mb_per_s;     // written, per second of film; 0: not known yet
    double minutes_left; // that the disk has room for at that rate; negative: not known yet
};

// Zero-initialised: no callbacks, no limits. All callbacks but on_seen run on the caller's thread.
struct recorder_options {
    bool (*should_stop)(void); // asked before every frame read, and before every frame smoothed, where true keeps the
                               // online joints; NULL = never
    bool (*paused)(void *context);                               // asked before every frame; NULL = never
    void (*on_paused)(void *context, const struct frame *frame); // for every frame thrown away; may be NULL
    void (*on_frame)(void *context);                             // called for every frame read; may be NULL
    void (*on_smoothing_begin)(void *context, int64_t frames);   // `frames` will now be smoothed; may be NULL
    void (*on_smoothed)(void *context);                          // called for each of them; may be NULL
    // For every frame tracked, on the recorder's processing thread, which it holds up: a millisecond at most. May be
    // NULL.
    void (*on_seen)(void *context, const struct recorder_seen *seen);
    // For every frame of the take as soon as the sensor delivers it, on the caller's thread; may be NULL.
    void (*on_read)(void *context, const struct frame *frame);
    void (*on_state)(void *context, const struct recorder_state *state); // with on_frame; may be NULL
    void *context;
    bool body_points;          // look for them in colour images, where the networks are there (neural/pose_network.h)
    size_t smoother_bytes_max; // for the frames to be smoothed; a longer take is not smoothed. 0 = no limit
};

struct recorder_result {
    int64_t frames;           // written
    int64_t tracked;          // of them with a person
    int64_t looked;           // of them looked at for body points
    char no_body_points[256]; // why none were looked for although wanted: the networks are missing; "" else
    int64_t dropped;          // lost by the sensor or by the recorder
    int waiting_max;          // frames that waited between the sensor and the file, at most
    double handover_ms;       // the longest that the sensor's thread spent on handing over one frame
    double mb_per_s;          // written, per second of film
    int64_t damaged;          // images that could not be read
    char first_damage[256];   // the error sentence of the first of them; "" when none
    int pauses;
    bool located;                 // the sensor's pose in the place is known
    bool mirrored;                // it is not, because the pictures are mirrored: the place's tags tell
    int sensor_moves;             // how often it was moved during the take
    int32_t tags_moved;           // of the place's, now at another position; the lowest id of them is ...
    int32_t first_moved;          // ... this, else -1
    double slowest_ms, mean_ms;   // locating, segmenting and tracking one frame
    double smoothing_ms;          // a frame; 0 where the take was not smoothed
    bool smoothing_out_of_memory; // why it was not: no memory, or smoother_bytes_max
};

// Records `source` to its end, or until should_stop, as take `name`. `place` may be
// NULL. *result is filled in any case. ERR_DEVICE: the sensor was disconnected; what
// was recorded is a complete take all the same. ERR_IO: writing failed; what was
// committed stays. ERR_EXISTS, ERR_MEMORY, ERR_INPUT. `writer` stays the
// caller's to close.
MUST_CHECK enum status recorder_run(struct source *source, struct recording_writer *writer, const char *name,
                                    const struct place *place, const struct recorder_options *options,
                                    struct recorder_result *result);
