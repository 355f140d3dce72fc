// How skull, thighs and shins are turned about their own bones, frame by frame: neither joints nor the depth of
// something round tell, but its colours do. A first pass looks for the frame that shows most of them and has the person
// from the front. A second follows each part from there, to the take's end and to its beginning, and learns its colours
// on the way: of who is seen from behind at first it would learn that there is hair all round. A third tries every turn
// of every frame against these, and what all frames say is weighed together, for a person turns no faster than people
// do. Where there is nothing to go by, a part stays as it is. Pure; deterministic.
#pragma once
#include "reenact/avatar/articulated_icp.h"

struct turns;

// Room for so many frames; the surface is in rest, which must outlive it. ERR_MEMORY.
MUST_CHECK enum status turns_open(struct turns **out, const struct rest *rest, const struct surface *surface,
                                  const struct calibration *calibration, int frames);
void turns_close(struct turns **t);

// A frame's colours, the person being in `posture` (colour camera's axes) but for these turns.
struct turns_frame {
    const struct sight *sight;
    const uint8_t *rgb;
    const struct posture *posture;
    double time_s;
};
// Different frames may be looked at on different threads.
void turns_look(struct turns *t, int i, const struct turns_frame *frame);
// Once all are looked at: which frame is to be followed after so many others; and that one.
int turns_order(const struct turns *t, int nth);
void turns_follow(struct turns *t, const struct turns_frame *frame);
// Once all are followed. Different frames may be measured on different threads.
void turns_measure(struct turns *t, int i, const struct turns_frame *frame);

// Once all frames are: turns what each is adjusted by. time_s: of each frame, rising. ERR_MEMORY.
MUST_CHECK enum status turns_apply(const struct turns *t, const double *time_s, struct adjustment *adjustments);
