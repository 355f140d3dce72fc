// The sights of a take's frames for whoever looks at them several times: each is read and sorted once, and what lies
// about the person is kept in memory within a bound. Pure; the take is only read.
#pragma once
#include "reenact/observation/depth_frame.h"

struct sights;

// frames: numbers of the take, count of them, copied. max_bytes: what is kept; what does
// not fit is read anew each time. The take must outlive it. ERR_MEMORY.
MUST_CHECK enum status sights_open(struct sights **out, struct take *take, const int64_t *frames, int count,
                                   size_t max_bytes);
void sights_close(struct sights **s);

// The sight of frames[i] as sight_read makes it; beyond SIGHT_EDGE_MOST pixels about the person it may
// have no readings. `into` was opened for the same take and is overwritten. As sight_read. One thread at a time.
MUST_CHECK enum status sights_read(struct sights *s, int i, struct sight *into);
