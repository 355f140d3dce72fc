// Lays a body into one depth picture: damped Gauss-Newton over the pose, and
// over the shape where it is still being learned.
//
// The energy is what the points, the silhouette, the joints' limits, the floor
// and the expectation have against a pose, each in units of its own standard
// deviation: the negative logarithm of a probability, but for a constant.
#pragma once
#include "capture/body/depth_evidence.h"
#include "capture/body/body_model.h"

enum {
    FIT_POSE_COUNT = 3 + 3 * SEG_COUNT, // root, then each segment's turn in its parent's axes
    FIT_COUNT = FIT_POSE_COUNT + SHAPE_COUNT,
};

// What is known of the shape so far: an expectation and how sure it is.
struct shape_prior {
    struct body_shape mean;
    double information[SHAPE_COUNT][SHAPE_COUNT]; // inverse covariance
};
struct shape_prior shape_prior_default(void); // an average adult, give or take

struct fit_task {
    const struct depth_evidence *evidence;
    bool have_floor;
    struct vec3 up;
    double floor_m;            // the camera's height over the floor
    struct body_pose expected; // by the motion so far
    double expected_sigma;     // 1: as a body moves between two frames; large: nothing is expected
    int iterations;
    int point_stride; // of the points, one in so many is looked at; 1: all
    double kernel_m;  // how far a point pulls a surface towards it
    bool rough;       // of the result, only pose and shape are wanted
    bool learn_shape;
    double learn_rate;        // > 0: how much this picture counts beside the belief; 1 = as its points do
    struct shape_prior shape; // in; with learn_shape its mean is the fit's start
};

struct fit_result {
    struct body_pose pose;
    struct body_shape shape;
    struct body_build build;
    double energy;                                      // of all, without the expectation
    double limb_energy[SEG_COUNT];                      // free-space part, by segment
    float residual[EVIDENCE_POINTS_MAX];                // per point: metres off the nearest surface
    int8_t solid[EVIDENCE_POINTS_MAX];                  // per point: the nearest solid
    double shape_information[SHAPE_COUNT][SHAPE_COUNT]; // what this frame alone says of the shape
};

// Starts from `start`; *out is filled. Never fails: without evidence it stays where it is expected.
void body_fit(const struct fit_task *task, const struct body_pose *start, struct fit_result *out);

// The same without moving anything: energy and residuals of a pose.
void body_evaluate(const struct fit_task *task, const struct body_pose *pose, const struct body_shape *shape,
                   struct fit_result *out);

// A point of the evidence and how far off the nearest solid is that is not of the limb in question.
struct limb_point {
    int index;
    double other_distance_m;
};

// What these points and the silhouette have against a limb's solids where `build` has them, nothing else moved.
double body_evaluate_limb(const struct fit_task *task, const struct body_build *build, int first, int count,
                          const struct limb_point *point, int point_count);

// Signed distance of `p` from a solid's surface as a camera at the origin sees
// it: where p is behind the middle, the surface in front counts. *normal points
// out of the surface, *on is the point of the middle, *t in [0, 1] and
// *side_m say where that is on the trapezium.
double solid_distance(const struct body_solid *solid, struct vec3 p, struct vec3 *normal, struct vec3 *on, double *t,
                      double *side_m);
