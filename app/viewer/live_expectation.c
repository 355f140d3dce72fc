#include "app/viewer/live_expectation.h"

#include <math.h>

static const double RAD = 180 / 3.14159265358979323846; // degrees in a radian

static uint16_t group_parts(int group)
{
    static const uint16_t parts[LIVE_GROUPS] = {
        [GROUP_HEAD] = 1u << PART_HEAD,
        [GROUP_TRUNK] = 1u << PART_UPPER_TORSO | 1u << PART_LOWER_TORSO,
        [GROUP_ARMS] =
            1u << PART_LEFT_UPPER_ARM | 1u << PART_LEFT_FOREARM | 1u << PART_RIGHT_UPPER_ARM | 1u << PART_RIGHT_FOREARM,
        [GROUP_LEGS] = 1u << PART_LEFT_THIGH | 1u << PART_LEFT_SHIN | 1u << PART_RIGHT_THIGH | 1u << PART_RIGHT_SHIN,
    };
    return parts[group];
}

// Degrees; < 0: they have different ones.
static double tolerance_of(const struct expectation *expected, uint16_t parts)
{
    double found_deg = NAN;
    for (int p = 0; p < PART_COUNT; p++) {
        const double deg = expected->tolerance_rad[p] * RAD;
        if (!(parts >> p & 1))
            continue;
        if (isfinite(found_deg) && fabs(deg - found_deg) > 0.05)
            return -1;
        found_deg = deg;
    }
    return found_deg;
}

struct live_counting live_counting_of(const struct expectation *expected, int64_t offset_ns)
{
    struct live_counting out = {.from_ns = 0};
    for (int g = 0; g < LIVE_GROUPS; g++) {
        const uint16_t parts = group_parts(g);
        out.counts[g] = parts & (uint16_t)~expected->ignored;
        out.tolerance_deg[g] = tolerance_of(expected, parts);
    }
    if (expected->to_s > 0) {
        out.from_ns = offset_ns + (int64_t)llround(expected->from_s * 1e9);
        out.to_ns = offset_ns + (int64_t)llround(expected->to_s * 1e9);
    }
    return out;
}

static enum status apply_stretch(const struct live_counting *counting, int64_t offset_ns, double seconds,
                                 struct expectation *expected)
{
    const double from_s = fmax(0, (double)(counting->from_ns - offset_ns) * 1e-9),
                 to_s = fmax(0, fmin(seconds, (double)(counting->to_ns - offset_ns) * 1e-9));
    if (counting->to_ns > 0)
        return expectation_set_stretch(expected, from_s, to_s, seconds);
    expected->from_s = expected->to_s = 0;
    return OK;
}

enum status live_counting_apply(const struct live_counting *counting, int64_t offset_ns, double seconds,
                                struct expectation *expected)
{
    const struct live_counting before = live_counting_of(expected, offset_ns);
    for (int g = 0; g < LIVE_GROUPS; g++) {
        const uint16_t parts = group_parts(g);
        const double deg = counting->tolerance_deg[g];
        if (counting->counts[g] != before.counts[g])
            expected->ignored =
                (uint16_t)(counting->counts[g] ? expected->ignored & ~parts : expected->ignored | parts);
        for (int p = 0; p < PART_COUNT && fabs(deg - before.tolerance_deg[g]) > 0.05; p++)
            if (parts >> p & 1)
                expected->tolerance_rad[p] = fmin(TOLERANCE_MAX_RAD, deg / RAD);
    }
    const bool same = counting->from_ns == before.from_ns && counting->to_ns == before.to_ns;
    return same ? OK : apply_stretch(counting, offset_ns, seconds, expected);
}
