#include "compare/movement.h"

#include "base/portable_math.h"

#include <assert.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- sliding quantile

static bool is_before(const struct sliding_value *a, const struct sliding_value *b)
{
    return a->value < b->value || (!(a->value > b->value) && a->frame < b->frame);
}

void sliding_add(struct sliding_quantile *quantile, int32_t frame, float value, float weight)
{
    const struct sliding_value added = {value, weight, frame};
    assert(quantile->count < SLIDING_MAX);
    int32_t at = quantile->count++;
    for (; at > 0 && is_before(&added, &quantile->at[at - 1]); at--)
        quantile->at[at] = quantile->at[at - 1];
    quantile->at[at] = added;
}

void sliding_remove(struct sliding_quantile *quantile, int32_t frame)
{
    for (int32_t k = 0; k < quantile->count; k++)
        if (quantile->at[k].frame == frame) {
            memmove(&quantile->at[k], &quantile->at[k + 1], (size_t)(quantile->count - k - 1) * sizeof quantile->at[k]);
            quantile->count--;
            return;
        }
}

double sliding_quantile_of(const struct sliding_quantile *quantile, double sum, double share)
{
    double before = 0;
    for (int32_t k = 0; k < quantile->count; k++) {
        before += quantile->at[k].weight;
        if (before >= share * sum)
            return quantile->at[k].value;
    }
    return NAN;
}

// ---------------------------------------------------------------- angles

const char *body_angle_name(enum body_angle angle)
{
    static const char *const names[BODY_ANGLES] = {
        "left_elbow",    "right_elbow",    "left_knee",  "right_knee",      "left_hip",    "right_hip",
        "left_shoulder", "right_shoulder", "trunk_lean", "trunk_side_lean", "trunk_twist", "head",
    };
    return names[angle];
}

static bool is_known(const struct movement_frame *frame, enum part part) { return frame->known >> part & 1; }

bool trunk_direction(const struct movement_frame *frame, struct vec3 *direction, double *sigma)
{
    struct vec3 sum = {0, 0, 0};
    double variance = 0;
    int used = 0;
    for (enum part p = PART_UPPER_TORSO; p <= PART_LOWER_TORSO; p++)
        if (is_known(frame, p)) {
            sum = v3_add(sum, vec3_from_floats(frame->direction[p]));
            variance += (double)frame->sigma[p] * frame->sigma[p];
            used++;
        }
    *direction = v3_unit(sum);
    *sigma = used ? sqrt(variance) / used : 0;
    return used > 0 && v3_dot(*direction, *direction) > 0; // folded back on itself it points nowhere
}

static double vector_angle(struct vec3 a, struct vec3 b)
{
    return portable_atan2(v3_length(v3_cross(a, b)), v3_dot(a, b));
}

static void set_angle(struct body_angles *out, enum body_angle angle, double rad, double sigma_1, double sigma_2)
{
    out->rad[angle] = (float)rad;
    out->sigma[angle] = (float)sqrt(sigma_1 * sigma_1 + sigma_2 * sigma_2);
}

static void set_bend_angle(struct body_angles *out, enum body_angle angle, const struct movement_frame *frame,
                           enum part near, enum part far)
{
    if (is_known(frame, near) && is_known(frame, far))
        set_angle(out, angle,
                  vector_angle(vec3_from_floats(frame->direction[near]), vec3_from_floats(frame->direction[far])),
                  frame->sigma[near], frame->sigma[far]);
}

// An angle about an axis is read off the direction's component across that axis: where that is short, as of the side
// lean of a person bent level, the angle is ever less certain. Chosen by hand: from half of the length on.
static double sigma_across(double sigma, double a, double b) { return sigma / fmin(1, 2 * sqrt(a * a + b * b)); }

