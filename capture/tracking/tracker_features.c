#include "capture/tracking/tracker_features.h"

#include "base/portable_math.h"
#include "capture/body/body_prior.h"
#include "capture/tracking/pose_init.h"

// Units of the features: of what size they matter. Chosen by hand; joint_error.c holds their weights.
#define GOOD_ENERGY   30.0 // of a fit to a person in tight clothes
#define GOOD_DENSITY  60.0 // the same, 1/m^2 of its visible area
#define SHAPE_UNIT    3.0
#define POSTURE_UNIT  5.0
#define ENERGY_MEAN_S 0.5
#define NEAR_M        0.06 // of the body: farther points are not explained
#define ELSEWHERE_M   0.05
#define VAGUE_M       0.05
#define VAGUE_MAX_M   1.0
#define JUST_FRAMES   15.0
#define RELOCATED_S   0.3
#define WALKING_M_S   0.5
#define FAR_M         2.0
#define PAIR_NEAR_M   0.15
#define FREE_SPACE    1.0
#define SPEED_M_S     0.5
#define FIT_M         0.01
#define HIDDEN_MAX_S  2.0

static double clamp01(double x) { return fmax(0, fmin(1, x)); }

double feature_log(double x, double unit) { return portable_log(1 + fmax(0, x) / unit); }

// What all joints of a frame have in common.
static void find_body_features(struct tracker *tracker, const struct tracked_frame *frame, double *out)
{
    const struct fit_result *fit = &tracker->scratch->best;
    const struct depth_evidence *e = tracker->evidence;
    const bool started = tracker->frames == 0;
    out[FEATURE_ENERGY] = fmax(0, portable_log(fmax(1, fit->energy) / GOOD_ENERGY));
    const double rate = started ? 1 : fmin(1, frame->dt_s / ENERGY_MEAN_S);
    tracker->energy_mean += rate * (out[FEATURE_ENERGY] - tracker->energy_mean);
    out[FEATURE_ENERGY_MEAN] = tracker->energy_mean;
    const double per_area = portable_log(fmax(1, fit->energy) / (GOOD_DENSITY * fmax(0.05, e->extent_m2)));
    tracker->density_mean += rate * (fmax(0, per_area) - tracker->density_mean);
    out[FEATURE_DENSITY] = tracker->density_mean;
    out[FEATURE_NO_PERSON] = 1 / (1 + portable_exp(tracker->person_mean));
    out[FEATURE_SHAPE] = feature_log(shape_log_odds(&fit->shape), SHAPE_UNIT);
    out[FEATURE_POSTURE] = feature_log(body_prior_joint_limits(&fit->shape, &fit->pose, NULL, NULL), POSTURE_UNIT);
    double intrusion = 0;
    for (int s = 0; s < SEG_COUNT; s++)
        intrusion += fit->limb_energy[s];
    out[FEATURE_INTRUSION] = feature_log(intrusion, FREE_SPACE);
    out[FEATURE_UNEXPLAINED] = fmin(1, 5 * (1 - explained_share(e, fit, NEAR_M)));
    out[FEATURE_FLIP] = clamp01(0.5 - 0.5 * tracker->turned_cosine);
    const struct vec3 ahead = body_axis(&fit->build, SEG_PELVIS, 2), left = body_axis(&fit->build, SEG_CHEST, 0),
                      spine = body_axis(&fit->build, SEG_CHEST, 1), view = v3_unit(fit->build.joint[JOINT_TORSO]),
                      up = v3_length(frame->task.up) > 0.5 ? frame->task.up : v3(0, -1, 0);
    const double walk = v3_dot(tracker->filter.speed[JOINT_WAIST], ahead) / WALKING_M_S;
    out[FEATURE_BACKWARDS] = clamp01(tracker->backward ? walk : -walk);
    out[FEATURE_START] = portable_exp(-tracker->frames / JUST_FRAMES);
    out[FEATURE_SIDEWAYS] = fabs(v3_dot(left, view));
    out[FEATURE_BENT] = clamp01(1 - v3_dot(spine, up));
    tracker->since_turned_s = tracker->flipped || started ? 0 : tracker->since_turned_s + frame->dt_s;
    out[FEATURE_TURNED] = portable_exp(-tracker->since_turned_s / RELOCATED_S);
    out[FEATURE_CROPPED] = fmin(2, __builtin_popcount(evidence_cropped_edges(e)));
    out[FEATURE_FAR] = fmax(0, fit->build.joint[JOINT_WAIST].z - FAR_M);
    out[FEATURE_NEAR] = fmax(0, FAR_M - fit->build.joint[JOINT_WAIST].z);
    out[FEATURE_SKIRT] = fit->shape.hem_m > 0;
}

// The solids of limb k that say where its joint is: of the root the upper part, of the tip the lower ones.
struct solid_range {
    int first, end;
};

