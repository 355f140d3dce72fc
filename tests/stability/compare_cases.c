// Comparison: constant, empty and unknown movements, limbs without direction, angles at 0 and where they are undefined.
#include "compare/comparison.h"
#include "compare/live_judge.h"
#include "compare/repetitions.h"
#include "tests/stability/stability.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { FRAMES = 120 };

// Frames of one movement: constant, or a number that rises from frame to frame.
static void fill(struct feature_frame frames[FRAMES], double slope)
{
    memset(frames, 0, FRAMES * sizeof *frames);
    for (int i = 0; i < FRAMES; i++)
        for (int k = 0; k < FEATURE_NUMBERS; k++)
            frames[i].number[k] = (int16_t)(500 + slope * i);
}

static const struct alignment_prices prices = {100000, 100000, 5000};

// in: slopes, frames of either -> the alignment's price.
static struct answer ask_alignment(const double *in)
{
    static struct feature_frame a[FRAMES], b[FRAMES];
    struct alignment x;
    fill(a, in[0]);
    fill(b, in[1]);
    const struct features fa = {a, (int32_t)in[2]}, fb = {b, (int32_t)in[3]};
    const enum status status = align(&fa, &fb, &prices, &x);
    const double price = status == OK ? (double)x.price : 0;
    alignment_free(&x);
    return answer_status(status, price);
}

// Correlation of two movements, which a constant one does not have.
static struct answer by_correlation(const double *in)
{
    double aa = 0, bb = 0, ab = 0;
    for (int i = 0; i < (int)in[2]; i++) {
        const double d = i - (in[2] - 1) / 2;
        aa += in[0] * d * in[0] * d;
        bb += in[1] * d * in[1] * d;
        ab += in[0] * d * in[1] * d;
    }
    return answer_value(1 - ab / sqrt(aa * bb));
}

static struct answer ask_repetitions(const double *in)
{
    static struct feature_frame a[FRAMES];
    struct repetition_list l = {0};
    fill(a, in[0]);
    const struct features f = {a, FRAMES};
    const enum status status = repetitions_find(&f, &l);
    const double count = l.count;
    repetition_list_free(&l);
    return answer_status(status, count);
}

// Every shift of a constant resembles it.
static struct answer best_lag(const double *in)
{
    const double change = fabs(in[0]) * 30;
    return answer_value(change < 500 ? FRAMES / 30 : 0);
}

static struct answer ask_verdict(const double *in)
{
    const enum verdict v = verdict_of(in[0], in[1]);
    return v == VERDICT_UNKNOWN ? answer_of(ANSWER_UNKNOWN) : answer_value(v == VERDICT_DIFFERENT);
}

static struct answer verdict_of_angle(const double *in) { return answer_value(in[0] > DIFFERENT_RAD); }

// Two directions in[0..2], in[3..5] of the left arm -> the elbow's bend.
static struct answer ask_elbow(const double *in)
{
    struct movement_frame f = {.known = 1u << PART_LEFT_UPPER_ARM | 1u << PART_LEFT_FOREARM};
    for (int k = 0; k < 3; k++) {
        f.direction[PART_LEFT_UPPER_ARM][k] = (float)in[k];
        f.direction[PART_LEFT_FOREARM][k] = (float)in[3 + k];
    }
    return answer_value((double)body_angles_of(&f).rad[ANGLE_LEFT_ELBOW]);
}

// in: both torso parts' directions -> an angle in[6], where its standard deviation is below 15 degrees.
static struct answer ask_trunk(const double *in)
{
    struct movement_frame f = {.known = 1u << PART_UPPER_TORSO | 1u << PART_LOWER_TORSO};
    for (int k = 0; k < 3; k++) {
        f.direction[PART_UPPER_TORSO][k] = (float)in[k];
        f.direction[PART_LOWER_TORSO][k] = (float)in[3 + k];
    }
    f.sigma[PART_UPPER_TORSO] = f.sigma[PART_LOWER_TORSO] = 0.02F;
    const struct body_angles a = body_angles_of(&f);
    const double rad = (double)a.rad[(int)in[6]], sigma = (double)a.sigma[(int)in[6]];
    return isnan(rad) || !(sigma < 1.5 * DIFFERENT_RAD) ? answer_of(ANSWER_UNKNOWN) : answer_value(rad);
}

static struct answer by_atan2(const double *in)
{
    const double x = in[0] + in[3], y = in[1] + in[4], z = in[2] + in[5];
    return answer_value((int)in[6] == ANGLE_LEAN ? atan2(y, z) : atan2(x, z));
}

