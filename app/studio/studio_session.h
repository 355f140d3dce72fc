// The studio's sensor: one thread that reads it, follows the person for the preview, records takes, with the coach
// beside it, and sweeps the room. The window's thread asks for these and reads snapshots; neither waits for the other's
// work.
//
// Without a take nothing is written. A source that ends (a film in a folder) is opened again, at its own pace, so that
// the studio can be tried and tested without a sensor.
#pragma once
#include "capture/coaching/coach.h"
#include "capture/follow.h"
#include "capture/mapping/map_advice.h"
#include "capture/take_verdict.h"
#include "recording/recording.h"

// ---------------------------------------------------------------- snapshot

// What the studio's window shows: everything that the session's threads know, copied for the window's.

enum studio_doing {
    STUDIO_DOING_OPEN,
    STUDIO_DOING_PREVIEW,
    STUDIO_DOING_TAKE,
    STUDIO_DOING_SMOOTH,
    STUDIO_DOING_SWEEP,
    STUDIO_DOING_MAP, // of the sweep
    STUDIO_DOING_FAILED
};

struct studio_counters {
    // Of a take as it is written; before, as one frame in some seconds would be. 0, minutes_left < 0: not known yet.
    double frames_per_s, mb_per_s, minutes_left;
    int64_t frames, dropped; // of the take
    double take_s;
    // Of a take: how much older the picture and the skeleton shown are than the sensor's newest picture.
    double behind_s, skeleton_behind_s;
};

// The room, swept or being swept.
struct studio_room_view {
    struct sweep_plan plan;
    struct map_advice advice; // of the finished map
    char failure[512];        // why there is none; "": there is
    int ready;                // sweeps that ended so far, with a map or without
    int not_kept;             // how often its map was to be kept and could not be; it waits for another try
    char why_not_kept[160];
};

// Buffers grow as needed and belong to the snapshot.
struct studio_snapshot {
    int64_t number; // of the frame; 0: none yet
    enum studio_doing doing;
    struct calibration calibration;
    uint8_t *color, *mask; // RGB; mask all 0: no person
    uint16_t *depth;
    size_t color_bytes, depth_pixels;
    bool has_color, has_depth, has_skeleton;
    int without_color; // frames in a row that brought no colour image
    struct skeleton skeleton;
    bool has_place, located;
    struct sensor_sight sight;
    struct follower_points points; // of the preview
    struct studio_counters counters;
    int gestures;    // raised hands so far
    int takes_ready; // takes that ended so far, whatever came of them
    char text[160];  // the coach's
    bool fault;
    double share;
    enum pose_advice advice;
    struct coverage coverage;
    double distance_m;
    struct take_judgement judgement; // of the last take
    int judged;                      // number of verdicts recomputed so far
    struct studio_room_view room;
    char failure[512]; // of the sensor, or of the last take; "": none
};

// The pictures of another lens's size are there no longer.
void studio_snapshot_calibrate(struct studio_snapshot *snapshot, const struct calibration *calibration);

// Copies one frame's pictures; NULL: there is none.
void studio_snapshot_pictures(struct studio_snapshot *snapshot, const uint8_t *color, const uint16_t *depth,
                              const uint8_t *mask);

// Copies everything, if there is anything new. False: there is not, or no memory; *out is unchanged.
bool studio_snapshot_copy(const struct studio_snapshot *from, struct studio_snapshot *out);

// False: a sensor without a colour camera, or one whose colour camera gives no images any more; depth is all there is.
bool studio_snapshot_sees_color(const struct studio_snapshot *snapshot);

void studio_snapshot_free(struct studio_snapshot *snapshot);

// ---------------------------------------------------------------- session

struct studio_session;

struct studio_session_options {
    const char *sensor;       // URI
    const char *file;         // the recording; is made with the first take, where it does not exist
    const char *tags;         // tags.json for sweeps; NULL: the one beside the file, if there is one
    void (*wake)(void *self); // from the session's threads: there is something new; may be NULL
    void *wake_self;
    bool body_points;
    enum verdict_purpose purpose; // what takes are for, until another one is chosen
};

// ERR_MEMORY. Opens the sensor on its own thread: errors are in the snapshot.
MUST_CHECK enum status studio_session_open(struct studio_session **out, const struct studio_session_options *options);
// Ends a take that is being made, in good order. NULL is fine; sets *s = NULL.
void studio_session_close(struct studio_session **s);

void studio_session_begin(struct studio_session *session, const char *take);
void studio_session_end(struct studio_session *session);
// The take's frames have changed: recomputes its verdict.
void studio_session_judge(struct studio_session *session, const char *take);
void studio_session_choose(struct studio_session *session, enum verdict_purpose purpose);

// While a take pauses its frames are thrown away (recorder.h).
void studio_session_pause(struct studio_session *session, bool pause);

// Sweeps the room from the next frame on, until it is ended or dropped; then snapshot.room has its map, which waits to
// be kept in the file, in place of the place there if the sweep did not add to it, or dropped. One that cannot be kept
// (room.not_kept) waits on.
void studio_session_sweep(struct studio_session *session);
void studio_session_end_sweep(struct studio_session *session, bool drop);
void studio_session_keep_room(struct studio_session *session, bool keep);

// Copies the newest state. False: nothing is new since snapshot's; *out is unchanged.
bool studio_session_read(struct studio_session *session, struct studio_snapshot *out);
