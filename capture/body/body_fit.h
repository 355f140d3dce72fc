// Fits the body model to one depth image: articulated ICP by damped Gauss-Newton over the pose, and over the shape
// while it is still being learned. Every depth point is matched to the nearest surface that the camera can see
// (point-to-plane residuals, as in Chen and Medioni 1992), and samples of the model must lie inside the mask's
// silhouette and not in front of the measured depth (free space).
//
// The energy is dimensionless: the sum of what points, silhouette, joint limits, floor, collisions, motion, joints that
// a network found (joint_evidence.h) and, where there are any, points of the colour image (point_evidence.h) have
// against a pose, each squared and in units of its own variance, halved. It is a negative log-likelihood but for a
// constant, so that differences of energies are log-odds. Points have the robust kernel of Geman and McClure (1985),
// 0.5 w e^2 c^2 / (c^2 + e^2) with c = kernel_m; silhouette samples have the same with c = 25 cm. Gauss-Newton uses its
// weight w (c^2 / (c^2 + e^2))^2 (iteratively reweighted least squares).
//
// Camera axes (x right, y down, z forward), metres and radians. Pure: no allocation, any thread with its own result.
#pragma once
#include "capture/body/body_model.h"
#include "capture/body/depth_evidence.h"
#include "capture/body/joint_evidence.h"
#include "capture/body/point_evidence.h"

enum {
    FIT_POSE_COUNT = 3 + 3 * SEG_COUNT, // root, then each segment's rotation vector in its parent's axes
    FIT_COUNT = FIT_POSE_COUNT + SHAPE_COUNT,
};

// What is known of the shape so far: mean and inverse covariance, of the logarithms of its factors.
struct shape_prior {
    struct body_shape mean;
    double information[SHAPE_COUNT][SHAPE_COUNT];
};
struct shape_prior shape_prior_default(void); // an average adult, with the variance of a population

// The energy of a shape in the population of people, children among them.
double shape_log_odds(const struct body_shape *shape);

struct fit_task {
    const struct depth_evidence *evidence;
    const struct point_evidence *points; // of the colour image; NULL: there is none
    const struct joint_evidence *joints; // that a network found in the depth image; NULL: there is none
    bool have_floor;
    struct vec3 up;
    double floor_m;            // the camera's height over the floor
    struct body_pose expected; // predicted from the motion so far
    double expected_sigma;     // 1: as a body moves between two frames at 30 Hz; large: no prediction
    int iterations;
    int point_stride; // every how many-th point is used; 1: all
    double kernel_m;  // c of the points' robust kernel: farther points hardly pull
    bool pose_only;   // of the result, only pose and shape are needed
    bool learn_shape;
    double learn_rate;        // > 0: weight of this frame against the shape prior; 1 = as its points have
    struct shape_prior shape; // in; with learn_shape its mean is the initial shape
};

// The information matrix of the pose: the sum of w j j' over all evidence and priors, the motion prior included, at the
// last iteration's pose, lower triangle. With the shape learned, for that shape.
struct pose_information {
    double h[FIT_POSE_COUNT][FIT_POSE_COUNT];
};

struct fit_result {
    struct body_pose pose;
    struct body_shape shape;
    struct body_build build;
    double energy;                       // of all terms but the motion prior
    double limb_energy[SEG_COUNT];       // free-space part and collisions, by segment
    float residual[EVIDENCE_POINTS_MAX]; // per point: metres off the nearest surface
    int8_t solid[EVIDENCE_POINTS_MAX];   // per point: the nearest solid
    bool has_information;                // of body_fit; not of body_evaluate, nor after no iteration
    struct pose_information information;
    double shape_information[SHAPE_COUNT][SHAPE_COUNT]; // of this frame alone, with the pose marginalised out
};

// The robust kernel with which poses are compared: wide, so that points that are left unexplained count. Chosen by
// hand.
#define SEARCH_KERNEL_M 0.12

// Results are large; who fits several poses provides the memory. `best` holds this frame's fit.
struct fit_scratch {
    struct fit_result best, trial, other;
};

// Starts from `start`; *out is filled. Never fails: without evidence the pose stays at the predicted one, and where the
// normal equations are not positive definite the iterations end early.
void body_fit(const struct fit_task *task, const struct body_pose *start, struct fit_result *out);

// Energy and residuals of a pose, which is not changed.
void body_evaluate(const struct fit_task *task, const struct body_pose *pose, const struct body_shape *shape,
                   struct fit_result *out);
