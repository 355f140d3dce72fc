// Body points of a colour image, as the tracker takes them (tracker_set_body_points), found by a pre-trained network.
#pragma once
#include "capture/body/point_evidence.h"
#include "neural/pose_network.h"

// Looks for a person's points in the next image of a film (else call pose_network_restart before); rgb: width x height,
// 3 bytes a pixel. OK: *out says where they are, or that there is no person. NOTHING: the image is too dark to tell,
// and the tracker is to be given none.
MUST_CHECK enum status body_points_of_image(struct pose_network *n, const uint8_t *rgb, int width, int height,
                                            struct body_points *out);
