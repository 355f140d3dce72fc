// Prints motion as BVH (Biovision hierarchy), the motion format of animation programs: bones with offsets and, for each
// frame, the root's position, every bone's rotation and, of bones that move in their parent's axes, their position. y
// up; metres come out as centimetres, as is usual. Errors are found in ferror(out).
#pragma once
#include "base/geometry.h"

#include <stdio.h>

enum { BVH_ROOT = -1 }; // a parent

// Parents stand before their children, and the children of one after it before its next sibling: depth first.
struct bvh_bone {
    const char *name;
    int parent;         // its index; BVH_ROOT of the first one
    struct vec3 offset; // from the parent, metres
    bool has_positions; // the root has them in any case
    struct vec3 end;    // where one without children ends, in its axes, metres
};

void bvh_print_hierarchy(const struct bvh_bone *bones, int count, FILE *out);
void bvh_print_motion(int64_t frames, double frame_s, FILE *out); // the lines before the first frame

// One bone of a frame; after the last one the caller ends the line. at: its position, metres, where it has positions;
// local: its rotation in its parent's axes, as Euler angles about z, then x, then y.
void bvh_print_bone(const struct bvh_bone *bone, struct vec3 at, struct quat local, FILE *out);