// A standing person, some of whose joints are moved: in: joint, x, y, z of it, the part asked.
static void stand(struct vec3 joint[JOINT_COUNT], bool known[JOINT_COUNT], float sigma[JOINT_COUNT])
{
    static const double at[JOINT_COUNT][3] = {
        [JOINT_HEAD] = {0, -0.7, 2.5},
        [JOINT_NECK] = {0, -0.5, 2.5},
        [JOINT_TORSO] = {0, -0.25, 2.5},
        [JOINT_WAIST] = {0, 0, 2.5},
        [JOINT_LEFT_SHOULDER] = {0.2, -0.5, 2.5},
        [JOINT_RIGHT_SHOULDER] = {-0.2, -0.5, 2.5},
        [JOINT_LEFT_ELBOW] = {0.2, -0.2, 2.5},
        [JOINT_RIGHT_ELBOW] = {-0.2, -0.2, 2.5},
        [JOINT_LEFT_HAND] = {0.2, 0.1, 2.5},
        [JOINT_RIGHT_HAND] = {-0.2, 0.1, 2.5},
        [JOINT_LEFT_HIP] = {0.1, 0, 2.5},
        [JOINT_RIGHT_HIP] = {-0.1, 0, 2.5},
        [JOINT_LEFT_KNEE] = {0.1, 0.4, 2.5},
        [JOINT_RIGHT_KNEE] = {-0.1, 0.4, 2.5},
        [JOINT_LEFT_FOOT] = {0.1, 0.8, 2.5},
        [JOINT_RIGHT_FOOT] = {-0.1, 0.8, 2.5},
    };
    for (int j = 0; j < JOINT_COUNT; j++) {
        joint[j] = v3(at[j][0], at[j][1], at[j][2]);
        known[j] = true;
        sigma[j] = 0.012F;
    }
}

static struct answer ask_part(const double *in)
{
    struct vec3 joint[JOINT_COUNT];
    bool known[JOINT_COUNT];
    float sigma[JOINT_COUNT];
    struct movement_frame f;
    const int part = (int)in[4];
    stand(joint, known, sigma);
    joint[(int)in[0]] = v3(in[1], in[2], in[3]);
    movement_frame_from_joints(joint, sigma, known, &f);
    const float *d = part == PART_COUNT ? f.shoulders : f.direction[part];
    return f.known >> part & 1 ? answer_values((double[]){(double)d[0], (double)d[1], (double)d[2]}, 3)
                               : answer_of(ANSWER_UNKNOWN);
}

// Any two joints have a direction.
static struct answer any_direction(const double *in)
{
    struct vec3 joint[JOINT_COUNT];
    bool known[JOINT_COUNT];
    float sigma[JOINT_COUNT];
    stand(joint, known, sigma);
    joint[(int)in[0]] = v3(in[1], in[2], in[3]);
    const bool shoulders = (int)in[4] == PART_COUNT;
    const struct vec3 d = shoulders ? v3_sub(joint[JOINT_LEFT_SHOULDER], joint[JOINT_RIGHT_SHOULDER])
                                    : v3_sub(joint[JOINT_LEFT_HAND], joint[JOINT_LEFT_ELBOW]);
    return answer_values((double[]){d.x / v3_length(d), d.y, d.z}, 3);
}

// in: seconds, joints known (0: none, 1: all), movement of a hand in metres -> the score against itself.
static struct answer ask_score(const double *in)
{
    struct joint_samples s = {0};
    struct movement a = {0}, b = {0};
    struct comparison c;
    enum status status = OK;
    for (int i = 0; i < (int)(in[0] * 30) + 1 && status == OK; i++) {
        struct joint_sample at = {.time_ns = i * (int64_t)33333333};
        bool known[JOINT_COUNT];
        stand(at.skeleton.joint, known, at.sigma_m);
        for (int j = 0; j < JOINT_COUNT; j++)
            at.skeleton.confidence[j] = (float)in[1];
        at.skeleton.joint[JOINT_LEFT_HAND].x += in[2] * i / 30;
        status = joint_samples_add(&s, &at);
    }
    if (status == OK)
        status = movement_from_samples(&s, &a);
    if (status == OK)
        status = movement_from_samples(&s, &b);
    joint_samples_free(&s);
    if (status == OK)
        status = comparison_make(&a, &b, NULL, &c);
    const double score = status == OK ? c.score : 0;
    if (status == OK)
        comparison_free(&c);
    movement_free(&a);
    movement_free(&b);
    return answer_status(status, score);
}

// Differences weighed by how much the reference moves.
static struct answer by_movement(const double *in)
{
    const double moved = in[1] > 0 ? in[2] : 0;
    return answer_value(100 * (1 - 0 / moved));
}

