// Tracks one person's 16 joints through depth images, and with points of the body that were found in colour images
// where the caller has some (body/point_evidence.h): they tell front from back, left from right and a person from
// furniture, all of which depth shows badly. Without them everything works from depth alone.
//
// Method: articulated ICP, started by a network. The pose is predicted at constant velocity; the person is segmented
// near the predicted body; a network finds the joints in the image, without memory (body/body_network.h); the body
// model is fitted to the depth points, the silhouette and these joints by damped Gauss-Newton with a robust kernel
// (body_fit.h). Where the network has a limb or the body elsewhere, that is tried and adopted if it is likelier; which
// way the person faces is decided over several frames. Proportions are learned over the first seconds and then kept. An
// adaptive filter (pose_filter.h) smooths the result. Works from the first frame on, in any posture: standing, sitting,
// kneeling, lying; facing the sensor at the start unless the image says otherwise.
//
// The output of a frame depends on this and earlier frames only (online estimate). The same frames give the same
// skeletons. The sensor must stand still; a moved sensor is noticed by its background and costs some frames. Any frame
// rate works, but counts of frames and the motion prior's standard deviations are chosen for 30 Hz: how many frames
// decide (tracker_internal.h, tracker_decide.c, body_prior.c), and static object rejection (0.8 s).
//
// Frames: skeletons in the colour camera's axes, the floor in the depth camera's; metres. One handle, one thread. About
// 4 MB and two bytes a depth pixel, all but a small list of components allocated by tracker_open.
#pragma once
#include "base/lens.h"
#include "capture/tracking/joint_covariance.h"
#include "capture/tracking/joint_error.h"

struct body_points;

struct tracker;

struct tracker_options {
    int points;        // of the person, a frame. More is steadier and slower. 100..1600, default 600
    int iterations;    // of Gauss-Newton a frame, 1..30. Default 5
    double learn_s;    // how long proportions are learned, from the first frame. Default 10
    double patience_s; // how long a lost person is expected back in the same place. Default 0.7
};
struct tracker_options tracker_default_options(void);

// Copies what it needs. options NULL: the defaults. ERR_INPUT: a missing or invalid depth lens, options out of range.
// ERR_MEMORY. On error *out is NULL.
MUST_CHECK enum status tracker_open(struct tracker **out, const struct calibration *calibration,
                                    const struct tracker_options *options);
void tracker_close(struct tracker **tracker); // NULL is fine; sets *tracker = NULL

// The empty room's depth from where the sensor stands, one value a depth pixel, 0 = unknown; copied. NULL: unknown
// everywhere again.
void tracker_set_background(struct tracker *tracker, const uint16_t *depth);
// The floor in depth camera axes: a point p is up.p + height_m over it. Estimated from the images where not set.
void tracker_set_floor(struct tracker *tracker, struct vec3 up, double height_m);

// The floor as set or found, depth camera's axes. False: not found yet; *up is then straight up in the image.
bool tracker_floor(const struct tracker *tracker, struct vec3 *up, double *height_m);
// The next tracker_next also looks whether the segmentation shows a second person in the frame, which takes about as
// long as segmenting does; tracker_sees_second_person then tells, until it is asked to look again.
void tracker_look_for_second_person(struct tracker *tracker);
bool tracker_sees_second_person(const struct tracker *tracker);

// Forgets the person and the learned background; keeps what was set.
void tracker_reset(struct tracker *tracker);

// The points that were found in the next frame's colour image (body/point_evidence.h); copied, and used by the next
// tracker_next only. Frames without points are as if there were no colour. NULL takes back what was set. The
// calibration's colour lens must be known.
void tracker_set_body_points(struct tracker *tracker, const struct body_points *points);

// One frame. time_ns: rising; if it does not rise, the motion is estimated from scratch.
// depth: of the calibration's depth lens. mask: one byte a depth pixel, 255 = the person; may be NULL.
// OK       *out (colour camera's axes, metres) and mask are filled; covariances as in joint_covariance.h
// NOTHING  no person is visible; *out has confidence 0 everywhere, mask is all 0
// ERR_MEMORY  as NOTHING; the person stays followed and the next frame may come
MUST_CHECK enum status tracker_next(struct tracker *t, int64_t time_ns, const uint16_t *depth, struct skeleton *out,
                                    uint8_t *mask);

// What the covariances of the last skeleton consist of, depth camera's axes: JOINT_COUNT entries, valid until the next
// tracker_next.
const struct joint_uncertainty_terms *tracker_uncertainty_terms(const struct tracker *tracker);

// Where the network found the joints in the last frame, by that image alone (body/body_network.h): colour camera's
// axes, metres; confidence as the network's standard deviation has it.
struct skeleton tracker_found_joints(const struct tracker *tracker);

// By what the last skeleton's errors were judged, and the judgement (joint_error.h): JOINT_COUNT entries each.
const struct joint_features *tracker_joint_features(const struct tracker *tracker);
const struct joint_error *tracker_joint_errors(const struct tracker *tracker);
bool tracker_shows_joint(const struct tracker *tracker, enum joint joint); // the last frame does

// Processor time that the last tracker_next took on its thread, by step, ns.
struct tracker_times {
    int64_t segment, evidence, fit, search; // search: alternatives of limbs and facing, and initialisation
};
struct tracker_times tracker_last_times(const struct tracker *tracker);
