// Radii of the body cylinders, measured in the representative frame of a take.
// Method: Dayrit et al. 2014 [D14], section 4.1, equations 2 to 4; the outline lies at the depth of the bone, not of
// the skin before it.
//
// Frames are added one after another while the take is recorded, so that an
// interrupted take has radii, too; at its end they are taken again by the smoothed joints (take_smooth). Pure: no
// clock, no file; one struct per take and thread. Joints in the colour camera's axes; the depth image is either
// registered or has its own lens and color_from_depth.
#pragma once
#include "base/lens.h"
#include "recording/skeleton.h"

struct body_radii {
    struct body body;             // as far as known; radius_rate (radius / length) 0 = not measurable so far
    double best;                  // pose_score of body.representative_frame
    double part_best[PART_COUNT]; // that of the frame from which each part's rate comes
};

void body_radii_start(struct body_radii *radii);

// Adds frame `index`. `depth` and `mask` are of calibration->depth's size.
// True when the body changed. A part that is not measurable in the best frame (hidden,
// cut by the image border) takes its rate from the best frame where it is.
bool body_radii_add_frame(struct body_radii *radii, int64_t index, const struct calibration *calibration,
                          const struct skeleton *skeleton, const uint16_t *depth, const uint8_t *mask);

// The radius of the rectangle fitted to one part, metres; 0 when it cannot be
// measured here. Exposed for tests.
double body_radii_measure_part(const struct calibration *calibration, const struct skeleton *skeleton,
                               const uint16_t *depth, const uint8_t *mask, enum part part);
