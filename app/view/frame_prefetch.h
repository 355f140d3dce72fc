// Loads the frames of a take that will be shown soon (reenact/frame/frame_layer.h) beside the
// drawing, on a thread and with a handle on the recording of its own.
#pragma once
#include "reenact/frame/frame_layer.h"

enum { AHEAD_MOST = 6 };              // frames that are ready at a time
#define AHEAD_BYTES ((size_t)8 << 20) // as loaded_frame_bytes has it; beyond that none is begun

struct ahead;

struct ahead_options {
    const char *path, *take;         // copied
    const struct likeness *likeness; // must outlive it, and nobody may change it
};
MUST_CHECK enum status ahead_start(struct ahead **out, const struct ahead_options *options); // ERR_MEMORY
// Waits for the frame that is being loaded, a small part of a second. NULL is fine.
void ahead_close(struct ahead **a);

// Which frames will be shown, the first one first, at most AHEAD_MOST. What is ready and not among them is thrown away.
void ahead_want(struct ahead *a, const int64_t *frames, int count);

// How long it takes to load one, as it was with the last; 0: none was loaded yet.
int64_t ahead_takes_ns(struct ahead *a);

bool ahead_has(struct ahead *a, int64_t frame); // it is ready

// True: the frame is the caller's (loaded_frame_free). Where it is just being loaded, waits for that. False: nobody
// loads it, or it cannot be loaded.
bool ahead_take(struct ahead *a, int64_t frame, struct loaded_frame *out);
bool ahead_take_any(struct ahead *a, struct loaded_frame *out); // one that is ready
