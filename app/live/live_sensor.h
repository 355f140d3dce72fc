// The live sensor: a depth sensor that is read, tracked and judged (live_tracker.h) on a thread of its own. The newest
// frame wins: what is not drawn in time is dropped, and so is what the sensor delivers while a frame is tracked. Body
// points are looked for beside it (capture/follow.h).
//
// A sensor that fails is closed and opened again every second. A film (folder:, oni:) is played in real time and stands
// in for a person: it stays at its first frame until an attempt begins, and starts again with each attempt. What comes
// late is left out, unless every_frame is set.
//
// Threads: the drawing one calls all functions; `notify` is called on the sensor's. Memory: five frames, the network's,
// and 712 bytes a frame of an attempt, of which the first ATTEMPT_MAX_S seconds are collected; constant however long
// it goes on.
#pragma once
#include "app/live/live_keeper.h"
#include "app/live/live_tracker.h"

enum { ATTEMPT_MAX_S = 600 };

struct live_sensor;

struct live_sensor_options {
    const char *sensor;               // URI; copied
    const struct place *place;        // as in live_tracker_options
    const struct movement *reference; // as there
    const struct movement *mirrored;  // as there
    struct live_keeper *keeper;       // gets the frames of attempts; NULL: none. Must outlive the sensor
    bool no_body_points;              // are looked for in colour images
    bool every_frame;                 // a film leaves nothing out, for tests and measurements
    void (*notify)(void *self);       // called whenever there is something new; may be NULL
    void *notify_self;
};
// ERR_MEMORY: *out is NULL. A sensor that cannot be opened is no error here: live_sensor_state.trouble says so.
MUST_CHECK enum status live_sensor_open(struct live_sensor **out, const struct live_sensor_options *options);
void live_sensor_close(struct live_sensor **s); // NULL is fine; waits for the thread

struct live_frame {
    int64_t number;                 // 1, 2, … over all frames
    struct calibration calibration; // of the sensor; without colour, of its depth drawn as a picture (depth_picture.h)
    const uint8_t *rgb;             // of calibration.color's size; NULL: this frame has no colour
    const uint16_t *depth;          // of calibration.depth's size
    const uint8_t *mask;            // 255 = the person
    struct live_look look;
    int attempt;                     // the wish's when it was judged
    int64_t received_ns, tracked_ns; // by clock_now_ns: when it arrived, when it was judged
};
// The newest frame, NULL before the first. Borrowed until the next call.
const struct live_frame *live_sensor_latest(struct live_sensor *sensor);

struct live_wish {
    int attempt; // a new number: the judge and a film start again, joints are collected again
    bool run;    // an attempt is being made; else a film stands at its first frame
    struct live_shown shown;
};
void live_sensor_wish(struct live_sensor *sensor, const struct live_wish *wish);

// Moves out the joints of that attempt, times from 0; none: NOTHING. ERR_MEMORY: there was no memory for all of them,
// and *out has those before.
MUST_CHECK enum status live_sensor_take_samples(struct live_sensor *s, int attempt, struct joint_samples *out);

struct live_sensor_state {
    bool seeing;               // the sensor is open and has delivered a frame
    bool film, ended;          // it is a film; which is over
    int64_t received_ns;       // when the last frame arrived
    int64_t received, dropped; // frames; dropped: not tracked, because newer ones came or a film was late
    double track_ms, judge_ms; // processor time, sums over the received frames
    int64_t looked;            // colour images in which body points were looked for
    char no_body_points[256];  // why none are, although wanted; "": they are, or there is no colour
    char trouble[256];         // one sentence; "": none
};
struct live_sensor_state live_sensor_query(struct live_sensor *sensor);

void live_sensor_suspend(struct live_sensor *sensor,
                         bool suspend); // true: the sensor is closed until the call with false
