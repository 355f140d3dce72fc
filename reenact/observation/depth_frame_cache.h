// Keeps the labelled depth frames of a take for a caller that reads them several times: each is read and labelled
// once, and a window about the actor is kept in memory, up to a bound. Deterministic; the take is only read. One
// cache, one thread at a time.
#pragma once
#include "reenact/observation/depth_frame.h"

struct depth_frame_cache;

// source: copied; what it points to must outlive the cache. frames: `count` frame numbers of the take, copied.
// max_bytes: bound on what is kept (5 bytes a pixel of each window); frames beyond it are read from the take each
// time. ERR_MEMORY: *out is then NULL.
MUST_CHECK enum status depth_frame_cache_open(struct depth_frame_cache **out, const struct frame_source *source,
                                              const int64_t *frames, int count, size_t max_bytes);
void depth_frame_cache_close(struct depth_frame_cache **s); // NULL is fine; sets *s = NULL

// Gives frames[i] as depth_frame_read labels it; more than DEPTH_FRAME_MAX_EDGE_PX pixels from the actor it may have no
// depth samples. `into` was opened for the same take and is overwritten. rgb: receives the frame's colour image, RGB of
// calibration.color; NULL: not wanted. The frame's row is read at most once. NOTHING: the frame lacks depth or
// skeleton, or colour where it is wanted. ERR_CORRUPT, ERR_IO, ERR_MEMORY.
MUST_CHECK enum status depth_frame_cache_read(struct depth_frame_cache *s, int i, struct depth_frame *into,
                                              uint8_t *rgb);
