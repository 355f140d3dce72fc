// What the smoother keeps of each frame: skeleton_smoother.c fills and smooths it, smoother_choice.c chooses between
// estimates, smoother_contact.c keeps feet that stand, smoother_confidence.c judges the result.
#pragma once
#include "capture/tracking/pose_likelihood.h"
#include "capture/tracking/skeleton_smoother.h"

// The forward and the backward pass, and for a mostly occluded leg, where the silhouette has it in that frame.
enum estimate { FORWARD, BACKWARD, ALTERNATIVE, ESTIMATES };

struct smoother_frame {
    int64_t time_ns;
    int person;                          // number of the detection; -1: none
    int points;                          // which of the smoother's; -1: none
    struct body_pose pose;               // forward, online estimate
    struct skeleton estimate[ESTIMATES]; // depth camera's axes; covariances without joint_error.h's scale
    struct joint_error error[BACKWARD + 1][JOINT_COUNT];
    bool shown[BACKWARD + 1][JOINT_COUNT];
    struct pose_log_odds odds;           // against the forward estimate
    double alternative_odds[LIMB_COUNT]; // log-odds for ALTERNATIVE against BACKWARD; 0: there is none
    enum estimate facing;                // where FORWARD and BACKWARD face opposite ways, the right one
    bool has_backward;
    double facing_doubt;            // the probability of the other one
    float around_odds[JOINT_COUNT]; // mean of the log-odds of being wrong, over half a second to both sides
    float open_m[JOINT_COUNT];      // spread of the choices that the posterior leaves open
    float widening[JOINT_COUNT];    // factor by which the covariance grew in the end
    float moved_m[JOINT_COUNT];     // from the nearest point between the two passes
    struct skeleton result;         // in the end in the colour camera's axes
};

// ------------------------------------------------------------- smoother_choice.c

enum { TRUNK = LIMB_COUNT };             // beside the limbs: which way the person faces
enum { STATES = ESTIMATES * ESTIMATES }; // choices of estimates for a left and a right limb

static inline uint8_t state_of(enum estimate left, enum estimate right) { return (uint8_t)(left * ESTIMATES + right); }
static inline enum estimate left_estimate(int state) { return (enum estimate)(state / ESTIMATES); }
static inline enum estimate right_estimate(int state) { return (enum estimate)(state % ESTIMATES); }

// How far a limb, or the roots of all limbs (TRUNK), is apart: the largest distance of its joints.
double smoother_limb_distance(const struct skeleton *a, const struct skeleton *b, int k);

// The trunks of the passes are so far apart that they face opposite ways.
bool smoother_facing_differs(const struct smoother_frame *frame);

// The posterior probability of each choice in each of `count` frames over all sequences of choices (forward-backward
// algorithm, Rabiner 1989, in log-odds). Legs may be exchanged in one of the passes, so that the states are pairs.
void smoother_find_posterior(const struct smoother_frame *frame, int64_t count, int first, double (*posterior)[STATES]);

// ------------------------------------------------------------- smoother_confidence.c

// Of one frame, after smoother_decide_confidence.
void smoother_find_features(const struct smoother_frame *frame, struct smoothed_features out[JOINT_COUNT]);

// Widens the covariances by what is known now, and decides what is seen, in `count` frames of one motion.
void smoother_decide_confidence(struct smoother_frame *frame, int64_t count);

// ------------------------------------------------------------- smoother_contact.c

struct smoother_floor {
    bool known;
    struct vec3 up; // depth camera's axes; height of p over the floor: up.p + height_m
    double height_m;
};

// Puts feet that stand where they stand in the mean, in `count` frames of one motion; knees follow, bones keep their
// lengths. path, offset: scratch of `count`.
void smoother_keep_contacts(struct smoother_frame *frame, int64_t count, const struct smoother_floor *floor,
                            struct vec3 *path, struct vec3 *offset);
