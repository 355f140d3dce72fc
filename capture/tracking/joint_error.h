// How wrong a tracked joint is likely to be, judged by what else is known of its frame.
//
// The covariance of a fit (joint_covariance.h) supposes that the pose is about right. Whether it is shows elsewhere: in
// the energy that the fit is left with, in how nearly as good its alternatives are, in what the image shows of a limb.
// Two models that are linear in such features weigh them, fitted to the errors of random films
// (tools/calibrate_joint_error). No feature may make a joint surer: all coefficients are at least 0, but those of the
// kinds of joints.
//
//     log_scale       of the factor by which the joint's covariance has to grow for its 95 % ellipsoid to hold
//     wrong_log_odds  that the joint is more than JOINT_WRONG_M off: the log-odds of logistic regression
//
// Pure; the same bits everywhere.
#pragma once
#include "capture/body/body_model.h"

#define JOINT_WRONG_M 0.15

// Each is 0 or more; the more, the worse.
enum joint_feature {
    // of the frame and the body
    FEATURE_ENERGY,      // the fit's, ln of its multiple of what a good fit has
    FEATURE_ENERGY_MEAN, // the same, averaged over half a second
    FEATURE_DENSITY,     // ln of the energy per visible area, likewise
    FEATURE_NO_PERSON,   // how sure the network is of late that it is no person: 0..1
    FEATURE_SHAPE,       // ln of the energy of the body's proportions among people
    FEATURE_POSTURE,     // ln of the energy of its joint limits and of the usual pose
    FEATURE_INTRUSION,   // ln of the energy of all parts in free space and in each other
    FEATURE_UNEXPLAINED, // share of points far from the body
    FEATURE_FLIP,        // the network has the person's left elsewhere, asked without a hint: 0, to 1 on the other side
    FEATURE_BACKWARDS,   // walks backwards: 0..1
    FEATURE_START,       // 1 where the person was just detected or replaced, falling over a second
    FEATURE_SIDEWAYS,    // 1: a shoulder points at the camera
    FEATURE_BENT,        // 0: upright, 1: level
    FEATURE_TURNED,      // 1 where the body was just turned round, falling over a second
    FEATURE_CROPPED,     // by the image's edges: how many, at most 2
    FEATURE_FAR,         // metres beyond 2
    FEATURE_NEAR,        // metres nearer than 2
    FEATURE_SKIRT,       // 0 or 1
    // of the limb
    FEATURE_MISFIT,     // mean squared residual of the points on the limb, 1: all far away
    FEATURE_STARVED,    // share of the limb's surface without points on it
    FEATURE_FREE_SPACE, // ln of the energy of the limb's parts in free space
    FEATURE_RELOCATED,  // 1 where a search has just moved the limb, falling over a second
    FEATURE_PAIR_NEAR,  // 1: left and right are in one place of the image
    // of the joint
    FEATURE_ELSEWHERE, // ln of how far off the network has it
    FEATURE_VAGUE,     // ln of the network's standard deviation
    FEATURE_NOT_SHOWN, // share of the joint's probes that do not show it
    FEATURE_HIDDEN,    // seconds since it was seen, at most 2
    FEATURE_SPEED,     // ln of the speed
    FEATURE_FIT,       // ln of the standard deviation that the fit states
    FEATURE_COUNT
};
const char *joint_feature_name(enum joint_feature feature);

struct joint_features {
    double value[FEATURE_COUNT];
};

struct joint_error {
    float log_scale, wrong_log_odds;
    float log_widening; // log_scale, and a margin by is_seen for people of whom the models know nothing
    bool is_seen;       // shown, and so likely right that it may be called seen
};

// Of the online estimate, and of the backward pass. shown: the frame shows the joint.
struct joint_error joint_error_online(enum joint joint, bool shown, const struct joint_features *features);

// What is known when both passes are.
enum smoothed_feature {
    SMOOTHED_ODDS,         // mean of both passes' wrong_log_odds, over its least
    SMOOTHED_AROUND_ODDS,  // the first, averaged over half a second to both sides
    SMOOTHED_WORSE_ODDS,   // how much the worse pass is above that mean
    SMOOTHED_SCALE,        // mean of both passes' log_scale, over its least
    SMOOTHED_APART,        // ln of the distance between the passes
    SMOOTHED_BODY_APART,   // the same, mean over all joints
    SMOOTHED_OPEN,         // ln of the spread of the choices that the posterior leaves open
    SMOOTHED_MOVED,        // ln of how far the smoothed joint is from both passes
    SMOOTHED_OPPOSITE,     // the passes face opposite ways: 0 or 1
    SMOOTHED_FACING_DOUBT, // twice the probability of the other way
    SMOOTHED_ONE_PASS,     // there is no backward estimate: 0 or 1
    SMOOTHED_NOT_SHOWN,    // neither pass saw it: 0 or 1
    SMOOTHED_COUNT
};
const char *smoothed_feature_name(enum smoothed_feature feature);

struct smoothed_features {
    double value[SMOOTHED_COUNT];
};
struct joint_error joint_error_smoothed(enum joint joint, bool shown, const struct smoothed_features *features);

// The factor by which a joint's covariance grows. A joint that is known (KNOWN_SIGMA_MAX_M) stays so, and one that is
// not keeps its covariance.
double joint_error_factor(const struct joint_error *error, const struct covariance3 *covariance);

// ln(1 + x / unit): grows about as x up to the unit, slowly beyond.
double feature_log(double x, double unit);
