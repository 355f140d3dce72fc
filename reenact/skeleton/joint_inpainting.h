// What is thought of a limb that was lost for a moment. Pure.
#pragma once
#include "reenact/skeleton/bind_pose.h"

// A joint is carried no longer than this from where it was known.
#define INPAINT_MAX_GAP_NS 2000000000

// The frame's joints, in its colour camera's axes. One that is unknown there, though the bone to
// it was known shortly before or after, goes with the trunk as that bone did, between the two where
// both are known; its confidence is then 0.5. The frame has a skeleton.
struct skeleton inpaint_skeleton(const struct take *take, int64_t frame);

// The posture that these joints give: bone_transforms_of.
MUST_CHECK enum status inpaint_bone_transforms(const struct bind_pose *bind, const struct take *take, int64_t frame,
                                               struct bone_transforms *out);
