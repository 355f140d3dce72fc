#include "compare/limb_times.h"

#include <stdlib.h>

const struct body_joint body_joints[BODY_JOINTS] = {
    {PART_UPPER_TORSO, CARRIER_NONE, PART_UPPER_TORSO, ANGLE_LEAN, -1},
    {PART_HEAD, CARRIER_TRUNK, PART_HEAD, ANGLE_HEAD, -1},
    {PART_LEFT_UPPER_ARM, CARRIER_TRUNK, PART_HEAD, ANGLE_LEFT_SHOULDER, 0},
    {PART_LEFT_FOREARM, CARRIER_PART, PART_LEFT_UPPER_ARM, ANGLE_LEFT_ELBOW, 0},
    {PART_RIGHT_UPPER_ARM, CARRIER_TRUNK, PART_HEAD, ANGLE_RIGHT_SHOULDER, 1},
    {PART_RIGHT_FOREARM, CARRIER_PART, PART_RIGHT_UPPER_ARM, ANGLE_RIGHT_ELBOW, 1},
    {PART_LEFT_THIGH, CARRIER_NONE, PART_HEAD, ANGLE_LEFT_HIP, 2},
    {PART_LEFT_SHIN, CARRIER_PART, PART_LEFT_THIGH, ANGLE_LEFT_KNEE, 2},
    {PART_RIGHT_THIGH, CARRIER_NONE, PART_HEAD, ANGLE_RIGHT_HIP, 3},
    {PART_RIGHT_SHIN, CARRIER_PART, PART_RIGHT_THIGH, ANGLE_RIGHT_KNEE, 3},
};

static struct vec3 vector(const float d[3]) { return v3(d[0], d[1], d[2]); }

static bool direction(const struct movement_frame *f, const struct body_joint *j, struct vec3 *d, double *sigma)
{
    if (j->part == PART_UPPER_TORSO)
        return trunk_direction(f, d, sigma);
    *d = vector(f->direction[j->part]);
    *sigma = f->sigma[j->part];
    return f->known >> j->part & 1;
}

static bool carrier(const struct movement_frame *f, const struct body_joint *j, struct vec3 *d, double *sigma)
{
    if (j->carrier == CARRIER_TRUNK)
        return trunk_direction(f, d, sigma);
    *d = vector(f->direction[j->carried_by]);
    *sigma = f->sigma[j->carried_by];
    return j->carrier == CARRIER_PART && (f->known >> j->carried_by & 1);
}

bool joint_difference(const struct movement_frame *a, const struct movement_frame *b, const struct body_joint *j,
                      double difference[3], double *sigma)
{
    struct vec3 x, y, on_a, on_b;
    double sigma_x, sigma_y, sigma_a, sigma_b, variance;
    if (!direction(a, j, &x, &sigma_x) || !direction(b, j, &y, &sigma_y))
        return false;
    variance = sigma_x * sigma_x + sigma_y * sigma_y;
    if (carrier(a, j, &on_a, &sigma_a) && carrier(b, j, &on_b, &sigma_b)) {
        x = quat_rotate(quat_between(on_a, on_b), x);
        variance += sigma_a * sigma_a + sigma_b * sigma_b;
    }
    const struct vec3 d = v3_sub(y, x);
    difference[0] = d.x;
    difference[1] = d.y;
    difference[2] = d.z;
    *sigma = sqrt(variance);
    return true;
}

// ------------------------------------------------------------- the limb's own time

enum { SHIFT_STEP = 2, SHIFTS_HALF = 9, SHIFTS = 2 * SHIFTS_HALF + 1, SMALL_HALF = 2, WINDOW_HALF = 30 };
// Squared chords of two parts: only where they are 8 degrees off each does it matter when the limb moves.
static const double LEAST_COST = 2 * 0.0195;
// By hand: a lateness explains a difference if less than this share of it remains.
static const double EXPLAINED = 0.45;

static float limb_cost(const struct movement *a, const struct movement *b, const struct timeline *t, int limb,
                       int32_t f, int shift)
{
    if (isnan(t->reference[f]))
        return 0;
    const struct movement_frame x = movement_at(a, (double)t->reference[f] + shift);
    double sum = 0, d[3], sigma;
    for (int k = 0; k < BODY_JOINTS; k++)
        if (body_joints[k].limb == limb && joint_difference(&x, &b->frames[f], &body_joints[k], d, &sigma))
            sum += d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
    return (float)sum;
}

// Sums over WINDOW_HALF frames to both sides, in place.
static void window(float *cost, double *before, int32_t count)
{
    before[0] = 0;
    for (int32_t f = 0; f < count; f++)
        before[f + 1] = before[f] + cost[f];
    for (int32_t f = 0; f < count; f++) {
        const int32_t first = f > WINDOW_HALF ? f - WINDOW_HALF : 0,
                      end = f + WINDOW_HALF + 1 < count ? f + WINDOW_HALF + 1 : count;
        cost[f] = (float)((before[end] - before[first]) / (end - first));
    }
}

static void choose(const float *cost, int32_t count, int32_t f, int8_t *shift, bool *late)
{
    const float *zero = cost + (size_t)SHIFTS_HALF * (size_t)count;
    int small = 0, large = 0;
    float small_cost = zero[f], large_cost = zero[f];
    for (int s = -SHIFTS_HALF; s <= SHIFTS_HALF; s++) {
        const float c = cost[(size_t)(s + SHIFTS_HALF) * (size_t)count + (size_t)f];
        if (abs(s) <= SMALL_HALF && c < small_cost) {
            small_cost = c;
            small = s;
        }
        if (c < large_cost) {
            large_cost = c;
            large = s;
        }
    }
    *late = abs(large) > SMALL_HALF && zero[f] > LEAST_COST && large_cost < EXPLAINED * zero[f];
    *shift = (int8_t)(SHIFT_STEP * (*late ? large : small));
}

enum status limb_shifts(const struct movement *a, const struct movement *b, const struct timeline *t, int limb,
                        int8_t *shift, bool *late)
{
    const int32_t count = t->count;
    float *cost = malloc((size_t)count * SHIFTS * sizeof *cost);
    double *before = malloc(((size_t)count + 1) * sizeof *before);
    if (!cost || !before) {
        free(cost);
        free(before);
        return fail(ERR_MEMORY, "no memory for the limbs' times");
    }
    for (int s = 0; s < SHIFTS; s++) {
        float *of = cost + (size_t)s * (size_t)count;
        for (int32_t f = 0; f < count; f++)
            of[f] = limb_cost(a, b, t, limb, f, SHIFT_STEP * (s - SHIFTS_HALF));
        window(of, before, count);
    }
    for (int32_t f = 0; f < count; f++)
        choose(cost, count, f, &shift[f], &late[f]);
    free(cost);
    free(before);
    return OK;
}
