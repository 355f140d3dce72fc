// The sights of a take's frames for whoever looks at them several times: each is read and sorted once, and what lies
// about the person is kept in memory within a bound. Pure; the take is only read.
#pragma once
#include "reenact/observation/depth_frame.h"

struct depth_frame_cache;

// frames: numbers of the take, count of them, copied. max_bytes: what is kept; what does
// not fit is read anew each time. The take must outlive it. ERR_MEMORY.
MUST_CHECK enum status depth_frame_cache_open(struct depth_frame_cache **out, struct take *take, const int64_t *frames,
                                              int count, size_t max_bytes);
void depth_frame_cache_close(struct depth_frame_cache **s);

// The sight of frames[i] as depth_frame_read makes it; beyond DEPTH_FRAME_MAX_EDGE_PX pixels about the person it may
// have no readings. `into` was opened for the same take and is overwritten. As depth_frame_read. One thread at a time.
MUST_CHECK enum status depth_frame_cache_read(struct depth_frame_cache *s, int i, struct depth_frame *into);