static void trunk_angles(struct body_angles *out, const struct movement_frame *frame, struct vec3 trunk, double sigma)
{
    static const struct {
        enum part part;
        enum body_angle angle;
    } limbs[] = {
        {PART_LEFT_UPPER_ARM, ANGLE_LEFT_SHOULDER},
        {PART_RIGHT_UPPER_ARM, ANGLE_RIGHT_SHOULDER},
        {PART_LEFT_THIGH, ANGLE_LEFT_HIP},
        {PART_RIGHT_THIGH, ANGLE_RIGHT_HIP},
    };
    for (size_t i = 0; i < COUNT_OF(limbs); i++)
        if (is_known(frame, limbs[i].part))
            set_angle(out, limbs[i].angle,
                      vector_angle(v3_scale(trunk, -1), vec3_from_floats(frame->direction[limbs[i].part])), sigma,
                      frame->sigma[limbs[i].part]);
    set_angle(out, ANGLE_LEAN, portable_atan2(trunk.y, trunk.z), sigma_across(sigma, trunk.y, trunk.z), 0);
    set_angle(out, ANGLE_SIDE_LEAN, portable_atan2(trunk.x, trunk.z), sigma_across(sigma, trunk.x, trunk.z), 0);
    if (is_known(frame, PART_HEAD))
        set_angle(out, ANGLE_HEAD, vector_angle(trunk, vec3_from_floats(frame->direction[PART_HEAD])), sigma,
                  frame->sigma[PART_HEAD]);
}

struct body_angles body_angles_of(const struct movement_frame *frame)
{
    struct body_angles out;
    struct vec3 trunk;
    double sigma;
    for (int a = 0; a < BODY_ANGLES; a++)
        out.rad[a] = out.sigma[a] = NAN;
    set_bend_angle(&out, ANGLE_LEFT_ELBOW, frame, PART_LEFT_UPPER_ARM, PART_LEFT_FOREARM);
    set_bend_angle(&out, ANGLE_RIGHT_ELBOW, frame, PART_RIGHT_UPPER_ARM, PART_RIGHT_FOREARM);
    set_bend_angle(&out, ANGLE_LEFT_KNEE, frame, PART_LEFT_THIGH, PART_LEFT_SHIN);
    set_bend_angle(&out, ANGLE_RIGHT_KNEE, frame, PART_RIGHT_THIGH, PART_RIGHT_SHIN);
    const bool have_trunk = trunk_direction(frame, &trunk, &sigma);
    if (have_trunk)
        trunk_angles(&out, frame, trunk, sigma);
    // Turning to the left brings the left shoulder back: y below zero.
    if (frame->known >> PART_COUNT & 1)
        set_angle(&out, ANGLE_TWIST, portable_atan2(-frame->shoulders[1], frame->shoulders[0]),
                  have_trunk ? sigma : 0.1, 0);
    return out;
}

float body_angle_of(const struct movement_frame *frame, enum body_angle angle)
{
    static const struct {
        enum part near, far; // far PART_HEAD: near against the trunk
    } of[ANGLE_LEAN] = {
        [ANGLE_LEFT_ELBOW] = {PART_LEFT_UPPER_ARM, PART_LEFT_FOREARM},
        [ANGLE_RIGHT_ELBOW] = {PART_RIGHT_UPPER_ARM, PART_RIGHT_FOREARM},
        [ANGLE_LEFT_KNEE] = {PART_LEFT_THIGH, PART_LEFT_SHIN},
        [ANGLE_RIGHT_KNEE] = {PART_RIGHT_THIGH, PART_RIGHT_SHIN},
        [ANGLE_LEFT_HIP] = {PART_LEFT_THIGH, PART_HEAD},
        [ANGLE_RIGHT_HIP] = {PART_RIGHT_THIGH, PART_HEAD},
        [ANGLE_LEFT_SHOULDER] = {PART_LEFT_UPPER_ARM, PART_HEAD},
        [ANGLE_RIGHT_SHOULDER] = {PART_RIGHT_UPPER_ARM, PART_HEAD},
    };
    struct vec3 trunk;
    double sigma;
    if (angle >= ANGLE_LEAN)
        return body_angles_of(frame).rad[angle];
    if (!is_known(frame, of[angle].near))
        return NAN;
    if (of[angle].far != PART_HEAD)
        return is_known(frame, of[angle].far) ? (float)vector_angle(vec3_from_floats(frame->direction[of[angle].near]),
                                                                    vec3_from_floats(frame->direction[of[angle].far]))
                                              : NAN;
    return trunk_direction(frame, &trunk, &sigma)
               ? (float)vector_angle(v3_scale(trunk, -1), vec3_from_floats(frame->direction[of[angle].near]))
               : NAN;
}

