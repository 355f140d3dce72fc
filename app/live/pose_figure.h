// A figure with one person's bones in the pose of another: a movement's directions (compare/movement.h) put on the bone
// lengths of a tracked person. So the next pose is shown as a ghost where the person stands, and two movements side by
// side differ in nothing but the pose. Pure.
#pragma once
#include "compare/movement.h"

// person: world axes, z up; both hips must be known. now: the reference's frame that the person shows now, by which the
// figure is turned: it faces where the person faces plus what the reference turns from `now` to `pose`. The figure
// stands on the person's lower foot, or at the person's waist where no foot is known. Joints of parts that `pose` does
// not know get confidence 0. False: no figure; *out is then untouched.
bool pose_figure_make(const struct skeleton *person, const struct movement_frame *now,
                      const struct movement_frame *pose, struct skeleton *out);
