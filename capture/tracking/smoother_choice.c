// Which of a frame's estimates is right: emissions and transitions of the hidden Markov model, and its posterior.
#include "base/portable_math.h"
#include "capture/tracking/smoother_internal.h"

#include <string.h>

// Chosen by hand; docs/results.md measures the outcome.
#define FACING_DIFFERS_M    0.15 // trunks further apart face opposite ways
#define FRAME_LOG_ODDS_MAX  3    // bound for one frame, which may be wrong
#define CHANGE_M            0.05 // a limb that moves this far between frames costs 1 in log-odds; for 30 Hz
#define CHANGE_LOG_ODDS_MAX 50.0
#define WALK_LOG_ODDS       1.5 // in a frame, for walking ahead at WALK_M_S or faster
#define WALK_M_S            0.5
#define IMPOSSIBLE          1e6
enum { STEPS = 5 }; // frames to both sides over which walking is measured; for 30 Hz

double smoother_limb_distance(const struct skeleton *a, const struct skeleton *b, int k)
{
    if (k < LIMB_COUNT)
        return fmax(v3_distance(a->joint[body_limbs[k].bend], b->joint[body_limbs[k].bend]),
                    v3_distance(a->joint[body_limbs[k].tip], b->joint[body_limbs[k].tip]));
    double max = 0;
    for (int i = 0; i < LIMB_COUNT; i++)
        max = fmax(max, v3_distance(a->joint[body_limbs[i].root], b->joint[body_limbs[i].root]));
    return max;
}

bool smoother_facing_differs(const struct smoother_frame *frame)
{
    return smoother_limb_distance(&frame->estimate[FORWARD], &frame->estimate[BACKWARD], TRUNK) > FACING_DIFFERS_M;
}

// Log-odds that the person walks ahead and not backwards with the facing of estimate w.
static double walking_log_odds(const struct smoother_frame *frame, int64_t count, int64_t i, enum estimate estimate)
{
    int64_t from = i > STEPS ? i - STEPS : 0, to = i + STEPS < count ? i + STEPS : count - 1;
    const struct vec3 *j = frame[i].estimate[estimate].joint;
    struct vec3 left = v3_sub(j[JOINT_LEFT_HIP], j[JOINT_RIGHT_HIP]), up = v3_sub(j[JOINT_NECK], j[JOINT_WAIST]),
                way = v3_sub(frame[to].estimate[FORWARD].joint[JOINT_WAIST],
                             frame[from].estimate[FORWARD].joint[JOINT_WAIST]);
    double dt_s = 1e-9 * (double)(frame[to].time_ns - frame[from].time_ns);
    if (!(dt_s > 0))
        return 0;
    return WALK_LOG_ODDS * fmax(-1, fmin(1, v3_dot(way, v3_unit(v3_cross(left, up))) / (dt_s * WALK_M_S)));
}

// Log-odds against each facing in frame i (emissions).
static void find_trunk_log_odds(const struct smoother_frame *frame, int64_t count, int64_t i, double against[STATES])
{
    const struct smoother_frame *at = &frame[i];
    bool flipped = at->has_backward && smoother_facing_differs(at);
    for (int state = 0; state < STATES; state++)
        against[state] = IMPOSSIBLE;
    double *ahead = &against[state_of(FORWARD, FORWARD)], *back = &against[state_of(BACKWARD, BACKWARD)];
    *ahead = 0;
    if (!at->has_backward)
        return;
    *back = 0;
    if (!flipped)
        return;
    *ahead = fmax(-FRAME_LOG_ODDS_MAX, fmin(FRAME_LOG_ODDS_MAX, at->odds.whole_body)) -
             walking_log_odds(frame, count, i, FORWARD);
    *back = -walking_log_odds(frame, count, i, BACKWARD);
}