// The value that would be at `rank` if they were sorted (Hoare's selection); changes their order. No NaN.
static float select_rank(float *values, int32_t count, int32_t rank)
{
    int32_t low = 0, high = count - 1;
    while (low < high) {
        const float pivot = values[low + (high - low) / 2];
        int32_t i = low, k = high;
        while (i <= k) {
            while (values[i] < pivot)
                i++;
            while (pivot < values[k])
                k--;
            if (i > k)
                break;
            const float swap = values[i];
            values[i++] = values[k];
            values[k--] = swap;
        }
        if (rank > k && rank < i)
            return pivot;
        low = rank <= k ? low : i;
        high = rank <= k ? k : high;
    }
    return values[rank];
}

enum status body_angle_ranges(const struct movement *m, int32_t first, int32_t end, const bool *left_out,
                              struct angle_range out[BODY_ANGLES])
{
    const int32_t max = end - first;
    float *values = malloc((size_t)(max > 0 ? max : 1) * BODY_ANGLES * sizeof *values);
    int32_t count[BODY_ANGLES] = {0};
    if (!values)
        return fail(ERR_MEMORY, "no memory for the ranges of angles");
    for (int32_t f = first; f < end; f++) {
        if (left_out[f])
            continue;
        const struct body_angles at = body_angles_of(&m->frames[f]);
        for (int a = 0; a < BODY_ANGLES; a++)
            if (!isnan(at.rad[a]))
                values[(size_t)a * (size_t)max + (size_t)count[a]++] = at.rad[a];
    }
    for (int a = 0; a < BODY_ANGLES; a++) {
        float *of = values + (size_t)a * (size_t)(max > 0 ? max : 0);
        out[a] = (struct angle_range){NAN, NAN};
        if (count[a] < 5)
            continue;
        const int32_t last = count[a] - 1;
        out[a].low = select_rank(of, count[a], (int32_t)((int64_t)last * 3 / 100));
        out[a].high = select_rank(of, count[a], (int32_t)((int64_t)last * 97 / 100));
    }
    free(values);
    return OK;
}

// ---------------------------------------------------------------- movement

static const double PI = 3.14159265358979323846;

void movement_free(struct movement *movement)
{
    free(movement->frames);
    *movement = (struct movement){0};
}

enum status movement_copy(const struct movement *movement, int32_t first, int32_t end, struct movement *out)
{
    *out = *movement;
    out->count = end - first;
    out->frames = malloc((size_t)out->count * sizeof *out->frames);
    if (!out->frames) {
        *out = (struct movement){0};
        return fail(ERR_MEMORY, "no memory for a movement");
    }
    memcpy(out->frames, movement->frames + first, (size_t)out->count * sizeof *out->frames);
    return OK;
}

enum part mirrored_part(enum part p)
{
    static const enum part other[PART_COUNT] = {
        [PART_HEAD] = PART_HEAD,
        [PART_UPPER_TORSO] = PART_UPPER_TORSO,
        [PART_LOWER_TORSO] = PART_LOWER_TORSO,
        [PART_LEFT_UPPER_ARM] = PART_RIGHT_UPPER_ARM,
        [PART_LEFT_FOREARM] = PART_RIGHT_FOREARM,
        [PART_RIGHT_UPPER_ARM] = PART_LEFT_UPPER_ARM,
        [PART_RIGHT_FOREARM] = PART_LEFT_FOREARM,
        [PART_LEFT_THIGH] = PART_RIGHT_THIGH,
        [PART_LEFT_SHIN] = PART_RIGHT_SHIN,
        [PART_RIGHT_THIGH] = PART_LEFT_THIGH,
        [PART_RIGHT_SHIN] = PART_LEFT_SHIN,
    };
    return other[p];
}

