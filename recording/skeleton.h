// The body's 16 joints (NiTE's 15 and the waist) and 11 parts, as capture and reenact name them. Left is the person's
// own left. Pure.
#pragma once
#include "base/linear_algebra.h"

enum joint {
    JOINT_HEAD,
    JOINT_NECK,
    JOINT_LEFT_SHOULDER,
    JOINT_LEFT_ELBOW,
    JOINT_LEFT_HAND,
    JOINT_RIGHT_SHOULDER,
    JOINT_RIGHT_ELBOW,
    JOINT_RIGHT_HAND,
    JOINT_TORSO,
    JOINT_WAIST,
    JOINT_LEFT_HIP,
    JOINT_LEFT_KNEE,
    JOINT_LEFT_FOOT,
    JOINT_RIGHT_HIP,
    JOINT_RIGHT_KNEE,
    JOINT_RIGHT_FOOT,
    JOINT_COUNT
};

enum part {
    PART_HEAD,        // neck to head
    PART_UPPER_TORSO, // neck to torso
    PART_LOWER_TORSO, // torso to waist
    PART_LEFT_UPPER_ARM,
    PART_LEFT_FOREARM,
    PART_RIGHT_UPPER_ARM,
    PART_RIGHT_FOREARM,
    PART_LEFT_THIGH,
    PART_LEFT_SHIN,
    PART_RIGHT_THIGH,
    PART_RIGHT_SHIN,
    PART_COUNT
};

// Joint positions at one instant, metres. The axes are stated where a skeleton is used; in a recording they are the
// colour camera's at that instant.
//
// covariance: of the position's error, in the same axes, as a Cholesky factor (base/linear_algebra.h); all 0: not
// known, as in recordings that were made before covariances were kept. Read and write it with the functions below.
//
// confidence: 1 seen, 0.5 inferred (hidden, moved with the body), 0 unknown: the position is then meaningless and must
// not be used. The tracker decides it from the covariance (confidence_of), and calls seen only what is likely right
// (capture/tracking/joint_error.h).
struct skeleton {
    struct vec3 joint[JOINT_COUNT];
    float confidence[JOINT_COUNT];
    struct covariance_root covariance[JOINT_COUNT];
};

struct covariance3 joint_covariance(const struct skeleton *skeleton, enum joint joint); // m^2; all 0: not known
void joint_set_covariance(struct skeleton *skeleton, enum joint joint, const struct covariance3 *m2);
// The standard deviation per axis: the root of a third of the covariance's trace. NaN: not known.
double joint_sigma_m(const struct skeleton *skeleton, enum joint joint);

bool skeleton_is_in_range(const struct skeleton *skeleton); // all confidences are in [0, 1]; NaN is not

// The confidence of a joint with this standard deviation per axis that the frame shows, or does not: 1 where it shows
// it to SEEN_SIGMA_MAX_M, 0 beyond KNOWN_SIGMA_MAX_M, else 0.5. NaN, not known: 1 or 0.5.
#define SEEN_SIGMA_MAX_M  0.08 // chosen by hand
#define KNOWN_SIGMA_MAX_M 0.30 // chosen by hand: about the length of a forearm
float confidence_of(double sigma_m, bool observed);

// The direction from the feet to the neck of a person whose legs and trunk are straight and together, unit. False: this
// one's are not.
bool skeleton_standing_axis(const struct skeleton *skeleton, struct vec3 *axis);

// A part runs from joint `from` to joint `to`; its cylinder's radius is radius_rate times their distance ([D14] 4.1).
struct part_ends {
    enum joint from, to;
};
extern const struct part_ends part_ends[PART_COUNT];

const char *joint_name(enum joint joint); // "left_elbow"
bool joint_from_name(const char *name, enum joint *out);

// What is constant over a take.
struct body {
    int64_t representative_frame;   // index of the frame in which the radii were measured; -1: none yet
    double radius_rate[PART_COUNT]; // radius / length; 0: never measured, the part is not drawn
};

// True: both joints of the part are known and its radius was measured.
bool part_is_known(const struct body *body, const struct skeleton *skeleton, enum part part);

// Positions and covariances, in the axes of a.
struct skeleton skeleton_transform(struct pose a_from_b, const struct skeleton *in_b);