// Log-odds against each choice of estimates for a pair of limbs, `first` and the next (emissions).
static void find_pair_log_odds(const struct smoother_frame *at, int first, double against[STATES])
{
    bool flipped = at->has_backward && smoother_facing_differs(at);
    double min = IMPOSSIBLE;
    for (int state = 0; state < STATES; state++) {
        enum estimate left = left_estimate(state), right = right_estimate(state);
        const double(*odds)[2] = (const double(*)[2])at->odds.pair[first / 2];
        against[state] = odds[left == FORWARD][right == FORWARD] -
                         (left == ALTERNATIVE ? at->alternative_odds[first] : 0) -
                         (right == ALTERNATIVE ? at->alternative_odds[first + 1] : 0);
        bool there = (left != ALTERNATIVE || at->alternative_odds[first] > 0) &&
                     (right != ALTERNATIVE || at->alternative_odds[first + 1] > 0);
        if (!at->has_backward || flipped)
            there = left == right && left == (flipped ? at->facing : FORWARD);
        if (!there)
            against[state] = IMPOSSIBLE;
        min = fmin(min, against[state]);
    }
    for (int state = 0; state < STATES; state++)
        if (against[state] < IMPOSSIBLE)
            against[state] = fmin(FRAME_LOG_ODDS_MAX, against[state] - min);
}

// Log-odds against part k jumping from estimate v in the frame before `frame` to estimate w in it (transitions).
static void find_changes(const struct smoother_frame *frame, int k, double change[ESTIMATES][ESTIMATES])
{
    for (int v = 0; v < ESTIMATES; v++)
        for (int w = 0; w < ESTIMATES; w++)
            change[v][w] = fmin(smoother_limb_distance(&frame->estimate[w], &frame[-1].estimate[v], k) / CHANGE_M,
                                CHANGE_LOG_ODDS_MAX);
}

// -log of the sum of the choices' odds.
static double soft_min(const double against[STATES])
{
    double min = INFINITY, sum = 0;
    for (int s = 0; s < STATES; s++)
        min = fmin(min, against[s]);
    for (int s = 0; s < STATES; s++)
        sum += portable_exp(min - against[s]);
    return min - portable_log(sum);
}

// Emissions of one frame, and transitions from the frame before, of a pair of limbs, `first` and the next, or of the
// trunk (TRUNK).
struct chain_step {
    double against[STATES], change[STATES][STATES];
};

static void find_step(const struct smoother_frame *frame, int64_t count, int64_t i, int first, struct chain_step *out)
{
    double left[ESTIMATES][ESTIMATES] = {0}, right[ESTIMATES][ESTIMATES] = {0};
    if (first == TRUNK)
        find_trunk_log_odds(frame, count, i, out->against);
    else
        find_pair_log_odds(&frame[i], first, out->against);
    if (i)
        find_changes(&frame[i], first, left);
    if (i && first != TRUNK)
        find_changes(&frame[i], first + 1, right);
    for (int r = 0; r < STATES; r++)
        for (int s = 0; s < STATES; s++)
            out->change[r][s] = left[left_estimate(r)][left_estimate(s)] + right[right_estimate(r)][right_estimate(s)];
}

void smoother_find_posterior(const struct smoother_frame *frame, int64_t count, int first, double (*posterior)[STATES])
{
    struct chain_step step;
    double sum[STATES], after[STATES] = {0};
    for (int64_t i = 0; i < count; i++) { // forward variables: log-odds against each state up to here
        find_step(frame, count, i, first, &step);
        for (int s = 0; s < STATES; s++) {
            for (int r = 0; i && r < STATES; r++)
                sum[r] = posterior[i - 1][r] + step.change[r][s];
            posterior[i][s] = step.against[s] + (i ? soft_min(sum) : 0);
        }
    }
    for (int64_t i = count - 1; i >= 0; i--) {
        for (int s = 0; s < STATES; s++)
            posterior[i][s] += after[s];
        double all = soft_min(posterior[i]);
        for (int s = 0; s < STATES; s++)
            posterior[i][s] = portable_exp(all - posterior[i][s]);
        find_step(frame, count, i, first, &step);
        double then[STATES];
        memcpy(then, after, sizeof then);
        for (int r = 0; r < STATES; r++) {
            for (int s = 0; s < STATES; s++)
                sum[s] = step.change[r][s] + step.against[s] + then[s];
            after[r] = soft_min(sum);
        }
    }
}