// From the end nearer the waist. part_ends has the trunk's from the neck down.
static const struct part_ends outward[PART_COUNT] = {
    [PART_HEAD] = {JOINT_NECK, JOINT_HEAD},
    [PART_UPPER_TORSO] = {JOINT_TORSO, JOINT_NECK},
    [PART_LOWER_TORSO] = {JOINT_WAIST, JOINT_TORSO},
    [PART_LEFT_UPPER_ARM] = {JOINT_LEFT_SHOULDER, JOINT_LEFT_ELBOW},
    [PART_LEFT_FOREARM] = {JOINT_LEFT_ELBOW, JOINT_LEFT_HAND},
    [PART_RIGHT_UPPER_ARM] = {JOINT_RIGHT_SHOULDER, JOINT_RIGHT_ELBOW},
    [PART_RIGHT_FOREARM] = {JOINT_RIGHT_ELBOW, JOINT_RIGHT_HAND},
    [PART_LEFT_THIGH] = {JOINT_LEFT_HIP, JOINT_LEFT_KNEE},
    [PART_LEFT_SHIN] = {JOINT_LEFT_KNEE, JOINT_LEFT_FOOT},
    [PART_RIGHT_THIGH] = {JOINT_RIGHT_HIP, JOINT_RIGHT_KNEE},
    [PART_RIGHT_SHIN] = {JOINT_RIGHT_KNEE, JOINT_RIGHT_FOOT},
};

// ------------------------------------------------------------- one instant

struct upright {
    struct vec3 left, ahead, up;
    double sigma_heading;
};

// By the hips; by the shoulders where a hip is unknown. False: neither pair, or it is vertical.
static bool upright_of(const struct vec3 joint[JOINT_COUNT], const float sigma_m[JOINT_COUNT],
                       const bool known[JOINT_COUNT], struct upright *upright)
{
    static const enum joint pairs[2][2] = {{JOINT_LEFT_HIP, JOINT_RIGHT_HIP},
                                           {JOINT_LEFT_SHOULDER, JOINT_RIGHT_SHOULDER}};
    upright->up = v3(0, -1, 0);
    for (int k = 0; k < 2; k++) {
        const enum joint l = pairs[k][0], r = pairs[k][1];
        if (!known[l] || !known[r])
            continue;
        struct vec3 left = v3_sub(joint[l], joint[r]);
        left.y = 0;
        const double width = v3_length(left);
        if (!(width >= 0.02)) // NaN, too
            continue;
        upright->left = v3_scale(left, 1 / width);
        upright->ahead = v3_cross(upright->left, upright->up);
        // Both ends of a pair move with one rigid pelvis or chest: a half of independent errors remains. By hand.
        upright->sigma_heading = 0.5 * sqrt((double)sigma_m[l] * sigma_m[l] + (double)sigma_m[r] * sigma_m[r]) / width;
        return true;
    }
    return false;
}

static void in_frame(const struct upright *upright, struct vec3 v, float out[3])
{
    out[0] = (float)v3_dot(v, upright->left);
    out[1] = (float)v3_dot(v, upright->ahead);
    out[2] = (float)v3_dot(v, upright->up);
}

// A part's direction errs less than its ends' standard deviations say: both ends err together, and a tracker's
// covariances, which hold 95 % of all errors, the rare gross ones too, are wide for the ordinary one. With the
// verdicts' level (difference.h) chosen on three motions (blows, bending and lifting, a turn), each edited in 13 ways,
// filmed as another person and tracked from depth.
static const double DIRECTION_SHARE = 0.15;

struct measured_joints {
    const struct vec3 *joint; // [JOINT_COUNT]
    const float *sigma_m;
};

static void direction_of(const struct upright *upright, struct measured_joints joints, struct part_ends ends,
                         float direction[3], float *sigma)
{
    const enum joint from = ends.from, to = ends.to;
    const float *sigma_m = joints.sigma_m;
    const struct vec3 v = v3_sub(joints.joint[to], joints.joint[from]);
    const double length = v3_length(v);
    in_frame(upright, v3_unit(v), direction);
    const double across2 =
        ((double)sigma_m[from] * sigma_m[from] + (double)sigma_m[to] * sigma_m[to]) / fmax(length * length, 1e-4);
    const double level2 = (double)direction[0] * direction[0] + (double)direction[1] * direction[1];
    if (sigma)
        *sigma = (float)fmin(PI, DIRECTION_SHARE *
                                     sqrt(across2 + 0.5 * level2 * upright->sigma_heading * upright->sigma_heading));
}

