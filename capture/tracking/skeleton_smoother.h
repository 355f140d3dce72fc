// Smooths a take's skeletons once its end is known.
//
// The tracker's online estimate knows nothing of later frames. When a take has ended, the tracker follows the person
// backward from the end, with the proportions learned by then. Where the forward and the backward estimate of a limb
// differ, the posterior probability of each is computed over all frames by the forward-backward algorithm on a hidden
// Markov model (Rabiner 1989): the states are the estimates of a left and a right limb together, emissions are the
// log-odds of pose_likelihood.h, transitions cost the distance that a limb would jump. The result is the posterior
// mean: the midpoint where both agree, so that it lags neither way, and the least wrong point where no frame decides,
// as behind the back. A leg that the other one occludes has a third estimate (occluded_shin.h). The direction that the
// person faces is decided in the same way, walking ahead being likelier.
//
// Remaining jitter is averaged over half a second to both sides, as far as the joint lies on a straight line in time:
// straight motion is not held back and a turning point is not clipped. Then speeds are bounded, bone lengths restored,
// and feet that stand on the floor kept where they stand.
//
// Frames in which the forward pass found no person stay without one. Pure: no file, no clock; one take, one thread.
// Memory: 3968 bytes a frame, and 256 for each with points of its colour image, in arrays that double when full: an
// hour at 30 Hz uses 422 MB of 512 MB allocated, with points of every third image 431 of 528 MB. smoother_solve takes
// another 120 bytes a frame while it runs.
#pragma once
#include "capture/tracking/tracker.h"

struct smoother;

// Copies the calibration. ERR_MEMORY: *out is NULL.
MUST_CHECK enum status smoother_open(struct smoother **out, const struct calibration *calibration);
void smoother_close(struct smoother **smoother); // NULL is fine; sets *smoother = NULL

// From now on smoother_push fails with ERR_MEMORY rather than keep more than this for frames. 0, the default: no limit.
void smoother_limit_memory(struct smoother *smoother, size_t bytes_max);

// After each frame of the take: the online estimate, NULL where there is no person or no depth. Where what was followed
// turns out to be a static object, the frames before are withdrawn. time_ns must rise. ERR_MEMORY: the frame is not
// added and the smoother is as it was. Frames pushed later would get wrong indices: the take must be smoothed up to
// here only, or not at all.
MUST_CHECK enum status smoother_push(struct smoother *s, const struct tracker *t, int64_t time_ns,
                                     const struct skeleton *online);

// The points of a pushed frame's colour image, for the backward pass; replaces those that it was tracked with, which
// smoother_push has kept. For results that came too late for the online estimate. ERR_MEMORY: the frame is without.
MUST_CHECK enum status smoother_set_points(struct smoother *s, int64_t index, const struct body_points *points);

// After the last push: every frame that has depth, from the last to the first, with the same tracker. ERR_MEMORY: the
// frame has no backward estimate; the next one may come.
MUST_CHECK enum status smoother_backward(struct smoother *s, struct tracker *t, int64_t index, const uint16_t *depth);

// Decides and smooths. Frames without a backward estimate keep the forward one. ERR_MEMORY: nothing was smoothed, and
// smoother_skeleton must not be called; smoother_solve may be.
MUST_CHECK enum status smoother_solve(struct smoother *s);

// Frame `index` after smoother_solve, colour camera's axes; NULL: no person. Valid until smoother_close. Confidence:
// 1 where a pass was shown the joint and both together make it likely right (joint_error.h), else as far as the
// covariance allows (confidence_of). The covariance is that of both estimates, widened by half their squared
// disagreement, by the spread of the choices that the posterior leaves open (joint_covariance.h), and by the scale of
// joint_error.h.
const struct skeleton *smoother_skeleton(const struct smoother *smoother, int64_t index);

// By what the frame's errors were judged (joint_error.h); of a frame with a person, after smoother_solve.
// widening: the factors by which the covariances grew because of them.
void smoother_joint_features(const struct smoother *smoother, int64_t index, struct smoothed_features out[JOINT_COUNT],
                             float widening[JOINT_COUNT]);
