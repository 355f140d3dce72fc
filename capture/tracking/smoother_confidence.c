// How sure the smoothed joints are: features from both passes, their weights in joint_error.c.
#include "capture/tracking/smoother_internal.h"

#define AROUND_NS   500000000 // over which log-odds are averaged, to both sides
#define APART_M     0.03      // unit of distances as features (joint_error.h)
#define ODDS_LEAST  12.0      // log-odds and scales of the passes are at least minus these, about
#define SCALE_LEAST 4.0

// From the nearest point between both passes to the result.
static double moved_m(const struct smoother_frame *m, int j)
{
    const struct vec3 a = m->estimate[FORWARD].joint[j], b = m->estimate[m->has_backward ? BACKWARD : FORWARD].joint[j],
                      ab = v3_sub(b, a), to = v3_sub(m->result.joint[j], a);
    const double at = fmax(0, fmin(1, v3_dot(to, ab) / fmax(1e-12, v3_dot(ab, ab))));
    return v3_length(v3_sub(to, v3_scale(ab, at)));
}

// Of being wrong, of both passes.
static double mean_odds(const struct smoother_frame *m, int j)
{
    return 0.5 * (double)(m->error[FORWARD][j].wrong_log_odds +
                          m->error[m->has_backward ? BACKWARD : FORWARD][j].wrong_log_odds);
}

static void find_odds_around(struct smoother_frame *m, int64_t count)
{
    for (int64_t i = 0, from = 0, to = 0; i < count; i++) {
        while (m[i].time_ns - m[from].time_ns > AROUND_NS)
            from++;
        while (to < count && m[to].time_ns - m[i].time_ns <= AROUND_NS)
            to++;
        for (int j = 0; j < JOINT_COUNT; j++) {
            double sum = 0;
            for (int64_t k = from; k < to; k++)
                sum += mean_odds(&m[k], j);
            m[i].around_odds[j] = (float)(sum / (double)(to - from));
        }
    }
}

void smoother_find_features(const struct smoother_frame *m, struct smoothed_features out[JOINT_COUNT])
{
    const enum estimate second = m->has_backward ? BACKWARD : FORWARD;
    double apart[JOINT_COUNT], body_apart = 0;
    for (int j = 0; j < JOINT_COUNT; j++) {
        apart[j] = feature_log(v3_distance(m->estimate[FORWARD].joint[j], m->estimate[second].joint[j]), APART_M);
        body_apart += apart[j] / JOINT_COUNT;
    }
    const bool opposite = m->has_backward && smoother_facing_differs(m);
    for (int j = 0; j < JOINT_COUNT; j++) {
        const struct joint_error *a = &m->error[FORWARD][j], *b = &m->error[second][j];
        double *value = out[j].value;
        value[SMOOTHED_ODDS] = fmax(0, mean_odds(m, j) + ODDS_LEAST);
        value[SMOOTHED_AROUND_ODDS] = fmax(0, (double)m->around_odds[j] + ODDS_LEAST);
        value[SMOOTHED_WORSE_ODDS] = 0.5 * fabs((double)(a->wrong_log_odds - b->wrong_log_odds));
        value[SMOOTHED_SCALE] = fmax(0, 0.5 * (double)(a->log_scale + b->log_scale) + SCALE_LEAST);
        value[SMOOTHED_APART] = apart[j];
        value[SMOOTHED_BODY_APART] = body_apart;
        value[SMOOTHED_OPEN] = feature_log((double)m->open_m[j], APART_M);
        value[SMOOTHED_MOVED] = feature_log((double)m->moved_m[j], APART_M);
        value[SMOOTHED_OPPOSITE] = opposite;
        value[SMOOTHED_FACING_DOUBT] = opposite ? 2 * m->facing_doubt : 0;
        value[SMOOTHED_ONE_PASS] = !m->has_backward;
        value[SMOOTHED_NOT_SHOWN] = !m->shown[FORWARD][j] && !m->shown[second][j];
    }
}

// Widens the covariances by what is known now, and decides what is seen.
static void decide_confidence(struct smoother_frame *m)
{
    struct smoothed_features features[JOINT_COUNT];
    for (int j = 0; j < JOINT_COUNT; j++)
        m->moved_m[j] = (float)moved_m(m, j);
    smoother_find_features(m, features);
    for (int j = 0; j < JOINT_COUNT; j++) {
        const bool shown = !(features[j].value[SMOOTHED_NOT_SHOWN] > 0);
        const struct joint_error error = joint_error_smoothed((enum joint)j, shown, &features[j]);
        struct covariance3 c = joint_covariance(&m->result, (enum joint)j);
        m->widening[j] = (float)joint_error_factor(&error, &c);
        c = covariance3_scale(&c, (double)m->widening[j]);
        joint_set_covariance(&m->result, (enum joint)j, &c);
        m->result.confidence[j] = confidence_of(joint_sigma_m(&m->result, (enum joint)j), error.is_seen);
    }
}

void smoother_decide_confidence(struct smoother_frame *m, int64_t count)
{
    find_odds_around(m, count);
    for (int64_t i = 0; i < count; i++)
        decide_confidence(&m[i]);
}
