// Where the sensor is while it sweeps a room, to the accuracy of a plan: for coaching alone. The map itself is made by
// mapper_finish from all images together; nothing here goes into it.
//
// Frame by frame: the pose is refined by the tags and landmarks placed so far (landmark_matching.h), else relocalised;
// every step away from the last keyframe new landmarks and tags are added. Landmarks come from depth; without depth
// tags alone count. Errors add up to some centimetres in a room.
#pragma once
#include "capture/mapping/map_internal.h"
#include "capture/mapping/sweep_plan.h"

struct sweep_tracker;

// `map`: the mapper's, with its tags and what a prior place has; borrowed, and only its tags and frames are read later.
// ERR_MEMORY.
MUST_CHECK enum status sweep_tracker_open(struct sweep_tracker **out, const struct map *map);
void sweep_tracker_close(struct sweep_tracker **tracker); // NULL is fine

// The next image of the sweep, and its depth or NULL. Copies what it needs; out of memory the image is left out.
void sweep_tracker_add(struct sweep_tracker *tracker, const struct map_frame *observed, const uint16_t *depth);

// The plan, with the hint for the frame before and what the mapper has seen. Valid until the next call.
const struct sweep_plan *sweep_tracker_plan(struct sweep_tracker *tracker, const struct mapper_progress *progress);
