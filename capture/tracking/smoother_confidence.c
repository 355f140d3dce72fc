// How sure the smoothed joints are: features from both passes, their weights in joint_error.c.
#include "capture/tracking/smoother_internal.h"

#define AROUND_NS 500000000 // over which log-odds are averaged, to both sides
#define APART_M   0.03      // unit of distances as features (joint_error.h)
#define ODDS_MIN  12.0      // log-odds and scales of the passes are at least minus these, about
#define SCALE_MIN 4.0

// From the nearest point between both passes to the result.
static double moved_m(const struct smoother_frame *frame, int j)
{
    const struct vec3 a = frame->estimate[FORWARD].joint[j],
                      b = frame->estimate[frame->has_backward ? BACKWARD : FORWARD].joint[j], ab = v3_sub(b, a),
                      to = v3_sub(frame->result.joint[j], a);
    const double at = fmax(0, fmin(1, v3_dot(to, ab) / fmax(1e-12, v3_dot(ab, ab))));
    return v3_length(v3_sub(to, v3_scale(ab, at)));
}

// Of being wrong, of both passes.
static double mean_odds(const struct smoother_frame *frame, int j)
{
    return 0.5 * (double)(frame->error[FORWARD][j].wrong_log_odds +
                          frame->error[frame->has_backward ? BACKWARD : FORWARD][j].wrong_log_odds);
}

static void find_odds_around(struct smoother_frame *frame, int64_t count)
{
    for (int64_t i = 0, from = 0, to = 0; i < count; i++) {
        while (frame[i].time_ns - frame[from].time_ns > AROUND_NS)
            from++;
        while (to < count && frame[to].time_ns - frame[i].time_ns <= AROUND_NS)
            to++;
        for (int j = 0; j < JOINT_COUNT; j++) {
            double sum = 0;
            for (int64_t k = from; k < to; k++)
                sum += mean_odds(&frame[k], j);
            frame[i].around_odds[j] = (float)(sum / (double)(to - from));
        }
    }
}

void smoother_find_features(const struct smoother_frame *frame, struct smoothed_features out[JOINT_COUNT])
{
    const enum estimate second = frame->has_backward ? BACKWARD : FORWARD;
    double apart[JOINT_COUNT], body_apart = 0;
    for (int j = 0; j < JOINT_COUNT; j++) {
        apart[j] =
            feature_log(v3_distance(frame->estimate[FORWARD].joint[j], frame->estimate[second].joint[j]), APART_M);
        body_apart += apart[j] / JOINT_COUNT;
    }
    const bool opposite = frame->has_backward && smoother_facing_differs(frame);
    for (int j = 0; j < JOINT_COUNT; j++) {
        const struct joint_error *a = &frame->error[FORWARD][j], *b = &frame->error[second][j];
        double *value = out[j].value;
        value[SMOOTHED_ODDS] = fmax(0, mean_odds(frame, j) + ODDS_MIN);
        value[SMOOTHED_AROUND_ODDS] = fmax(0, (double)frame->around_odds[j] + ODDS_MIN);
        value[SMOOTHED_WORSE_ODDS] = 0.5 * fabs((double)(a->wrong_log_odds - b->wrong_log_odds));
        value[SMOOTHED_SCALE] = fmax(0, 0.5 * (double)(a->log_scale + b->log_scale) + SCALE_MIN);
        value[SMOOTHED_APART] = apart[j];
        value[SMOOTHED_BODY_APART] = body_apart;
        value[SMOOTHED_OPEN] = feature_log((double)frame->open_m[j], APART_M);
        value[SMOOTHED_MOVED] = feature_log((double)frame->moved_m[j], APART_M);
        value[SMOOTHED_OPPOSITE] = opposite;
        value[SMOOTHED_FACING_DOUBT] = opposite ? 2 * frame->facing_doubt : 0;
        value[SMOOTHED_ONE_PASS] = !frame->has_backward;
        value[SMOOTHED_NOT_SHOWN] = !frame->shown[FORWARD][j] && !frame->shown[second][j];
    }
}

// Widens the covariances by what is known now, and decides what is seen.
static void decide_confidence(struct smoother_frame *frame)
{
    struct smoothed_features features[JOINT_COUNT];
    for (int j = 0; j < JOINT_COUNT; j++)
        frame->moved_m[j] = (float)moved_m(frame, j);
    smoother_find_features(frame, features);
    for (int j = 0; j < JOINT_COUNT; j++) {
        const bool shown = !(features[j].value[SMOOTHED_NOT_SHOWN] > 0);
        const struct joint_error error = joint_error_smoothed((enum joint)j, shown, &features[j]);
        struct covariance3 c = joint_covariance(&frame->result, (enum joint)j);
        frame->widening[j] = (float)joint_error_factor(&error, &c);
        c = covariance3_scale(&c, (double)frame->widening[j]);
        joint_set_covariance(&frame->result, (enum joint)j, &c);
        frame->result.confidence[j] = confidence_of(joint_sigma_m(&frame->result, (enum joint)j), error.is_seen);
    }
}

void smoother_decide_confidence(struct smoother_frame *frame, int64_t count)
{
    find_odds_around(frame, count);
    for (int64_t i = 0; i < count; i++)
        decide_confidence(&frame[i]);
}
