// Reads BVH motion files: a hierarchy of joints with offsets and channels, then
// one line of numbers a frame. Axes and units are the file's own (by custom y up
// and centimetres). Pure.
#pragma once
#include "base/geometry.h"

struct bvh;

// `name` is used in messages. ERR_INPUT: not BVH, truncated, a channel or number missing, not finite; the message gives
// the line. ERR_MEMORY.
MUST_CHECK enum status bvh_parse(struct bvh **out, const char *name, const uint8_t *bytes, size_t count);
void bvh_free(struct bvh **b); // NULL is fine

int bvh_joint_count(const struct bvh *b); // end sites are not joints
const char *bvh_joint_name(const struct bvh *b, int joint);
int bvh_find(const struct bvh *b, const char *name); // -1: none; case-insensitive
int bvh_frame_count(const struct bvh *b);            // >= 1
double bvh_frame_s(const struct bvh *b);             // frame interval in seconds, > 0

// Positions of all joints in frame `frame`; positions[bvh_joint_count].
void bvh_positions(const struct bvh *b, int frame, struct vec3 *positions);
