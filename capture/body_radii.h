// The body's radii, read from the one frame of a take that shows it best.
// Method: Dayrit et al. 2014, section 4.1, equations 2 to 4.
//
// Frames are offered one after another while the take is filmed, so that an
// interrupted take has a body, too. Pure: no clock, no file; one struct to a
// take and thread. Joints in the colour camera's axes; the depth picture must be
// registered to the colour camera or come with its own lens and motion.
#pragma once
#include "capture/recording/skeleton.h"
#include "base/lens.h"

struct body_radii {
    struct body body;             // as far as known; radius_rate 0 = never measurable so far
    double best;                  // E of body.representative_frame
    double part_best[PART_COUNT]; // E of the frame from which each part's rate comes
};

void body_radii_start(struct body_radii *r);

// Equation 3: how well a pose shows the body. Larger is better. Arms that are
// not known add nothing; the sign of the person's facing is made good.
double body_radii_pose_score(const struct skeleton *skeleton);

// Offers frame `index`. `depth` and `mask` are of calibration->depth's size.
// True when the body changed. A part that the best frame does not show (hidden,
// cut by the picture's edge) takes its rate from the best frame that does.
bool body_radii_add_frame(struct body_radii *r, int64_t index, const struct calibration *calibration,
                          const struct skeleton *skeleton, const uint16_t *depth, const uint8_t *mask);

// The radius of the rectangle fitted to one part, metres; 0 when it cannot be
// measured here. Exposed for tests and for whoever looks at single parts.
double body_radii_measure_part(const struct calibration *calibration, const struct skeleton *skeleton,
                               const uint16_t *depth, const uint8_t *mask, enum part part);
