// Keeps an attempt as a take: while it is made its frames are written into a hidden recording beside the one that is
// watched, on a thread of its own at lower priority; on request that becomes a recording with a name, never over an
// existing file, else it is removed; so is what a killed program left beside the same recording. Frames that come
// faster than they can be written are left out and counted.
//
// Threads: begin, add and end are for the sensor's thread, keep and query for the screen's. Memory: at most
// KEEPER_WAITING frames. Disk: what KEEPER_MAX_S seconds of a take need; later frames are left out.
#pragma once
#include "recording/recording.h"

enum { KEEPER_WAITING = 20, KEEPER_MAX_S = 600 };

struct live_keeper;

struct live_keeper_options {
    const char *watched;       // the recording that is watched; attempts are kept beside it; copied
    const struct place *place; // goes into what is kept; NULL: none. Must outlive the keeper
};
// ERR_MEMORY: *out is then NULL.
MUST_CHECK enum status live_keeper_open(struct live_keeper **out, const struct live_keeper_options *options);
void live_keeper_close(struct live_keeper **k); // NULL is fine; sets *k = NULL; removes what was not kept

// What the sensor's thread hands over. A failure to write is no error there; live_keeper_query tells it.
void live_keeper_begin(struct live_keeper *keeper, const struct calibration *calibration, int attempt);
struct keeper_frame {
    int64_t time_ns;
    bool located;
    struct pose world_from_camera;
    const uint8_t *color; // RGB; NULL: none
    const uint8_t *jpeg;  // the same as the source encoded it; NULL: it did not
    size_t jpeg_bytes;
    const uint16_t *depth;
    const uint8_t *mask;
    const struct skeleton *skeleton; // NULL: no person
};
void live_keeper_add(struct live_keeper *keeper, const struct keeper_frame *frame); // copies
void live_keeper_end(struct live_keeper *keeper);

// Asks for the attempt that was made last to be kept, once it has ended.
void live_keeper_keep(struct live_keeper *keeper);

struct live_keeper_state {
    int64_t written, left_out; // frames of this attempt
    int kept;                  // how many attempts were kept or failed to be, so far
    bool failed;               // the last of them did
    char sentence[300];        // what became of it, or why not
};
struct live_keeper_state live_keeper_query(struct live_keeper *keeper);
