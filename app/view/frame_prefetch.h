// Loads the frames of a take that will be shown soon (reenact/frame/frame_layer.h) beside the
// drawing, on a thread and with a handle on the recording of its own.
#pragma once
#include "reenact/frame/frame_layer.h"

enum { PREFETCH_MAX = 6 };               // frames that are ready at a time
#define PREFETCH_BYTES ((size_t)8 << 20) // as frame_layer_bytes has it; beyond that none is begun

struct frame_prefetch;

struct frame_prefetch_options {
    const char *path, *take;     // copied
    const struct avatar *avatar; // must outlive it, and nobody may change it
};
MUST_CHECK enum status prefetch_start(struct frame_prefetch **out,
                                      const struct frame_prefetch_options *options); // ERR_MEMORY
// Waits for the frame that is being loaded, a small part of a second. NULL is fine.
void prefetch_close(struct frame_prefetch **a);

// Which frames will be shown, the first one first, at most PREFETCH_MAX. What is ready and not among them is thrown
// away.
void prefetch_request(struct frame_prefetch *a, const int64_t *frames, int count);

// How long it takes to load one, as it was with the last; 0: none was loaded yet.
int64_t prefetch_load_ns(struct frame_prefetch *a);

bool prefetch_has(struct frame_prefetch *a, int64_t frame); // it is ready

// True: the frame is the caller's (frame_layer_free). Where it is just being loaded, waits for that. False: nobody
// loads it, or it cannot be loaded.
bool prefetch_take(struct frame_prefetch *a, int64_t frame, struct frame_layer *out);
bool prefetch_take_any(struct frame_prefetch *a, struct frame_layer *out); // one that is ready
