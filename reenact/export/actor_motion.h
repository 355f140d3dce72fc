// The bones of the avatar over a take, as nodes of a scene: each bone's node lies where the bone begins, with the bind
// pose's axes, below the node of the bone it hangs from. Internal to this folder. Pure.
#pragma once
#include "reenact/export/actor_export.h"

extern const char *const bone_names[BONE_COUNT];
int bone_parent(int bone); // -1: the upper torso, which has none

// Where each bone begins, bind-pose axes.
void bone_origins(const struct bind_pose *bind, struct vec3 origin[BONE_COUNT]);

// The bones at a frame, from the bind pose into the world. NOTHING: not known.
MUST_CHECK enum status bones_at_frame(const struct actor_export *a, int64_t frame, struct bone_transforms *out);

// Of each bone, of each known frame: its pose with respect to its parent's node; rotations go on from frame to frame
// without a change of sign.
struct actor_motion {
    int count;
    float *time_s;                       // [count]
    float (*translation[BONE_COUNT])[3]; // [count]
    float (*rotation[BONE_COUNT])[4];    // [count]; x, y, z, w
};
MUST_CHECK enum status actor_motion_make(struct actor_motion *out,
                                         const struct actor_export *a); // ERR_INPUT, ERR_MEMORY
void actor_motion_free(struct actor_motion *m);
