#include "capture/tracking/joint_error.h"

#include "base/portable_math.h"

// Bounds of what the models say: beyond, features are as no film had them.
#define LOG_SCALE_MIN      (-2.0)
#define LOG_SCALE_MAX      4.0
#define WRONG_LOG_ODDS_MIN (-10.0)
#define WRONG_LOG_ODDS_MAX 6.0

enum joint_kind {
    KIND_HEAD,
    KIND_NECK,
    KIND_SHOULDER,
    KIND_ELBOW,
    KIND_HAND,
    KIND_TORSO,
    KIND_WAIST,
    KIND_HIP,
    KIND_KNEE,
    KIND_FOOT,
    KINDS
};

static const enum joint_kind kind_of[JOINT_COUNT] = {
    [JOINT_HEAD] = KIND_HEAD,         [JOINT_NECK] = KIND_NECK,       [JOINT_LEFT_SHOULDER] = KIND_SHOULDER,
    [JOINT_LEFT_ELBOW] = KIND_ELBOW,  [JOINT_LEFT_HAND] = KIND_HAND,  [JOINT_RIGHT_SHOULDER] = KIND_SHOULDER,
    [JOINT_RIGHT_ELBOW] = KIND_ELBOW, [JOINT_RIGHT_HAND] = KIND_HAND, [JOINT_TORSO] = KIND_TORSO,
    [JOINT_WAIST] = KIND_WAIST,       [JOINT_LEFT_HIP] = KIND_HIP,    [JOINT_LEFT_KNEE] = KIND_KNEE,
    [JOINT_LEFT_FOOT] = KIND_FOOT,    [JOINT_RIGHT_HIP] = KIND_HIP,   [JOINT_RIGHT_KNEE] = KIND_KNEE,
    [JOINT_RIGHT_FOOT] = KIND_FOOT,
};

// Up to which log-odds of being wrong a joint that is shown is called seen, and what the logarithm of the scale lacks:
// `seen`, or by how far the log-odds pass that limit.
struct decision {
    double limit, seen, inferred, slope;
};

struct kind_weights {
    double scale[2], odds[2]; // of joints that are shown, and of others
};

struct feature_weights {
    double scale[2], odds[2]; // of joints of the trunk, and of limbs beyond their roots
};

#include "capture/tracking/joint_error_table.inl"

static const char *const feature_names[FEATURE_COUNT] = {
    "energy", "energy_mean", "density", "no_person", "shape",      "posture",   "intrusion", "unexplained",
    "flip",   "backwards",   "start",   "sideways",  "bent",       "turned",    "cropped",   "far",
    "near",   "skirt",       "misfit",  "starved",   "free_space", "relocated", "pair_near", "elsewhere",
    "vague",  "not_shown",   "hidden",  "speed",     "fit",
};
static const char *const smoothed_names[SMOOTHED_COUNT] = {
    "odds", "around_odds", "worse_odds", "scale",        "apart",    "body_apart",
    "open", "moved",       "opposite",   "facing_doubt", "one_pass", "not_shown",
};

const char *joint_feature_name(enum joint_feature feature) { return feature_names[feature]; }
const char *smoothed_feature_name(enum smoothed_feature feature) { return smoothed_names[feature]; }

static bool is_of_limb(enum joint_kind kind)
{
    return kind == KIND_ELBOW || kind == KIND_HAND || kind == KIND_KNEE || kind == KIND_FOOT;
}

static struct joint_error weigh(const struct kind_weights *kind, const struct feature_weights *weights,
                                const double *value, int count, int hidden, int limb)
{
    double scale = kind->scale[hidden], odds = kind->odds[hidden];
    for (int i = 0; i < count; i++) {
        scale += weights[i].scale[limb] * value[i];
        odds += weights[i].odds[limb] * value[i];
    }
    scale = fmax(LOG_SCALE_MIN, fmin(LOG_SCALE_MAX, scale));
    odds = fmax(WRONG_LOG_ODDS_MIN, fmin(WRONG_LOG_ODDS_MAX, odds));
    return (struct joint_error){(float)scale, (float)odds, (float)scale, false};
}

static void decide(struct joint_error *error, bool shown, const struct decision *by)
{
    const double beyond = (double)error->wrong_log_odds - by->limit;
    error->is_seen = shown && beyond <= 0;
    error->log_widening =
        (float)((double)error->log_scale + (error->is_seen ? by->seen : by->inferred + by->slope * beyond));
}

struct joint_error joint_error_online(enum joint joint, bool shown, const struct joint_features *features)
{
    const enum joint_kind k = kind_of[joint];
    struct joint_error e =
        weigh(&online_kind[k], online_feature, features->value, FEATURE_COUNT, !shown, is_of_limb(k));
    decide(&e, shown, &online_decision);
    return e;
}

struct joint_error joint_error_smoothed(enum joint joint, bool shown, const struct smoothed_features *features)
{
    const enum joint_kind k = kind_of[joint];
    struct joint_error e =
        weigh(&smoothed_kind[k], smoothed_feature, features->value, SMOOTHED_COUNT, !shown, is_of_limb(k));
    decide(&e, shown, &smoothed_decision);
    return e;
}

double joint_error_factor(const struct joint_error *error, const struct covariance3 *covariance)
{
    const double sigma_m = sqrt(covariance3_trace(covariance) / 3), max_m = 0.999 * KNOWN_SIGMA_MAX_M;
    if (!(sigma_m < max_m))
        return 1;
    return fmin(portable_exp((double)error->log_widening), (max_m / sigma_m) * (max_m / sigma_m));
}
