// Loads frame layers (reenact/frame/frame_layer.h) that will be shown soon, on a thread of its own with its own handle
// on the recording, at lowered priority. All functions but start and close may be called from any one thread; none
// waits for a load but prefetch_take and prefetch_close.
#pragma once
#include "reenact/frame/frame_layer.h"

enum { PREFETCH_MAX = 6 };               // layers that are ready at a time
#define PREFETCH_BYTES ((size_t)8 << 20) // of ready layers, by frame_layer_bytes; beyond it no load begins

struct frame_prefetch;

struct frame_prefetch_options {
    const char *path;                       // of the recording, copied
    const struct take *take;                // its index is shared; borrowed, must outlive the prefetch
    const struct take_skeletons *skeletons; // of that take; likewise
    const struct avatar *avatar;            // likewise, and must not change
};
// ERR_MEMORY: *out is then NULL. If the recording cannot be opened again, no frame becomes ready.
MUST_CHECK enum status prefetch_start(struct frame_prefetch **out, const struct frame_prefetch_options *options);
// Waits for the frame that is being loaded, a small part of a second. NULL is fine; sets *a = NULL.
void prefetch_close(struct frame_prefetch **a);

// Sets which frames will be shown, in this order, at most PREFETCH_MAX. Ready layers of other frames are freed.
void prefetch_request(struct frame_prefetch *prefetch, const int64_t *frames, int count);

// Duration of the last load; 0: there was none yet.
int64_t prefetch_load_ns(struct frame_prefetch *prefetch);

bool prefetch_has(struct frame_prefetch *prefetch, int64_t frame); // it is ready

// True: *out is the frame's layer and the caller's (frame_layer_free). If it is being loaded, waits for that. False: it
// is neither ready nor being loaded, or it could not be loaded; *out is unchanged.
bool prefetch_take(struct frame_prefetch *prefetch, int64_t frame, struct frame_layer *out);
bool prefetch_take_any(struct frame_prefetch *prefetch, struct frame_layer *out); // any ready layer; does not wait
