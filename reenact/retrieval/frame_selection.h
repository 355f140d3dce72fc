// Frame selection: which recorded frame's texture fits this instant and viewpoint best, for
// the whole body or one part. Exact (the minimum over all frames, the lowest index on a tie)
// by a scan that leaves out what a bound excludes (pose_index.h); the same answer on every machine (only + - * / sqrt
// decide). Pure; one thread at a time.
//
// Whole body: [D14] eq. 5. Skeletons are compared in camera axes (the viewer's for the one
// to be shown, its own for each recorded one), translated so that their necks coincide:
//     cost_n = 16 / J * sum over the J joints known in both |s_k,i - s_n,i|
// so that unknown joints are left out and the sum stays comparable.
//
// One part, a sum of four costs in metres: difference of the viewing direction in the part's
// axes; mean difference of neighbouring joints in the part's axes; share of the part occluded
// by the body, and uncertainty of its joints; distance from the camera beyond the viewer's.
#pragma once
#include "reenact/skeleton/bind_pose.h"

struct frame_selector;

struct frame_selection {
    int64_t frame;
    double cost_m;
};

// For at most `capacity` frames, about 1.7 KiB of memory each. ERR_MEMORY; *out is then NULL.
MUST_CHECK enum status frame_selector_open(struct frame_selector **out, int64_t capacity);
void frame_selector_close(struct frame_selector **selector);

// Adds frame number `frame` (rising) with its skeleton in its camera's axes. body: for
// occlusion by the body; NULL: none. ERR_INPUT: a known joint is not finite; nothing is added.
MUST_CHECK enum status frame_selector_add(struct frame_selector *selector, int64_t frame,
                                          const struct skeleton *in_camera, const struct body *body);

// Excludes the frame for this part: its image does not show it.
void frame_selector_exclude(struct frame_selector *selector, int64_t frame, enum part part);

// in_viewer: the skeleton to be shown, in the viewer camera's axes.
// NOTHING: no frame has a neck and at least half of the skeleton's known joints,
// or in_viewer has no neck. ERR_INPUT: a known joint is not finite.
MUST_CHECK enum status frame_selector_find_body(const struct frame_selector *selector, const struct skeleton *in_viewer,
                                                struct frame_selection *out);

// NOTHING: the part is unknown in in_viewer or in every frame. ERR_INPUT as above.
MUST_CHECK enum status frame_selector_find_part(const struct frame_selector *selector, const struct skeleton *in_viewer,
                                                enum part p, struct frame_selection *out);

// All parts; frame -1 where frame_selector_find_part answers NOTHING. NOTHING:
// for all parts. ERR_INPUT as above.
MUST_CHECK enum status frame_selector_find_parts(const struct frame_selector *selector,
                                                 const struct skeleton *in_viewer,
                                                 struct frame_selection out[PART_COUNT]);
