// Axial rotation of skull, thighs and shins: their rotation about their own axes, frame by frame. Neither joints nor
// the depth of something round tell it; its colours do.
// 1. Seed: the frame in which the leading bone (the skull, if known) faces the sensor and shows most texture.
// 2. Track: from the seed to the take's end, then from the seed to its beginning, each bone is followed by a
//    histogram filter over 25 angles, and its colours are learned on the way. (From a frame in which the person is seen
//    from behind it would learn that there is hair all round.)
// 3. Measure: 25 angles of every frame are compared with the learned colours and with depth; forward-backward smoothing
//    (Rabiner 1989) of all frames, with a Gaussian motion model, gives each frame's expected angle.
// A bone of which too little is seen keeps the angle that joints and depth gave it.
//
// Angles: radians, right-handed about the bone frame's z axis. Costs: without unit, 0 to 1.5. Deterministic.
// Memory: 1.6 KiB a frame and 0.6 MiB.
#pragma once
#include "reenact/avatar/articulated_icp.h"

struct axial_rotation;

// For a number of frames. The surface is in the bind pose; bind_pose must outlive *out. ERR_MEMORY; *out is then NULL.
MUST_CHECK enum status axial_rotation_open(struct axial_rotation **out, const struct bind_pose *bind_pose,
                                           const struct surface_mesh *surface, const struct calibration *calibration,
                                           int frames);
void axial_rotation_close(struct axial_rotation **rotation); // accepts NULL in *rotation

// A frame, with the bones' transforms (colour camera's axes) as they are without these rotations.
struct axial_rotation_frame {
    const struct depth_frame *depth_frame;
    const uint8_t *rgb;
    const struct bone_transforms *transforms;
    double time_s;
};

// Step 1, for each frame i. Different frames may be scored on different threads.
void axial_rotation_score_seed(struct axial_rotation *rotation, int i, const struct axial_rotation_frame *frame);

// Step 2, once all are scored, on one thread: the frame that is to be tracked as number nth, counted from 0; and that.
int axial_rotation_order(const struct axial_rotation *rotation, int nth);
void axial_rotation_track(struct axial_rotation *rotation, const struct axial_rotation_frame *frame);

// Step 3, once all are tracked, for each frame i. Different frames may be measured on different threads.
void axial_rotation_measure(struct axial_rotation *rotation, int i, const struct axial_rotation_frame *frame);

// Once all are measured: rotates the corrections of each frame. time_s: of each frame, increasing. ERR_MEMORY; the
// corrections are unchanged then.
MUST_CHECK enum status axial_rotation_apply(const struct axial_rotation *rotation, const double *time_s,
                                            struct bone_corrections *frame_corrections);