// False for NaN, too.
static bool has_direction(struct vec3 from, struct vec3 to)
{
    const double length = v3_distance(from, to);
    return length >= 1e-3 && isfinite(length);
}

void movement_frame_from_joints(const struct vec3 joint[JOINT_COUNT], const float sigma_m[JOINT_COUNT],
                                const bool known[JOINT_COUNT], struct movement_frame *out)
{
    const struct measured_joints joints = {joint, sigma_m};
    struct upright u;
    *out = (struct movement_frame){0};
    if (!upright_of(joint, sigma_m, known, &u))
        return;
    out->heading = (float)portable_atan2(u.left.z, u.left.x);
    for (int p = 0; p < PART_COUNT; p++) {
        const enum joint from = outward[p].from, to = outward[p].to;
        if (!known[from] || !known[to] || !has_direction(joint[from], joint[to]))
            continue;
        direction_of(&u, joints, (struct part_ends){from, to}, out->direction[p], &out->sigma[p]);
        out->known |= (uint16_t)(1u << p);
    }
    if (known[JOINT_LEFT_SHOULDER] && known[JOINT_RIGHT_SHOULDER] &&
        has_direction(joint[JOINT_LEFT_SHOULDER], joint[JOINT_RIGHT_SHOULDER])) {
        direction_of(&u, joints, (struct part_ends){JOINT_RIGHT_SHOULDER, JOINT_LEFT_SHOULDER}, out->shoulders, NULL);
        out->known |= (uint16_t)(1u << PART_COUNT);
    }
}

// ------------------------------------------------------------- resampling

enum { MAX_GAP_NS = 250000000, KERNEL_HALF = 4 }; // KERNEL_HALF: 2.7 standard deviations of 1.5 frames

// One joint over a block of the movement's frames and KERNEL_HALF more to each side: hours of frames need no more.
enum { BLOCK = 512, LINE = BLOCK + 2 * KERNEL_HALF };
struct joint_line {
    struct vec3 position[LINE]; // interpolated over gaps of any length, held at the ends
    struct vec3 smooth[LINE];
    float sigma_m[LINE];
    bool known[LINE];
    int64_t before, after; // samples that know the joint, about the last frame; -1: none
};

static int64_t next_known(const struct joint_samples *samples, enum joint joint, int64_t from)
{
    while (from < samples->count && !(samples->at[from].skeleton.confidence[joint] > 0))
        from++;
    return from < samples->count ? from : -1;
}

// Frames in their order, one after the other.
static void resample_joint(const struct joint_samples *samples, enum joint joint, int32_t f, struct joint_line *line,
                           int32_t at)
{
    const int64_t time_ns = (int64_t)((double)f * 1e9 / MOVEMENT_RATE_HZ);
    while (line->after >= 0 && samples->at[line->after].time_ns <= time_ns) {
        line->before = line->after;
        line->after = next_known(samples, joint, line->after + 1);
    }
    const int64_t before = line->before, after = line->after;
    line->known[at] = false;
    line->sigma_m[at] = 0;
    line->position[at] = v3(0, 0, 0);
    if (before < 0 && after < 0)
        return;
    const struct joint_sample *sample = &samples->at[before < 0 ? after : before],
                              *b = &samples->at[after < 0 ? before : after];
    const int64_t gap_ns = b->time_ns - sample->time_ns;
    const double t = gap_ns > 0 ? (double)(time_ns - sample->time_ns) / (double)gap_ns : 0;
    line->position[at] = v3_mix(sample->skeleton.joint[joint], b->skeleton.joint[joint], t);
    line->sigma_m[at] = sample->sigma_m[joint] > b->sigma_m[joint] ? sample->sigma_m[joint] : b->sigma_m[joint];
    line->known[at] = gap_ns > 0 ? gap_ns <= MAX_GAP_NS : llabs(time_ns - sample->time_ns) <= MAX_GAP_NS / 2;
}

// All joints over the frames first..end - 1.
struct lines {
    struct joint_line joint[JOINT_COUNT];
    double kernel[KERNEL_HALF + 1];
    int32_t first, end;
};

