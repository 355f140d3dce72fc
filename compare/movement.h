// One movement, ready to be compared: the directions of the body's eleven parts at 30 Hz in the person's own upright
// frame, so that place, facing, build and sensor do not matter.
//
// The upright frame: x to the person's left, the horizontal direction from the right hip to the left; z up; y ahead,
// horizontal. (Left-handed; nothing here depends on that.) A part's direction points from its end nearer the waist to
// the other: waist to torso, torso to neck, neck to head, shoulder to elbow, elbow to hand, hip to knee, knee to foot.
//
// Joints are interpolated to 30 Hz and smoothed by a Gaussian of 0.05 s (chosen by hand: half the swing time of the
// fastest blows here). A joint unknown for more than a quarter of a second leaves its parts unknown; for the time
// alignment only, such a gap is bridged linearly.
#pragma once
#include "compare/alignment.h"
#include "compare/joint_samples.h"

#include <stdint.h>

// ---------------------------------------------------------------- sliding quantile

// Weighted quantile of a sliding window: values are kept sorted, equal ones in the order of their frames, so that the
// result is bit for bit that of a stable sort of each window.

enum { SLIDING_MAX = 61 };

struct sliding_quantile {
    struct sliding_value {
        float value, weight;
        int32_t frame;
    } at[SLIDING_MAX];
    int32_t count; // 0: empty
};

// At most SLIDING_MAX values; no NaN; a frame once.
void sliding_add(struct sliding_quantile *quantile, int32_t frame, float value, float weight);
void sliding_remove(struct sliding_quantile *quantile, int32_t frame); // one that is not in it is fine

// The value below which `share` of the weight is. sum: of the weights, added in the order of the frames. NaN: empty.
double sliding_quantile_of(const struct sliding_quantile *quantile, double sum, double share);

// ---------------------------------------------------------------- movement

#define MOVEMENT_RATE_HZ 30.0
enum { MOVEMENT_STEP_NS = 33333333 };

struct movement_frame {
    float direction[PART_COUNT][3]; // unit vectors, upright frame
    float sigma[PART_COUNT];        // standard deviation of a direction, rad about each axis across it
    float shoulders[3];             // unit vector from the right shoulder to the left, upright frame
    float heading;                  // of the hips' axis about the vertical, rad, unwrapped from frame to frame
    uint16_t known;                 // bit p: part p; bit PART_COUNT: shoulders
};

static inline struct vec3 vec3_from_floats(const float d[3]) { return v3(d[0], d[1], d[2]); }

struct movement {
    struct movement_frame *frames;      // [count], malloc'ed
    int32_t count;                      // frame i is at i / MOVEMENT_RATE_HZ seconds after the first sample
    uint16_t ever_known;                // parts known in at least a tenth of the frames
    uint16_t joints_ever, joints_often; // joints known at all, and in at least a tenth of the frames
    float sigma_typical[PART_COUNT];    // median over the frames that know the part, rad
    bool sigma_given;                   // by the source; false: joint_samples.h's default_sigma_m()
};
void movement_free(struct movement *movement); // zeroed is fine; leaves it zeroed
// Frames first..end - 1 of it, with what is known of the whole. ERR_MEMORY: *out is zeroed.
MUST_CHECK enum status movement_copy(const struct movement *movement, int32_t first, int32_t end, struct movement *out);

// Longer ones are refused: they would take more memory than a tablet has.
#define MOVEMENT_HOURS_MAX 12

// ERR_INPUT: neither hips nor shoulders are ever known, so there is no upright frame; or the samples last longer than
// MOVEMENT_HOURS_MAX. ERR_MEMORY. On failure *out is zeroed. The samples' axes are joint_samples.h's.
MUST_CHECK enum status movement_from_samples(const struct joint_samples *samples, struct movement *out);

