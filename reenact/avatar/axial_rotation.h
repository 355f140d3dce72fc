// How skull, thighs and shins are turned about their own bones, frame by frame: neither joints nor the depth of
// something round tell, but its colours do. A first pass looks for the frame that shows most of them and has the person
// from the front. A second follows each part from there, to the take's end and to its beginning, and learns its colours
// on the way: of who is seen from behind at first it would learn that there is hair all round. A third tries every turn
// of every frame against these, and what all frames say is weighed together, for a person rotations no faster than
// people do. Where there is nothing to go by, a part stays as it is. Pure; deterministic.
#pragma once
#include "reenact/avatar/articulated_icp.h"

struct axial_rotation;

// Room for so many frames; the surface is in bind_pose, which must outlive it. ERR_MEMORY.
MUST_CHECK enum status axial_rotation_open(struct axial_rotation **out, const struct bind_pose *bind_pose,
                                           const struct surface_mesh *surface, const struct calibration *calibration,
                                           int frames);
void axial_rotation_close(struct axial_rotation **t);

// A frame's colours, the person being in `transforms` (colour camera's axes) but for these rotations.
struct axial_rotation_frame {
    const struct depth_frame *depth_frame;
    const uint8_t *rgb;
    const struct bone_transforms *transforms;
    double time_s;
};
// Different frames may be looked at on different threads.
void axial_rotation_score_seed(struct axial_rotation *t, int i, const struct axial_rotation_frame *frame);
// Once all are looked at: which frame is to be followed after so many others; and that one.
int axial_rotation_order(const struct axial_rotation *t, int nth);
void axial_rotation_track(struct axial_rotation *t, const struct axial_rotation_frame *frame);
// Once all are followed. Different frames may be measured on different threads.
void axial_rotation_measure(struct axial_rotation *t, int i, const struct axial_rotation_frame *frame);

// Once all frames are: rotations what each is adjusted by. time_s: of each frame, rising. ERR_MEMORY.
MUST_CHECK enum status axial_rotation_apply(const struct axial_rotation *t, const double *time_s,
                                            struct bone_corrections *frame_corrections);
