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

// Columns of m: across (left), along x across, along: the trunk's direction and the shoulders' line.
static bool chest(const struct movement_frame *f, double m[3][3], double *sigma)
{
    struct vec3 along;
    if (!(f->known >> PART_COUNT & 1) || !trunk_direction(f, &along, sigma))
        return false;
    const struct vec3 shoulders = vector(f->shoulders),
                      across = v3_unit(v3_sub(shoulders, v3_scale(along, v3_dot(shoulders, along)))),
                      ahead = v3_cross(along, across);
    const struct vec3 columns[3] = {across, ahead, along};
    for (int k = 0; k < 3; k++) {
        m[0][k] = columns[k].x;
        m[1][k] = columns[k].y;
        m[2][k] = columns[k].z;
    }
    return v3_length(across) > 0.5;
}

// The rotation that takes A's chest to B's; by the trunk's direction alone where the shoulders are unknown.
static struct quat chest_rotation(const struct movement_frame *a, const struct movement_frame *b, double *variance)
{
    double x[3][3], y[3][3], rotation[3][3];
    double sigma_x = 0, sigma_y = 0;
    struct vec3 from, to;
    struct quat q = {0, 0, 0, 1};
    if (chest(a, x, &sigma_x) && chest(b, y, &sigma_y)) {
        for (int r = 0; r < 3; r++)
            for (int k = 0; k < 3; k++)
                rotation[r][k] = y[r][0] * x[k][0] + y[r][1] * x[k][1] + y[r][2] * x[k][2];
        q = quat_from_matrix(rotation);
    } else if (trunk_direction(a, &from, &sigma_x) && trunk_direction(b, &to, &sigma_y)) {
        q = quat_between(from, to);
    }
    *variance += sigma_x * sigma_x + sigma_y * sigma_y;
    return q;
}

bool joint_difference(const struct movement_frame *a, const struct movement_frame *b, const struct body_joint *j,
                      double difference[3], double *sigma)
{
    struct vec3 x, y;
    double sigma_x, sigma_y;
    if (!direction(a, j, &x, &sigma_x) || !direction(b, j, &y, &sigma_y))
        return false;
    double variance = sigma_x * sigma_x + sigma_y * sigma_y;
    if (j->carrier == CARRIER_TRUNK || j->limb == 0 || j->limb == 1) {
        double of_chest = 0;
        const struct quat q = chest_rotation(a, b, j->carrier == CARRIER_TRUNK ? &variance : &of_chest);
        x = quat_rotate(q, x);
        if (j->carrier == CARRIER_PART && (a->known & b->known & 1u << j->carried_by))
            x = quat_rotate(
                quat_between(quat_rotate(q, vector(a->direction[j->carried_by])), vector(b->direction[j->carried_by])),
                x);
    } else if (j->carrier == CARRIER_PART && (a->known & b->known & 1u << j->carried_by)) {
        x = quat_rotate(quat_between(vector(a->direction[j->carried_by]), vector(b->direction[j->carried_by])), x);
    }
    if (j->carrier == CARRIER_PART)
        variance += (double)a->sigma[j->carried_by] * a->sigma[j->carried_by] +
                    (double)b->sigma[j->carried_by] * b->sigma[j->carried_by];
    const struct vec3 d = v3_sub(y, x);
    difference[0] = d.x;
    difference[1] = d.y;
    difference[2] = d.z;
    *sigma = sqrt(variance);
    return true;
}

// ------------------------------------------------------------- the limb's own time

enum { SHIFT_STEP = 1, SHIFTS_HALF = 15, SHIFTS = 2 * SHIFTS_HALF + 1, SMALL_HALF = 4, WINDOW_HALF = 30 };
// Squared chords of two parts: only where they are 8 degrees off each does it matter when the limb moves.
static const double LEAST_COST = 2 * 0.0195;
// By hand: a lateness explains a difference if less than this share of it remains.
static const double EXPLAINED = 0.55;
// A difference that is known to 5 degrees counts half; by hand.
static const double TRUSTED = 0.0076;

static float limb_cost(const struct movement *a, const struct movement *b, const struct timeline *t, int limb,
                       int32_t f, int shift)
{
    if (isnan(t->reference[f]))
        return 0;
    const struct movement_frame x = movement_at(a, (double)t->reference[f] + shift);
    double sum = 0, d[3], sigma;
    for (int k = 0; k < BODY_JOINTS; k++)
        if (body_joints[k].limb == limb && joint_difference(&x, &b->frames[f], &body_joints[k], d, &sigma))
            sum += (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]) * TRUSTED / (TRUSTED + sigma * sigma);
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
