#include "compare/angles.h"

#include "base/portable_math.h"

#include <stdlib.h>

const char *body_angle_name(enum body_angle a)
{
    static const char *const names[BODY_ANGLES] = {
        "left_elbow",    "right_elbow",    "left_knee",  "right_knee",      "left_hip",    "right_hip",
        "left_shoulder", "right_shoulder", "trunk_lean", "trunk_side_lean", "trunk_twist", "head",
    };
    return names[a];
}

static struct vec3 vector(const float d[3]) { return v3(d[0], d[1], d[2]); }

static bool is_known(const struct movement_frame *f, enum part p) { return f->known >> p & 1; }

bool trunk_direction(const struct movement_frame *f, struct vec3 *direction, double *sigma)
{
    struct vec3 sum = {0, 0, 0};
    double variance = 0;
    int used = 0;
    for (enum part p = PART_UPPER_TORSO; p <= PART_LOWER_TORSO; p++)
        if (is_known(f, p)) {
            sum = v3_add(sum, vector(f->direction[p]));
            variance += (double)f->sigma[p] * f->sigma[p];
            used++;
        }
    *direction = v3_unit(sum);
    *sigma = used ? sqrt(variance) / used : 0;
    return used > 0 && v3_dot(*direction, *direction) > 0; // folded back on itself it points nowhere
}

static double between(struct vec3 a, struct vec3 b) { return portable_atan2(v3_length(v3_cross(a, b)), v3_dot(a, b)); }

static void set(struct body_angles *out, enum body_angle a, double rad, double sigma_1, double sigma_2)
{
    out->rad[a] = (float)rad;
    out->sigma[a] = (float)sqrt(sigma_1 * sigma_1 + sigma_2 * sigma_2);
}

static void bend(struct body_angles *out, enum body_angle a, const struct movement_frame *f, enum part near,
                 enum part far)
{
    if (is_known(f, near) && is_known(f, far))
        set(out, a, between(vector(f->direction[near]), vector(f->direction[far])), f->sigma[near], f->sigma[far]);
}

// An angle about an axis is read off the direction's component across that axis: where that is short, as of the side
// lean of a person bent level, the angle is ever less certain. Chosen by hand: from half of the length on.
static double sigma_across(double sigma, double a, double b) { return sigma / fmin(1, 2 * sqrt(a * a + b * b)); }

static void trunk_angles(struct body_angles *out, const struct movement_frame *f, struct vec3 trunk, double sigma)
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
        if (is_known(f, limbs[i].part))
            set(out, limbs[i].angle, between(v3_scale(trunk, -1), vector(f->direction[limbs[i].part])), sigma,
                f->sigma[limbs[i].part]);
    set(out, ANGLE_LEAN, portable_atan2(trunk.y, trunk.z), sigma_across(sigma, trunk.y, trunk.z), 0);
    set(out, ANGLE_SIDE_LEAN, portable_atan2(trunk.x, trunk.z), sigma_across(sigma, trunk.x, trunk.z), 0);
    if (is_known(f, PART_HEAD))
        set(out, ANGLE_HEAD, between(trunk, vector(f->direction[PART_HEAD])), sigma, f->sigma[PART_HEAD]);
}

struct body_angles body_angles_of(const struct movement_frame *f)
{
    struct body_angles out;
    struct vec3 trunk;
    double sigma;
    for (int a = 0; a < BODY_ANGLES; a++)
        out.rad[a] = out.sigma[a] = NAN;
    bend(&out, ANGLE_LEFT_ELBOW, f, PART_LEFT_UPPER_ARM, PART_LEFT_FOREARM);
    bend(&out, ANGLE_RIGHT_ELBOW, f, PART_RIGHT_UPPER_ARM, PART_RIGHT_FOREARM);
    bend(&out, ANGLE_LEFT_KNEE, f, PART_LEFT_THIGH, PART_LEFT_SHIN);
    bend(&out, ANGLE_RIGHT_KNEE, f, PART_RIGHT_THIGH, PART_RIGHT_SHIN);
    const bool have_trunk = trunk_direction(f, &trunk, &sigma);
    if (have_trunk)
        trunk_angles(&out, f, trunk, sigma);
    // Turning to the left brings the left shoulder back: y below zero.
    if (f->known >> PART_COUNT & 1)
        set(&out, ANGLE_TWIST, portable_atan2(-f->shoulders[1], f->shoulders[0]), have_trunk ? sigma : 0.1, 0);
    return out;
}

float body_angle_of(const struct movement_frame *f, enum body_angle a)
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
    if (a >= ANGLE_LEAN)
        return body_angles_of(f).rad[a];
    if (!is_known(f, of[a].near))
        return NAN;
    if (of[a].far != PART_HEAD)
        return is_known(f, of[a].far)
                   ? (float)between(vector(f->direction[of[a].near]), vector(f->direction[of[a].far]))
                   : NAN;
    return trunk_direction(f, &trunk, &sigma) ? (float)between(v3_scale(trunk, -1), vector(f->direction[of[a].near]))
                                              : NAN;
}

// The value that would be at `rank` if they were sorted (Hoare's selection); changes their order. No NaN.
static float ranked(float *values, int32_t count, int32_t rank)
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

enum status body_angle_ranges(const struct movement *m, int32_t first, int32_t end, struct angle_range out[BODY_ANGLES])
{
    const int32_t most = end - first;
    float *values = malloc((size_t)(most > 0 ? most : 1) * BODY_ANGLES * sizeof *values);
    int32_t count[BODY_ANGLES] = {0};
    if (!values)
        return fail(ERR_MEMORY, "no memory for the ranges of angles");
    for (int32_t f = first; f < end; f++) {
        const struct body_angles at = body_angles_of(&m->frames[f]);
        for (int a = 0; a < BODY_ANGLES; a++)
            if (!isnan(at.rad[a]))
                values[(size_t)a * (size_t)most + (size_t)count[a]++] = at.rad[a];
    }
    for (int a = 0; a < BODY_ANGLES; a++) {
        float *of = values + (size_t)a * (size_t)(most > 0 ? most : 0);
        out[a] = (struct angle_range){NAN, NAN};
        if (count[a] < 5)
            continue;
        const int32_t last = count[a] - 1;
        out[a].low = ranked(of, count[a], (int32_t)((int64_t)last * 3 / 100));
        out[a].high = ranked(of, count[a], (int32_t)((int64_t)last * 97 / 100));
    }
    free(values);
    return OK;
}
