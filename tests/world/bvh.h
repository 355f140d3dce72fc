// Reads BVH motion files: a hierarchy of joints with offsets and channels, then
// one line of numbers a frame. Axes and units are the file's own (by custom y up
// and centimetres). Internal to tests/world.
#pragma once
#include "base/geometry.h"

struct bvh;

// `name` is for the sentences. ERR_INPUT: not BVH, cut short, a channel or number
// missing, not finite; the sentence gives the line. ERR_MEMORY.
MUST_CHECK enum status bvh_parse(struct bvh **out, const char *name, const uint8_t *bytes, size_t count);
void bvh_free(struct bvh **b); // NULL is fine

int bvh_joint_count(const struct bvh *b); // end sites are no joints
const char *bvh_joint_name(const struct bvh *b, int joint);
int bvh_find(const struct bvh *b, const char *name); // -1: none; letters' case does not matter
int bvh_frame_count(const struct bvh *b);            // >= 1
double bvh_frame_s(const struct bvh *b);             // seconds from frame to frame, > 0

// Where every joint is in frame `frame`; positions[bvh_joint_count].
void bvh_positions(const struct bvh *b, int frame, struct vec3 *positions);
