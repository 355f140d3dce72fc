// The actor and the person in one picture: what of the sensor's picture hides the actor, and a figure with the bones
// of one in the pose of the other. Pure.
#pragma once
#include "base/lens.h"
#include "compare/movement.h"
#include "recording/skeleton.h"

// ---------------------------------------------------------------- what hides the actor

// Hides the actor where the sensor sees something nearer: the person's hand before the actor, a table between. The
// picture's pixels there, to be drawn over the actor. Pure.
//
// The actor's depth is that of the limbs' axes; the actor counts as covering COVER_M more than the limbs' radii.

struct live_occlusion {
    const struct calibration *calibration; // of the sensor
    const uint8_t *rgb;                    // of calibration->color's size
    const uint16_t *depth;                 // of calibration->depth's size
    const struct skeleton *actor;          // colour camera's axes
    const struct body *body;               // the actor's radii
    float *scratch;                        // two numbers a colour pixel
};

// Fills rgba (of the colour image's size, premultiplied): the picture where it is nearer than the actor, else 0.
// Returns how many pixels hide the actor.
int live_occlusion_make(const struct live_occlusion *occlusion, uint8_t *rgba);

// ---------------------------------------------------------------- pose figure

// A figure with one person's bones in the pose of another: a movement's directions (compare/movement.h) put on the bone
// lengths of a tracked person. So the next pose is shown as a ghost where the person stands, and two movements side by
// side differ in nothing but the pose. Pure.

// person: world axes, z up; both hips must be known. now: the reference's frame that the person shows now, by which the
// figure is turned: it faces where the person faces plus what the reference turns from `now` to `pose`. The figure
// stands on the person's lower foot, or at the person's waist where no foot is known. Joints of parts that `pose` does
// not know get confidence 0. False: no figure; *out is then untouched.
bool pose_figure_make(const struct skeleton *person, const struct movement_frame *now,
                      const struct movement_frame *pose, struct skeleton *out);
