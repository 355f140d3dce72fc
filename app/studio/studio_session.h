// The studio's sensor: one thread that reads it, follows the person for the preview, records takes, with the coach
// beside it, and sweeps the room. The window's thread asks for these and reads snapshots; neither waits for the other's
// work.
//
// Without a take nothing is written. A source that ends (a film in a folder) is opened again, at its own pace, so that
// the studio can be tried and tested without a sensor.
#pragma once
#include "app/studio/studio_snapshot.h"
#include "recording/recording.h"

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
