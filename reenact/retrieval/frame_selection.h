// Which recorded frame shows the actor, or one part of it, most like it is to be
// seen now. Pure: no clock, file or GPU; the exact best of all frames, the lowest
// index on a tie; the same answer on every machine (only + - * / sqrt decide).
// One thread at a time.
//
// Whole body: equation 5 of the 2014 paper. Skeletons are compared in camera
// axes (the viewer's for the one to be shown, its own for each recorded one)
// with their necks laid on each other:
//     cost_n = 16 / J * sum over the J joints known in both |s_k,i - s_n,i|
// so that unknown joints are left out and the sum stays comparable.
//
// One part: every frame is judged by the side of that part it shows (the
// direction to the camera in the part's own axes), by how the joints around it
// lie about it, by what the body itself hid, and by how sharp it is.
#pragma once
#include "reenact/skeleton/bone_frame.h"

struct frame_selector;

struct frame_selection {
    int64_t frame;
    double cost_m;
};

// Room for `capacity` frames.
MUST_CHECK enum status frame_selector_open(struct frame_selector **out, int64_t capacity);
void frame_selector_close(struct frame_selector **s);

// Adds frame number `frame` (rising) with its skeleton in its camera's axes. Not once it is settled.
// ERR_INPUT: a known joint is not finite; nothing is added.
MUST_CHECK enum status frame_selector_add(struct frame_selector *s, int64_t frame, const struct skeleton *in_camera,
                                          const struct body *body);

// After the last frame of a take, once: parts are found faster from now on, alike. ERR_MEMORY: it can only be closed.
MUST_CHECK enum status frame_selector_pack(struct frame_selector *s);

// Never to be chosen again for this part: its pictures do not show it.
void frame_selector_exclude(struct frame_selector *s, int64_t frame, enum part p);

// in_viewer: the skeleton to be shown, in the viewer camera's axes.
// NOTHING: no frame has a neck and at least half of the skeleton's known joints,
// or in_viewer has no neck. ERR_INPUT: a known joint is not finite.
MUST_CHECK enum status frame_selector_find_body(const struct frame_selector *s, const struct skeleton *in_viewer,
                                                struct frame_selection *out);

// NOTHING: the part is unknown in in_viewer or in every frame. ERR_INPUT as above.
MUST_CHECK enum status frame_selector_find_part(const struct frame_selector *s, const struct skeleton *in_viewer,
                                                enum part p, struct frame_selection *out);

// All of them, in less time than one after the other; frame -1 where frame_selector_find_part has nothing. NOTHING: all
// are so. ERR_INPUT as above.
MUST_CHECK enum status frame_selector_find_parts(const struct frame_selector *s, const struct skeleton *in_viewer,
                                                 struct frame_selection out[PART_COUNT]);