static struct lines *lines_open(const struct joint_samples *samples)
{
    struct lines *l = calloc(1, sizeof *l);
    for (int k = 0; k <= KERNEL_HALF && l; k++)
        l->kernel[k] = portable_exp(-0.5 * k * k / (1.5 * 1.5));
    for (int j = 0; j < JOINT_COUNT && l; j++) {
        l->joint[j].before = -1;
        l->joint[j].after = next_known(samples, (enum joint)j, 0);
    }
    return l;
}

// On to the frames first..end - 1, which follow or overlap those that are there.
static void lines_move(struct lines *lines, const struct joint_samples *samples, int32_t first, int32_t end)
{
    const int32_t skip = first - lines->first, kept = lines->end - first;
    for (int j = 0; j < JOINT_COUNT; j++) {
        struct joint_line *line = &lines->joint[j];
        memmove(line->position, line->position + skip, (size_t)kept * sizeof *line->position);
        memmove(line->sigma_m, line->sigma_m + skip, (size_t)kept * sizeof *line->sigma_m);
        memmove(line->known, line->known + skip, (size_t)kept * sizeof *line->known);
        for (int32_t f = lines->end; f < end; f++)
            resample_joint(samples, (enum joint)j, f, line, f - first);
    }
    lines->first = first;
    lines->end = end;
}

// Frame f of a movement of `count`.
static void smooth_joint(const struct lines *lines, struct joint_line *line, int32_t f, int32_t count)
{
    struct vec3 sum = {0, 0, 0};
    double weight = 0;
    // As far to one side as to the other, so that an end is not drawn inwards.
    int half = KERNEL_HALF;
    half = f < half ? f : half;
    half = count - 1 - f < half ? count - 1 - f : half;
    for (int k = -half; k <= half; k++) {
        const double w = lines->kernel[abs(k)];
        sum = v3_add(sum, v3_scale(line->position[f - lines->first + k], w));
        weight += w;
    }
    line->smooth[f - lines->first] = v3_scale(sum, 1 / weight);
}

// ------------------------------------------------------------- the whole

static void unwrap_heading(struct movement *movement)
{
    for (int32_t f = 1; f < movement->count; f++) {
        const double turns =
            floor(((double)movement->frames[f].heading - movement->frames[f - 1].heading) / (2 * PI) + 0.5);
        movement->frames[f].heading -= (float)(2 * PI * turns);
    }
}

