// Whether a calibration may be believed, and the likely cause where not. Pure.
#pragma once
#include "capture/calibration/stereo_bundle.h"

// The error of one camera of a solved bundle; covariance: as stereo_bundle_solve gives it.
struct stereo_fit stereo_fit_of(const struct stereo_bundle *b, const double *covariance, int camera);

// Its lens explains the camera's pictures.
bool stereo_fit_is_good(const struct stereo_fit *fit);

// ERR_INPUT with a sentence about `whose` ("the left camera's"): its lens does not explain its pictures (fisheye: one
// of these does better), or they do not tell its focal length.
MUST_CHECK enum status stereo_judge_camera(const struct stereo_fit *fit, bool fisheye, const char *whose);

// ERR_INPUT: the cameras do not fit together though each of them, alone, does.
MUST_CHECK enum status stereo_judge_rig(const struct stereo_report *report, const struct stereo_fit alone[2]);

// Fills report->warning with what should be looked at in a rig that is used. name, index: of the first pair that was
// left out; name may be NULL.
void stereo_warn_of_rig(const struct stereo_rig *rig, struct stereo_report *report, const char *name, int index);
