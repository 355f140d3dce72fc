#include "compare/difference.h"

#include "base/portable_math.h"
#include "base/threads.h"

#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- limb times

const struct body_joint body_joints[BODY_JOINTS] = {
    {PART_UPPER_TORSO, CARRIER_NONE, PART_UPPER_TORSO, ANGLE_LEAN, -1},
    {PART_UPPER_TORSO, CARRIER_NONE, PART_UPPER_TORSO, ANGLE_TWIST, -1},
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

static bool joint_direction(const struct movement_frame *frame, const struct body_joint *joint, struct vec3 *d,
                            double *sigma)
{
    if (joint->part == PART_UPPER_TORSO) {
        if (!trunk_direction(frame, d, sigma))
            return false;
        if (joint->angle == ANGLE_TWIST) // about as wide as the trunk is high: taken for as exact
            *d = vec3_from_floats(frame->shoulders);
        return joint->angle != ANGLE_TWIST || frame->known >> PART_COUNT & 1;
    }
    *d = vec3_from_floats(frame->direction[joint->part]);
    *sigma = frame->sigma[joint->part];
    return frame->known >> joint->part & 1;
}

// Columns of m: across (left), along x across, along: the trunk's direction and the shoulders' line.
static bool chest_axes(const struct movement_frame *frame, double m[3][3], double *sigma)
{
    struct vec3 along;
    if (!(frame->known >> PART_COUNT & 1) || !trunk_direction(frame, &along, sigma))
        return false;
    const struct vec3 shoulders = vec3_from_floats(frame->shoulders),
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

bool chest_from_upright(const struct movement_frame *frame, struct quat *rotation)
{
    double m[3][3], sigma;
    if (!chest_axes(frame, m, &sigma))
        return false;
    *rotation = quat_conjugate(quat_from_matrix(m));
    return true;
}

// The rotation that takes A's chest to B's; by the trunk's direction alone where the shoulders are unknown.
static struct quat chest_rotation(const struct movement_frame *a, const struct movement_frame *b, double *variance)
{
    double x[3][3], y[3][3], rotation[3][3];
    double sigma_x = 0, sigma_y = 0;
    struct vec3 from, to;
    struct quat q = {0, 0, 0, 1};
    if (chest_axes(a, x, &sigma_x) && chest_axes(b, y, &sigma_y)) {
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

// How A's chest has to be turned onto B's, and what that adds to a variance.
struct chest_turn {
    struct quat rotation;
    double variance;
};

static struct chest_turn chest_turn_of(const struct movement_frame *a, const struct movement_frame *b)
{
    struct chest_turn t = {.variance = 0};
    t.rotation = chest_rotation(a, b, &t.variance);
    return t;
}

static bool needs_chest(const struct body_joint *joint)
{
    return joint->carrier == CARRIER_TRUNK || joint->limb == 0 || joint->limb == 1;
}

// turn: used where needs_chest().
static bool difference_with(const struct movement_frame *a, const struct movement_frame *b,
                            const struct body_joint *joint, const struct chest_turn *turn, double difference[3],
                            double *sigma)
{
    struct vec3 x, y;
    double sigma_x, sigma_y;
    if (!joint_direction(a, joint, &x, &sigma_x) || !joint_direction(b, joint, &y, &sigma_y))
        return false;
    double variance = sigma_x * sigma_x + sigma_y * sigma_y;
    if (needs_chest(joint)) {
        const struct quat q = turn->rotation;
        variance += joint->carrier == CARRIER_TRUNK ? turn->variance : 0;
        x = quat_rotate(q, x);
        if (joint->carrier == CARRIER_PART && (a->known & b->known & 1u << joint->carried_by))
            x = quat_rotate(quat_between(quat_rotate(q, vec3_from_floats(a->direction[joint->carried_by])),
                                         vec3_from_floats(b->direction[joint->carried_by])),
                            x);
    } else if (joint->carrier == CARRIER_PART && (a->known & b->known & 1u << joint->carried_by)) {
        x = quat_rotate(quat_between(vec3_from_floats(a->direction[joint->carried_by]),
                                     vec3_from_floats(b->direction[joint->carried_by])),
                        x);
    }
    if (joint->carrier == CARRIER_PART)
        variance += (double)a->sigma[joint->carried_by] * a->sigma[joint->carried_by] +
                    (double)b->sigma[joint->carried_by] * b->sigma[joint->carried_by];
    const struct vec3 d = v3_sub(y, x);
    difference[0] = d.x;
    difference[1] = d.y;
    difference[2] = d.z;
    *sigma = sqrt(variance);
    return true;
}

bool joint_difference(const struct movement_frame *a, const struct movement_frame *b, const struct body_joint *joint,
                      double difference[3], double *sigma)
{
    struct chest_turn turn = {{0, 0, 0, 1}, 0};
    if (needs_chest(joint))
        turn = chest_turn_of(a, b);
    return difference_with(a, b, joint, &turn, difference, sigma);
}

// ------------------------------------------------------------- the limb's own time

enum { SHIFTS_HALF = 15, SHIFTS = 2 * SHIFTS_HALF + 1, SMALL_HALF = 4, WINDOW_HALF = 30, RING = 64 };
// Instants whose costs are made at once, by how many threads at most, and so few that a thread costs more than it
// gains.
enum { BLOCK = 1024, SHARES = 4, MIN_FOR_THREAD = 256 };
// Of attempts above ten minutes fewer frames are looked at, down to five a second: a window of two seconds holds ten.
enum { MANY_FRAMES = 18000, MAX_STRIDE = 6 };
// Squared chords of two parts: only where they are 8 degrees off each does it matter when the limb moves.
static const double MIN_COST = 2 * 0.0195;
// By hand: a lateness explains a difference if less than this share of it remains, and of it less what is in its mean:
// as a joint comes to be held otherwise, it seems late or early, too.
static const double EXPLAINED = 0.55;
// A difference that is known to 5 degrees counts half; by hand.
static const double TRUSTED = 0.0076;

// What the limbs cost at an instant of the attempt, for every shift; and without one how their joints differ.
struct limb_costs {
    float at[SHIFTS][LIMBS];
    float joint[BODY_JOINTS][4]; // weight, and the difference times that
};

static void add_costs(const struct movement *a, const struct movement *b, const struct timeline *timeline, int32_t f,
                      uint16_t ignored, struct limb_costs *out)
{
    memset(out->joint, 0, sizeof out->joint);
    for (int s = 0; s < SHIFTS; s++) {
        double sum[LIMBS] = {0}, d[3], sigma;
        if (!isnan(timeline->reference[f])) {
            const struct movement_frame x = movement_at(a, (double)timeline->reference[f] + (s - SHIFTS_HALF));
            const struct chest_turn turn = chest_turn_of(&x, &b->frames[f]);
            for (int k = 0; k < BODY_JOINTS; k++) {
                if (body_joints[k].limb < 0 || (ignored >> body_joints[k].part & 1) ||
                    !difference_with(&x, &b->frames[f], &body_joints[k], &turn, d, &sigma))
                    continue;
                const double weight = TRUSTED / (TRUSTED + sigma * sigma);
                sum[body_joints[k].limb] += (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]) * weight;
                for (int axis = 0; axis < 4 && s == SHIFTS_HALF; axis++)
                    out->joint[k][axis] = (float)(weight * (axis ? d[axis - 1] : 1));
            }
        }
        for (int limb = 0; limb < LIMBS; limb++)
            out->at[s][limb] = (float)sum[limb];
    }
}

// Sums of the costs before each of the last RING instants.
struct sums {
    double before[RING][SHIFTS][LIMBS];
    double joint[RING][BODY_JOINTS][4];
};

static void push_costs(struct sums *sums, int32_t at, const struct limb_costs *costs)
{
    for (int k = 0; k < SHIFTS; k++)
        for (int limb = 0; limb < LIMBS; limb++)
            sums->before[(at + 1) % RING][k][limb] = sums->before[at % RING][k][limb] + costs->at[k][limb];
    for (int k = 0; k < BODY_JOINTS; k++)
        for (int axis = 0; axis < 4; axis++)
            sums->joint[(at + 1) % RING][k][axis] = sums->joint[at % RING][k][axis] + costs->joint[k][axis];
}

// What of a limb's cost over the instants first..end - 1 is in the joints' mean differences.
static double offset_cost(const struct sums *sums, int32_t first, int32_t end, int limb)
{
    double cost = 0;
    for (int k = 0; k < BODY_JOINTS; k++) {
        double sum[4];
        if (body_joints[k].limb != limb)
            continue;
        for (int axis = 0; axis < 4; axis++)
            sum[axis] = sums->joint[end % RING][k][axis] - sums->joint[first % RING][k][axis];
        if (sum[0] > 0)
            cost += (sum[1] * sum[1] + sum[2] * sum[2] + sum[3] * sum[3]) / sum[0];
    }
    return cost / (end - first);
}

// The shift of one limb over the instants first..end - 1.
static int8_t choose_shift(const struct sums *sums, int32_t first, int32_t end, int limb, bool *late)
{
    float cost[SHIFTS];
    int small = 0, large = 0;
    for (int k = 0; k < SHIFTS; k++)
        cost[k] = (float)((sums->before[end % RING][k][limb] - sums->before[first % RING][k][limb]) / (end - first));
    const float zero = cost[SHIFTS_HALF];
    float small_cost = zero, large_cost = zero;
    for (int k = -SHIFTS_HALF; k <= SHIFTS_HALF; k++) {
        const float c = cost[k + SHIFTS_HALF];
        if (abs(k) <= SMALL_HALF && c < small_cost) {
            small_cost = c;
            small = k;
        }
        if (c < large_cost) {
            large_cost = c;
            large = k;
        }
    }
    const bool fits = abs(large) > SMALL_HALF && zero > MIN_COST && large_cost < EXPLAINED * zero;
    *late = fits && large_cost < EXPLAINED * (zero - offset_cost(sums, first, end, limb));
    return (int8_t)(fits ? large : small);
}

// Costs of the next instants, made ahead by several threads.
struct cost_block {
    const struct movement *a, *b;
    const struct timeline *timeline;
    int32_t stride, first, end; // instants
    uint16_t ignored;
    struct limb_costs cost[BLOCK];
};

static void cost_share(void *context, int share)
{
    struct cost_block *block = context;
    const int32_t end = block->first + (share + 1) * (BLOCK / SHARES);
    for (int32_t n = block->first + share * (BLOCK / SHARES); n < end && n < block->end; n++)
        add_costs(block->a, block->b, block->timeline, n * block->stride, block->ignored,
                  &block->cost[n - block->first]);
}

enum status limb_shifts(const struct movement *a, const struct movement *b, const struct timeline *t, uint16_t ignored,
                        struct limb_shift *out[LIMBS])
{
    const int32_t stride = t->count / MANY_FRAMES < MAX_STRIDE ? 1 + t->count / MANY_FRAMES : MAX_STRIDE,
                  count = (t->count + stride - 1) / stride, half = WINDOW_HALF / stride;
    struct sums *sums = calloc(1, sizeof *sums);
    struct cost_block *block = calloc(1, sizeof *block);
    if (!sums || !block) {
        free(sums);
        free(block);
        return fail(ERR_MEMORY, "no memory for the limbs' times");
    }
    block->a = a;
    block->b = b;
    block->timeline = t;
    block->stride = stride;
    block->ignored = ignored;
    for (int32_t n = 0, ahead = 0; n < count; n++) {
        const int32_t first = n > half ? n - half : 0, end = n + half + 1 < count ? n + half + 1 : count;
        for (; ahead < end; ahead++) {
            if (ahead == block->end) {
                block->first = ahead;
                block->end = ahead + BLOCK < count ? ahead + BLOCK : count;
                parallel_for((block->end - ahead) / MIN_FOR_THREAD, SHARES, cost_share, block);
            }
            push_costs(sums, ahead, &block->cost[ahead - block->first]);
        }
        for (int limb = 0; limb < LIMBS; limb++) {
            struct limb_shift chosen;
            chosen.frames = choose_shift(sums, first, end, limb, &chosen.late);
            for (int32_t f = n * stride; f < (n + 1) * stride && f < t->count; f++)
                out[limb][f] = chosen;
        }
    }
    free(sums);
    free(block);
    return OK;
}

// ---------------------------------------------------------------- difference

const char *verdict_name(enum verdict verdict)
{
    switch (verdict) {
    case VERDICT_SAME: return "same";
    case VERDICT_DIFFERENT: return "different";
    case VERDICT_UNKNOWN: break;
    }
    return "unknown";
}

enum verdict verdict_of(double angle_rad, double sigma_rad)
{
    return verdict_within(angle_rad, sigma_rad, DIFFERENT_RAD);
}

enum verdict verdict_within(double angle_rad, double sigma_rad, double different_rad)
{
    const double quantile = 0.613; // of the normal distribution, for VERDICT_LEVEL
    const double max_sigma = 1.7 * DIFFERENT_RAD;
    if (!(sigma_rad >= 0 && sigma_rad <= max_sigma) || !isfinite(angle_rad))
        return VERDICT_UNKNOWN;
    if (angle_rad - quantile * sigma_rad >= different_rad)
        return VERDICT_DIFFERENT;
    return angle_rad + quantile * sigma_rad < different_rad ? VERDICT_SAME : VERDICT_UNKNOWN;
}

void timeline_free(struct timeline *timeline)
{
    free(timeline->reference);
    *timeline = (struct timeline){0};
}

// The frame of A for the pairs first .. end - 1, which share one frame of B.
static float reference_of(const struct alignment *alignment, int32_t first, int32_t end, const struct features *a,
                          const struct features *b)
{
    enum { SHORT = 6 };
    if (end - first <= SHORT)
        return 0.5f * (float)(alignment->pairs[first].a + alignment->pairs[end - 1].a);
    int32_t best = first, min = INT32_MAX;
    for (int32_t k = first; k < end; k++) {
        const int32_t c = feature_cost(&a->frames[alignment->pairs[k].a], &b->frames[alignment->pairs[k].b]);
        if (c < min) {
            min = c;
            best = k;
        }
    }
    return (float)alignment->pairs[best].a;
}

// A mean over 5 frames, except where the path jumps.
static void smooth_timeline(struct timeline *timeline, const float *raw)
{
    for (int32_t j = 0; j < timeline->count; j++) {
        float sum = 0;
        int used = 0;
        for (int k = 1; k <= 2; k++) {
            if (j - k < 0 || j + k >= timeline->count || isnan(raw[j - k]) || isnan(raw[j + k]))
                break;
            if (raw[j + k] - raw[j - k] > 6 * k + 4)
                break;
            sum += raw[j - k] + raw[j + k];
            used += 2;
        }
        timeline->reference[j] = (sum + raw[j]) / (float)(used + 1);
    }
}

enum status timeline_from_alignment(const struct alignment *x, const struct features *a, const struct features *b,
                                    struct timeline *out)
{
    out->count = b->count;
    out->reference = malloc((size_t)b->count * sizeof *out->reference);
    float *raw = malloc((size_t)b->count * sizeof *raw);
    if (!out->reference || !raw) {
        free(raw);
        timeline_free(out);
        return fail(ERR_MEMORY, "no memory for the times of two movements");
    }
    for (int32_t j = 0; j < b->count; j++)
        raw[j] = NAN;
    for (int32_t first = 0, end; first < x->count; first = end) {
        for (end = first + 1; end < x->count && x->pairs[end].b == x->pairs[first].b;)
            end++;
        raw[x->pairs[first].b] = reference_of(x, first, end, a, b);
    }
    smooth_timeline(out, raw);
    free(raw);
    return OK;
}

struct movement_frame movement_at(const struct movement *movement, double frame)
{
    frame = fmax(0, fmin(movement->count - 1, frame));
    const int32_t i = (int32_t)frame, k = i + 1 < movement->count ? i + 1 : i;
    const float t = (float)(frame - i);
    const struct movement_frame *a = &movement->frames[i], *b = &movement->frames[k];
    struct movement_frame out = *a;
    if (t == 0)
        return out;
    out.known = a->known & b->known;
    out.heading = a->heading + t * (b->heading - a->heading);
    for (int p = 0; p <= PART_COUNT; p++) {
        const float *x = p < PART_COUNT ? a->direction[p] : a->shoulders,
                    *y = p < PART_COUNT ? b->direction[p] : b->shoulders;
        float *to = p < PART_COUNT ? out.direction[p] : out.shoulders;
        float length2 = 0;
        for (int k2 = 0; k2 < 3; k2++) {
            to[k2] = x[k2] + t * (y[k2] - x[k2]);
            length2 += to[k2] * to[k2];
        }
        for (int k2 = 0; k2 < 3 && length2 > 1e-12f; k2++)
            to[k2] /= sqrtf(length2);
        if (p < PART_COUNT)
            out.sigma[p] = a->sigma[p] > b->sigma[p] ? a->sigma[p] : b->sigma[p];
    }
    return out;
}

enum { AVERAGE_HALF = 2 };

void part_differences(const struct movement *a, const struct movement *b, const struct timeline *timeline,
                      int32_t frame, struct part_difference out[PART_COUNT])
{
    double sum[PART_COUNT][3] = {{0}};
    int used[PART_COUNT] = {0};
    for (int p = 0; p < PART_COUNT; p++)
        out[p] = (struct part_difference){NAN, NAN, VERDICT_UNKNOWN};
    if (isnan(timeline->reference[frame]))
        return;
    for (int32_t f = frame - AVERAGE_HALF; f <= frame + AVERAGE_HALF; f++) {
        if (f < 0 || f >= timeline->count || isnan(timeline->reference[f]))
            continue;
        const struct movement_frame x = movement_at(a, timeline->reference[f]), *y = &b->frames[f];
        for (int p = 0; p < PART_COUNT; p++) {
            if (!(x.known & y->known & 1u << p))
                continue;
            for (int k = 0; k < 3; k++)
                sum[p][k] += (double)y->direction[p][k] - x.direction[p][k];
            used[p]++;
            if (f == frame)
                out[p].sigma_rad = (float)sqrt((double)x.sigma[p] * x.sigma[p] + (double)y->sigma[p] * y->sigma[p]);
        }
    }
    for (int p = 0; p < PART_COUNT; p++) {
        if (isnan(out[p].sigma_rad))
            continue;
        const double chord = sqrt(sum[p][0] * sum[p][0] + sum[p][1] * sum[p][1] + sum[p][2] * sum[p][2]) / used[p];
        const double angle = 2 * portable_asin(fmin(1, 0.5 * chord)), sigma = out[p].sigma_rad;
        out[p].angle_rad = (float)sqrt(fmax(0, angle * angle - sigma * sigma));
        out[p].verdict = verdict_of(out[p].angle_rad, out[p].sigma_rad);
    }
}

void part_differences_judge(struct part_difference parts[PART_COUNT], const struct tolerances *by)
{
    for (int p = 0; p < PART_COUNT; p++) {
        const double different_rad = by->threshold[p] * DIFFERENT_RAD;
        parts[p].verdict = by->ignored >> p & 1 ? VERDICT_UNKNOWN
                                                : verdict_within(parts[p].angle_rad, parts[p].sigma_rad, different_rad);
    }
}
