// Direct photometric evidence of a robot's pose: the points of a capture's depth have in its own picture the colour
// that they have in earlier pictures (as in Engel et al. 2018, direct sparse odometry: brightness residuals of points
// of known depth, here of the depth cameras). A picture's pixel is finer than a depth camera's noise, so that poses
// drift less than by planes alone. Pure but for memory; one thread at a time.
#pragma once
#include "surround/alignment/depth_alignment.h"
#include "surround/picture/surround_picture.h"

enum { PHOTO_REFERENCES = 8 };

// A picture's brightness, smoothed by 3 x 3 pixels.
struct photo_reference {
    struct surround_picture shape; // without pixels of its own: size, lens, place
    uint16_t *gray;                // sixteenths
};

struct photo_point {
    float body[3]; // metres, the body's axes
    float gray;    // in the capture's own picture
};

struct photo_refinement {
    struct pose body_from_picture;                       // set by the caller
    struct photo_reference references[PHOTO_REFERENCES]; // of earlier captures, newest first
    struct photo_reference next;                         // of the capture in hand
    struct photo_point *points;
    int reference_count, point_count;
};

void photo_refinement_free(struct photo_refinement *r); // what was zeroed, too

// depth_alignment_add, with the picture's evidence beside the planes'. The same statuses.
MUST_CHECK enum status photo_alignment_add(struct photo_refinement *r, struct depth_alignment *alignment,
                                           const struct surround_picture *picture, const struct depth_points *points,
                                           struct pose odometry, struct pose *world_from_body);