#define BETWEEN(what, why, ax, ay, az, bx, by, bz, to)                                                                 \
    {                                                                                                                  \
        what, why, ANSWER_VALUE, ask_elbow, &plain_angle_between, .in = {ax, ay, az, bx, by, bz}, .exact = {to},       \
                                                                  .exact_count = 1, .tolerance = 1e-6 * (to) + 1e-14,  \
                                                                  .unit = "rad"                                        \
    }

static const struct stability_case cases[] = {
    {"aligning two constant movements", "costs, no correlation", ANSWER_VALUE, ask_alignment, NULL, by_correlation,
     .in = {0, 0, FRAMES, FRAMES}, .exact = {0}, .exact_count = 1},
    {"aligning a constant movement with itself, shorter", "costs, no correlation", ANSWER_VALUE, ask_alignment, NULL,
     by_correlation, .in = {0, 0, FRAMES, FRAMES - 30}, .exact = {150000}, .exact_count = 1},
    {"aligning with a movement of no frames", "refused", ANSWER_ERROR, ask_alignment, NULL, by_correlation,
     .in = {1, 1, FRAMES, 0}},
    {"aligning two movements of one frame", "costs, no correlation", ANSWER_VALUE, ask_alignment, NULL, by_correlation,
     .in = {0, 0, 1, 1}, .exact = {0}, .exact_count = 1},
    {"repetitions in a constant movement", "a cycle must be gone through", ANSWER_VALUE, ask_repetitions, NULL,
     best_lag, .in = {0}, .exact = {0}, .exact_count = 1},
    {"verdict of an angle that is NaN", "finite angles only", ANSWER_UNKNOWN, ask_verdict, NULL, verdict_of_angle,
     .in = {NAN, 0.02}},
    {"verdict of an angle infinitely unsure", "a largest sigma", ANSWER_UNKNOWN, ask_verdict, NULL, verdict_of_angle,
     .in = {0.5, INFINITY}},
    {"verdict of an angle at the very bound", "neither side is sure", ANSWER_UNKNOWN, ask_verdict, NULL,
     verdict_of_angle, .in = {DIFFERENT_RAD, 0.05}},
    BETWEEN("bend of an elbow by 1e-8 rad", "atan2 of both products", 1, 0, 0, 1, 1e-8, 0, 1e-8),
    BETWEEN("bend of an elbow by 1e-7 rad", "atan2 of both products", 0, 1, 0, 0, 1, 1e-7, 1e-7),
    {"lean of a trunk folded back on itself", "a direction that is none", ANSWER_UNKNOWN, ask_trunk, NULL, by_atan2,
     .in = {0, 0, 1, 0, 0, -1, ANGLE_LEAN}, .unit = "rad"},
    {"side lean of a trunk bent level", "sigma grows where it is undefined", ANSWER_UNKNOWN, ask_trunk, NULL, by_atan2,
     .in = {0.01, 1, 0.01, 0.01, 1, 0.01, ANGLE_SIDE_LEAN}, .unit = "rad"},
    {"direction of a forearm without length", "a part is 1 mm long", ANSWER_UNKNOWN, ask_part, NULL, any_direction,
     .in = {JOINT_LEFT_HAND, 0.2, -0.2, 2.5, PART_LEFT_FOREARM}},
    {"direction of a forearm to a hand of NaN", "a part is 1 mm long", ANSWER_UNKNOWN, ask_part, NULL, any_direction,
     .in = {JOINT_LEFT_HAND, NAN, -0.2, 2.5, PART_LEFT_FOREARM}},
    {"direction of a forearm to a hand at infinity", "a part is 1 mm long", ANSWER_UNKNOWN, ask_part, NULL,
     any_direction, .in = {JOINT_LEFT_HAND, INFINITY, -0.2, 2.5, PART_LEFT_FOREARM}},
    {"direction of shoulders in one place", "shoulders are 1 mm apart", ANSWER_UNKNOWN, ask_part, NULL, any_direction,
     .in = {JOINT_LEFT_SHOULDER, -0.2, -0.5, 2.5, PART_COUNT}},
    {"score of standing still against itself", "a least weight of each part", ANSWER_VALUE, ask_score, NULL,
     by_movement, .in = {4, 1, 0}, .exact = {100}, .exact_count = 1, .tolerance = 1e-9},
    {"score of one frame against itself", "a least weight of each part", ANSWER_VALUE, ask_score, NULL, by_movement,
     .in = {0, 1, 0}, .exact = {100}, .exact_count = 1, .tolerance = 1e-9},
    {"score of movements of which nothing is known", "refused", ANSWER_ERROR, ask_score, NULL, by_movement,
     .in = {4, 0, 0}},
};
const struct stability_stage stability_compare = {"comparison", cases, COUNT_OF(cases)};
