// The studio's sensor: one thread that reads it, follows the person for the preview and records takes, with the coach
// beside it. The window's thread asks for takes and reads snapshots; neither waits for the other's work.
//
// Without a take nothing is written. A source that ends (a film in a folder) is opened again, at its own pace, so that
// the studio can be tried and tested without a sensor.
#pragma once
#include "capture/coaching/coach.h"
#include "capture/recording/recording.h"

struct studio_session;

struct studio_session_options {
    const char *sensor;       // URI
    const char *file;         // the recording; is made with the first take, where it does not exist
    void (*wake)(void *self); // from the session's threads: there is something new; may be NULL
    void *wake_self;
    bool body_points;
};

// ERR_MEMORY. Opens the sensor on its own thread: errors are in the snapshot.
MUST_CHECK enum status studio_session_open(struct studio_session **out, const struct studio_session_options *options);
// Ends a take that is being made, in good order. NULL is fine; sets *s = NULL.
void studio_session_close(struct studio_session **s);

void studio_session_begin(struct studio_session *s, const char *take);
void studio_session_end(struct studio_session *s);

enum studio_doing {
    STUDIO_DOING_OPEN,
    STUDIO_DOING_PREVIEW,
    STUDIO_DOING_TAKE,
    STUDIO_DOING_SMOOTH,
    STUDIO_DOING_FAILED
};

struct studio_counters {
    double frames_per_s, mb_per_s, minutes_left; // mb_per_s 0, minutes_left < 0: not known yet
    int64_t frames, dropped;                     // of the take
    double take_s;
};

// What the window shows. Buffers grow as needed and belong to the snapshot.
struct studio_snapshot {
    int64_t number; // of the frame; 0: none yet
    enum studio_doing doing;
    struct calibration calibration;
    uint8_t *color, *mask; // RGB; mask all 0: no person
    uint16_t *depth;
    size_t color_bytes, depth_pixels;
    bool has_color, has_depth, has_skeleton;
    struct skeleton skeleton;
    bool has_place, located;
    struct studio_counters counters;
    int gestures;    // raised hands so far
    int takes_ready; // takes that ended so far, whatever came of them
    char text[160];  // the coach's
    bool fault;
    double share;
    enum pose_advice advice;
    struct coverage coverage;
    double distance_m;
    struct coach_verdict verdict; // of the last take, and what it has seen
    struct coverage verdict_coverage;
    int64_t take_frames; // written of the last take
    char failure[512];   // of the sensor, or of the last take; "": none
};
void studio_snapshot_free(struct studio_snapshot *s);

// Copies the newest state. False: nothing is new since snapshot->number and doing; *out is unchanged.
bool studio_session_read(struct studio_session *s, struct studio_snapshot *out);