static int compare_floats(const void *a, const void *b)
{
    const float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

static enum status summarise_movement(struct movement *movement)
{
    float *values = malloc((size_t)movement->count * sizeof *values);
    if (!values)
        return fail(ERR_MEMORY, "no memory for a movement");
    for (int p = 0; p < PART_COUNT; p++) {
        int32_t count = 0;
        for (int32_t f = 0; f < movement->count; f++)
            if (movement->frames[f].known >> p & 1)
                values[count++] = movement->frames[f].sigma[p];
        if (count)
            qsort(values, (size_t)count, sizeof *values, compare_floats);
        movement->sigma_typical[p] = count ? values[count / 2] : 0;
        if (count > 0 && 10 * (int64_t)count >= movement->count)
            movement->ever_known |= (uint16_t)(1u << p);
    }
    free(values);
    return OK;
}

// Directions over gaps come from bridged joints and are marked unknown.
static void frame_of(const struct lines *lines, const bool ever[JOINT_COUNT], int32_t f, struct movement_frame *out)
{
    const int32_t at = f - lines->first;
    struct vec3 joint[JOINT_COUNT];
    float sigma_m[JOINT_COUNT];
    for (int j = 0; j < JOINT_COUNT; j++) {
        joint[j] = lines->joint[j].smooth[at];
        sigma_m[j] = lines->joint[j].sigma_m[at];
    }
    movement_frame_from_joints(joint, sigma_m, ever, out);
    const bool hips = lines->joint[JOINT_LEFT_HIP].known[at] && lines->joint[JOINT_RIGHT_HIP].known[at],
               shoulders = lines->joint[JOINT_LEFT_SHOULDER].known[at] && lines->joint[JOINT_RIGHT_SHOULDER].known[at];
    for (int p = 0; p < PART_COUNT; p++)
        if (!lines->joint[outward[p].from].known[at] || !lines->joint[outward[p].to].known[at] || !(hips || shoulders))
            out->known &= (uint16_t) ~(1u << p);
    if (!shoulders)
        out->known &= (uint16_t) ~(1u << PART_COUNT);
}

// Fills all frames, and counts those that know a joint.
static void fill_frames(const struct joint_samples *samples, const bool ever[JOINT_COUNT], struct lines *lines,
                        struct movement *out, int64_t known[JOINT_COUNT])
{
    for (int32_t first = 0; first < out->count; first += BLOCK) {
        const int32_t end = out->count - first > BLOCK ? first + BLOCK : out->count;
        lines_move(lines, samples, first > KERNEL_HALF ? first - KERNEL_HALF : 0,
                   out->count - end > KERNEL_HALF ? end + KERNEL_HALF : out->count);
        for (int32_t f = first; f < end; f++) {
            for (int j = 0; j < JOINT_COUNT; j++) {
                smooth_joint(lines, &lines->joint[j], f, out->count);
                known[j] += lines->joint[j].known[f - lines->first];
            }
            frame_of(lines, ever, f, &out->frames[f]);
        }
    }
}

enum status movement_from_samples(const struct joint_samples *samples, struct movement *out)
{
    bool ever[JOINT_COUNT] = {0};
    *out = (struct movement){0};
    for (int64_t i = 0; i < samples->count; i++)
        for (int j = 0; j < JOINT_COUNT; j++)
            ever[j] = ever[j] || samples->at[i].skeleton.confidence[j] > 0;
    if (!(ever[JOINT_LEFT_HIP] && ever[JOINT_RIGHT_HIP]) && !(ever[JOINT_LEFT_SHOULDER] && ever[JOINT_RIGHT_SHOULDER]))
        return fail(ERR_INPUT,
                    "neither both hips nor both shoulders are known at any time, so there is nothing to compare");
    const double seconds = (double)samples->at[samples->count - 1].time_ns * 1e-9;
    if (seconds > MOVEMENT_HOURS_MAX * 3600.0)
        return fail(ERR_INPUT, "a movement of %.1f hours cannot be compared; at most %d are", seconds / 3600,
                    MOVEMENT_HOURS_MAX);
    out->sigma_given = samples->sigma_given;
    out->count = (int32_t)(seconds * MOVEMENT_RATE_HZ + 1e-6) + 1;
    out->frames = calloc((size_t)out->count, sizeof *out->frames);
    struct lines *lines = lines_open(samples);
    int64_t known[JOINT_COUNT] = {0};
    enum status status = lines && out->frames ? OK : fail(ERR_MEMORY, "no memory for a movement");
    if (status == OK)
        fill_frames(samples, ever, lines, out, known);
    for (int j = 0; j < JOINT_COUNT && status == OK; j++) {
        out->joints_ever |= (uint16_t)(ever[j] << j);
        out->joints_often |= (uint16_t)((10 * known[j] >= out->count) << j);
    }
    if (status == OK) {
        unwrap_heading(out);
        status = summarise_movement(out);
    }
    free(lines);
    if (status != OK)
        movement_free(out);
    return status;
}

enum status movement_read(const char *path, const char *take, struct movement *out, struct movement_source *source)
{
    struct joint_samples samples = {0};
    *out = (struct movement){0};
    *source = (struct movement_source){0};
    enum status status;
    if (!is_joints_file(path))
        status = joint_samples_read_take(path, take, &samples);
    else if (take)
        return fail(ERR_INPUT, "%s is a file of joints and holds no takes; leave the take's name out", path);
    else
        status = joint_samples_read_file(path, &samples);
    if (status == OK) {
        source->frames_side_mended = joint_samples_mend_sides(&samples);
        source->frames_dropped = samples.dropped;
        source->clock_jumps = samples.jumps;
        source->began_ns = samples.began_ns;
        source->tilt_rad = samples.tilt_rad;
        source->tilt_by_floor = samples.tilt_by_floor;
        source->notes = samples.notes;
        status = movement_from_samples(&samples, out);
    }
    if (status == ERR_INPUT && samples.count)
        status = fail(ERR_INPUT, "%s: %s", path, status_message());
    joint_samples_free(&samples);
    return status;
}

static enum joint mirrored_joint(enum joint joint)
{
    const bool arm = joint >= JOINT_LEFT_SHOULDER && joint <= JOINT_RIGHT_HAND, leg = joint >= JOINT_LEFT_HIP;
    const bool left = arm ? joint < JOINT_RIGHT_SHOULDER : joint < JOINT_RIGHT_HIP;
    const int across = JOINT_RIGHT_SHOULDER - JOINT_LEFT_SHOULDER;
    if (!arm && !leg)
        return joint;
    return (enum joint)(left ? (int)joint + across : (int)joint - across);
}

enum status movement_mirror(const struct movement *m, struct movement *out)
{
    *out = *m;
    out->frames = malloc((size_t)m->count * sizeof *out->frames);
    if (!out->frames) {
        *out = (struct movement){0};
        return fail(ERR_MEMORY, "no memory for a mirrored movement");
    }
    out->ever_known = out->joints_ever = out->joints_often = 0;
    for (int j = 0; j < JOINT_COUNT; j++) {
        const enum joint own = mirrored_joint((enum joint)j);
        out->joints_ever |= (uint16_t)((m->joints_ever >> own & 1) << j);
        out->joints_often |= (uint16_t)((m->joints_often >> own & 1) << j);
    }
    for (int p = 0; p < PART_COUNT; p++) {
        out->sigma_typical[p] = m->sigma_typical[mirrored_part((enum part)p)];
        out->ever_known |= (uint16_t)((m->ever_known >> mirrored_part((enum part)p) & 1) << p);
    }
    for (int32_t f = 0; f < m->count; f++) {
        const struct movement_frame *from = &m->frames[f];
        struct movement_frame *to = &out->frames[f];
        to->known = (uint16_t)(from->known & 1u << PART_COUNT);
        to->heading = -from->heading;
        // Reversed, because its ends exchange names, and then mirrored.
        to->shoulders[0] = from->shoulders[0];
        to->shoulders[1] = -from->shoulders[1];
        to->shoulders[2] = -from->shoulders[2];
        for (int p = 0; p < PART_COUNT; p++) {
            const enum part q = mirrored_part((enum part)p);
            to->direction[p][0] = -from->direction[q][0];
            to->direction[p][1] = from->direction[q][1];
            to->direction[p][2] = from->direction[q][2];
            to->sigma[p] = from->sigma[q];
            to->known |= (uint16_t)((from->known >> q & 1) << p);
        }
    }
    return OK;
}

void movement_equal_say(const struct movement *movement, double scale[PART_COUNT])
{
    for (int p = 0; p < PART_COUNT; p++) {
        double sum[3] = {0}, count = 0;
        for (int32_t f = 0; f < movement->count; f++) {
            if (!(movement->frames[f].known >> p & 1))
                continue;
            for (int k = 0; k < 3; k++)
                sum[k] += movement->frames[f].direction[p][k];
            count++;
        }
        const double mean2 = count > 0 ? (sum[0] * sum[0] + sum[1] * sum[1] + sum[2] * sum[2]) / (count * count) : 1;
        scale[p] = 1 / sqrt(1 + fmax(0, 1 - mean2) / 0.1);
    }
}

enum status movement_features(const struct movement *m, uint16_t parts, const double *scale,
                              struct feature_frame **frames)
{
    static_assert(3 * PART_COUNT <= FEATURE_NUMBERS, "a feature frame holds all parts");
    *frames = calloc((size_t)m->count, sizeof **frames);
    if (!*frames)
        return fail(ERR_MEMORY, "no memory for a movement's features");
    for (int32_t f = 0; f < m->count; f++)
        for (int p = 0; p < PART_COUNT; p++)
            for (int k = 0; k < 3 && (parts >> p & 1); k++)
                (*frames)[f].number[3 * p + k] =
                    (int16_t)floor(m->frames[f].direction[p][k] * FEATURE_UNIT * (scale ? scale[p] : 1) + 0.5);
    return OK;
}