// From a recording (take NULL: its only one), a joints-csv or a motion file. ERR_INPUT: a take's name was given for
// one; else as joint_samples_read_*.
struct movement_source {
    int64_t frames_dropped, frames_side_mended, clock_jumps;
    int64_t began_ns;   // as joint_samples.h
    double tilt_rad;    // the camera's, which was corrected; 0: not tilted, or gravity is known
    bool tilt_by_floor; // as in joint_samples.h
    struct joint_notes notes;
};
MUST_CHECK enum status movement_read(const char *path, const char *take, struct movement *out,
                                     struct movement_source *source);

// As in a mirror: left and right parts exchanged, x reversed. ERR_MEMORY.
MUST_CHECK enum status movement_mirror(const struct movement *m, struct movement *out);

// Feature frames for align(): parts that are in `parts`, others 0. malloc'ed. scale: [PART_COUNT] 0..1 of each part's
// numbers; NULL: 1. ERR_MEMORY.
MUST_CHECK enum status movement_features(const struct movement *m, uint16_t parts, const double *scale,
                                         struct feature_frame **frames);

// Scales by which each part that moves has about the same say, however far it swings: 1 / sqrt(1 + variance / (18
// degrees)^2), the variance of its directions in m; so that one limb's timing does not decide the time alignment.
// The 18 degrees by hand.
void movement_equal_say(const struct movement *movement, double scale[PART_COUNT]);

// The part on the other side; the trunk's and the head's is itself.
enum part mirrored_part(enum part p);

// One instant, for live judging as for movement_from_samples, which does the same after interpolating and smoothing.
void movement_frame_from_joints(const struct vec3 joint[JOINT_COUNT], const float sigma_m[JOINT_COUNT],
                                const bool known[JOINT_COUNT], struct movement_frame *out);

// ---------------------------------------------------------------- angles

// The angles that people speak of, of one instant: bends of elbows, knees and hips, how high the upper arms are raised,
// lean and twist of the trunk, and the head. Radians; in the upright frame.

enum body_angle {
    ANGLE_LEFT_ELBOW, // bend: 0 straight
    ANGLE_RIGHT_ELBOW,
    ANGLE_LEFT_KNEE,
    ANGLE_RIGHT_KNEE,
    ANGLE_LEFT_HIP, // bend: thigh against the trunk, 0 in line
    ANGLE_RIGHT_HIP,
    ANGLE_LEFT_SHOULDER, // elevation: upper arm against the trunk, 0 hanging along it
    ANGLE_RIGHT_SHOULDER,
    ANGLE_LEAN,      // of the trunk, forwards positive
    ANGLE_SIDE_LEAN, // to the person's left positive
    ANGLE_TWIST,     // shoulders against hips about the vertical, to the person's left positive
    ANGLE_HEAD,      // bend of the head against the trunk, any direction
    BODY_ANGLES
};

const char *body_angle_name(enum body_angle angle); // "left_elbow", "trunk_lean", ...

struct body_angles {
    float rad[BODY_ANGLES];   // NaN where unknown
    float sigma[BODY_ANGLES]; // standard deviation, rad
};
struct body_angles body_angles_of(const struct movement_frame *frame);

// One of them alone, rad; the same bits.
float body_angle_of(const struct movement_frame *frame, enum body_angle angle);

// The trunk's direction from waist to neck: the mean of both torso parts, or the one that is known. False: neither, or
// they point opposite ways.
bool trunk_direction(const struct movement_frame *frame, struct vec3 *direction, double *sigma);

// The range an angle goes through in a movement's frames first..end - 1 less those left out ([count of m]): 3rd and
// 97th percentile, so that a single wrong frame does not make it. NaN where the angle is known in fewer than 5 frames.
// ERR_MEMORY.
struct angle_range {
    float low, high;
};
MUST_CHECK enum status body_angle_ranges(const struct movement *m, int32_t first, int32_t end, const bool *left_out,
                                         struct angle_range out[BODY_ANGLES]);