static struct solid_range solids_of(int k, enum joint joint)
{
    const int first = body_limbs[k].first_solid;
    return (struct solid_range){joint == body_limbs[k].tip ? first + 1 : first,
                                joint == body_limbs[k].root ? first + 1 : first + LIMB_SOLIDS};
}

static struct solid_range trunk_solids(enum joint joint)
{
    return joint == JOINT_HEAD || joint == JOINT_NECK ? (struct solid_range){SOLID_SKULL - 1, SOLID_SKULL + 1}
                                                      : (struct solid_range){SOLID_PELVIS, SOLID_CHEST + 1};
}

// How well the points on these solids fit, and how much of their surface has any.
static void find_points(const struct tracker *tracker, struct solid_range range, double *misfit, double *starved)
{
    const struct fit_result *fit = &tracker->scratch->best;
    const struct depth_evidence *e = tracker->evidence;
    double squares = 0, area_m2 = 0;
    int count = 0;
    for (int i = 0; i < e->count; i++)
        if (fit->solid[i] >= range.first && fit->solid[i] < range.end) {
            const double off = (double)fit->residual[i] / NEAR_M;
            squares += fmin(1, off * off);
            count++;
        }
    for (int i = range.first; i < range.end; i++) {
        const struct body_solid *s = &fit->build.solid[i];
        const struct vec3 along = v3_sub(s->b, s->a);
        const double seen = v3_length(v3_cross(along, v3_unit(s->a)));
        area_m2 += seen * (s->radius_a + s->radius_b) + 3 * s->radius_b * s->radius_b;
    }
    *misfit = count ? squares / count : 1;
    *starved = 1 - clamp01(count * e->extent_m2 / fmax(1, e->count) / area_m2);
}

static int limb_of(enum joint joint) // -1: the trunk
{
    for (int k = 0; k < LIMB_COUNT; k++)
        if (joint == body_limbs[k].root || joint == body_limbs[k].bend || joint == body_limbs[k].tip)
            return k;
    return -1;
}

static void find_limb_features(const struct tracker *tracker, int k, enum joint j, double *out)
{
    const struct fit_result *fit = &tracker->scratch->best;
    const struct body_limb *limb = &body_limbs[k], *other = &body_limbs[k ^ 1];
    const struct vec3 *joint = fit->build.joint;
    find_points(tracker, solids_of(k, j), &out[FEATURE_MISFIT], &out[FEATURE_STARVED]);
    out[FEATURE_FREE_SPACE] = feature_log(
        fit->limb_energy[limb->upper] + fit->limb_energy[limb->lower] + fit->limb_energy[limb->end], FREE_SPACE);
    out[FEATURE_RELOCATED] = portable_exp(-tracker->since_relocated_s[k] / RELOCATED_S);
    const enum joint pair = j == limb->root ? other->root : j == limb->bend ? other->bend : other->tip;
    struct vec3 apart = v3_sub(joint[j], joint[pair]);
    apart = v3_sub(apart, v3_scale(v3_unit(joint[j]), v3_dot(apart, v3_unit(joint[j]))));
    out[FEATURE_PAIR_NEAR] = portable_exp(-v3_length(apart) / PAIR_NEAR_M);
}

void tracker_find_features(struct tracker *tracker, const struct tracked_frame *frame,
                           struct joint_features out[JOINT_COUNT])
{
    struct joint_features body = {{0}};
    find_body_features(tracker, frame, body.value);
    for (int k = 0; k < LIMB_COUNT; k++)
        tracker->since_relocated_s[k] = tracker->limb_relocated[k] ? 0 : tracker->since_relocated_s[k] + frame->dt_s;
    for (int j = 0; j < JOINT_COUNT; j++) {
        double *value = out[j].value;
        const int k = limb_of((enum joint)j);
        out[j] = body;
        if (k >= 0)
            find_limb_features(tracker, k, (enum joint)j, value);
        else
            find_points(tracker, trunk_solids((enum joint)j), &value[FEATURE_MISFIT], &value[FEATURE_STARVED]);
        value[FEATURE_ELSEWHERE] =
            feature_log(v3_distance(tracker->joints.joint[j], tracker->scratch->best.build.joint[j]), ELSEWHERE_M);
        value[FEATURE_VAGUE] = feature_log(fmin(tracker->joints.sigma_m[j], VAGUE_MAX_M), VAGUE_M);
        value[FEATURE_NOT_SHOWN] = 1 - (double)tracker->visible_probes[j] / EVIDENCE_PROBES;
        value[FEATURE_HIDDEN] = fmin(HIDDEN_MAX_S, tracker->sight[j].hidden_s);
        value[FEATURE_SPEED] = feature_log(v3_length(tracker->filter.speed[j]), SPEED_M_S);
        value[FEATURE_FIT] = feature_log(sqrt(covariance3_trace(&tracker->posterior[j]) / 3), FIT_M);
    }
}
