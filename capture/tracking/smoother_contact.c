// Feet that stand: in the smoothed path a foot at rest on the floor wanders by a centimetre or two, and slides in every
// picture. Found by its speed and height, it is put where it stands in the mean, and the leg follows.
#include "capture/tracking/smoother_internal.h"

// Chosen by hand on the small world's kata and walk; test_foot_contact measures the outcome on other motions.
#define REST_M_S    0.25 // a foot that stands is slower, measured over SPEED_NS to both sides,
#define SPEED_NS    66000000
#define STRAY_M     0.040 // stays this near to where it stands,
#define DRIFT_M     0.025 // does not move on from the first half of its stand to the second,
#define SHORTEST_NS 200000000
#define BLEND_NS    100000000 // before and after, the path is led to the stand and away from it
#define LOW_M       0.17      // of an ankle over the floor, where that is known

struct stand {
    int64_t first, end;
    struct vec3 at;
};

static struct vec3 mean_of(const struct vec3 *path, int64_t first, int64_t end)
{
    struct vec3 sum = v3(0, 0, 0);
    for (int64_t i = first; i < end; i++)
        sum = v3_add(sum, path[i]);
    return v3_scale(sum, 1.0 / (double)(end - first));
}

static bool is_at_rest(const struct smoother_frame *frame, int64_t count, const struct vec3 *path, int64_t i)
{
    int64_t a = i, b = i;
    while (a > 0 && frame[i].time_ns - frame[a].time_ns < SPEED_NS)
        a--;
    while (b + 1 < count && frame[b].time_ns - frame[i].time_ns < SPEED_NS)
        b++;
    const double dt_s = 1e-9 * (double)(frame[b].time_ns - frame[a].time_ns);
    return dt_s > 0 && v3_distance(path[a], path[b]) < REST_M_S * dt_s;
}

static bool is_low(const struct smoother_floor *floor, struct vec3 p)
{
    return !floor->known || v3_dot(floor->up, p) + floor->height_m < LOW_M;
}

// The stand that begins at frame `first`, as long as the foot stays. False: it is none.
static bool find_stand(const struct smoother_frame *frame, int64_t count, const struct vec3 *path,
                       const struct smoother_floor *floor, struct stand *out)
{
    int64_t end = out->first;
    struct vec3 sum = v3(0, 0, 0);
    while (end < count && is_at_rest(frame, count, path, end) && is_low(floor, path[end])) {
        const int64_t n = end - out->first;
        if (n && v3_distance(path[end], v3_scale(sum, 1.0 / (double)n)) > STRAY_M)
            break;
        sum = v3_add(sum, path[end++]);
    }
    out->end = end;
    if (end - out->first < 3 || frame[end - 1].time_ns - frame[out->first].time_ns < SHORTEST_NS)
        return false;
    const int64_t middle = (out->first + end) / 2;
    out->at = mean_of(path, out->first, end);
    return v3_distance(mean_of(path, out->first, middle), mean_of(path, middle, end)) < DRIFT_M;
}

// Adds what brings the path to the stand, fading before and after.
static void add_offsets(const struct smoother_frame *frame, int64_t count, const struct vec3 *path,
                        const struct stand *stand, struct vec3 *offset)
{
    for (int64_t i = stand->first; i < stand->end; i++)
        offset[i] = v3_sub(stand->at, path[i]);
    const struct vec3 before = offset[stand->first], after = offset[stand->end - 1];
    for (int64_t i = stand->first - 1; i >= 0; i--) {
        const double share = 1 - (double)(frame[stand->first].time_ns - frame[i].time_ns) / BLEND_NS;
        if (share <= 0)
            break;
        offset[i] = v3_mix(offset[i], before, share);
    }
    for (int64_t i = stand->end; i < count; i++) {
        const double share = 1 - (double)(frame[i].time_ns - frame[stand->end - 1].time_ns) / BLEND_NS;
        if (share <= 0)
            break;
        offset[i] = v3_mix(offset[i], after, share);
    }
}

// The knee for a foot at `foot`, its bones as long as before: law of cosines; it bends as it did. A foot out of reach
// comes as near as it can.
static void bend_leg(struct vec3 *joint, const struct body_limb *leg, struct vec3 foot)
{
    const struct vec3 hip = joint[leg->root], knee = joint[leg->bend], way = v3_sub(foot, hip), along = v3_unit(way);
    const double a = v3_distance(hip, knee), b = v3_distance(knee, joint[leg->tip]),
                 d = fmax(fabs(a - b), fmin(a + b, v3_length(way)));
    if (!(d > 1e-6))
        return;
    const double at = (a * a - b * b + d * d) / (2 * d), high = sqrt(fmax(0, a * a - at * at));
    const struct vec3 from_hip = v3_sub(knee, hip), off = v3_sub(from_hip, v3_scale(along, v3_dot(from_hip, along))),
                      out = v3_length(off) > 1e-9 ? v3_unit(off) : v3_perpendicular(along);
    joint[leg->bend] = v3_add(hip, v3_add(v3_scale(along, at), v3_scale(out, high)));
    joint[leg->tip] = v3_add(hip, v3_scale(along, d));
}

void smoother_keep_contacts(struct smoother_frame *frame, int64_t count, const struct smoother_floor *floor,
                            struct vec3 *path, struct vec3 *offset)
{
    for (int k = FIRST_LEG; k < LIMB_COUNT; k++) {
        const struct body_limb *leg = &body_limbs[k];
        for (int64_t i = 0; i < count; i++) {
            path[i] = frame[i].result.joint[leg->tip];
            offset[i] = v3(0, 0, 0);
        }
        struct stand stand = {.first = 0};
        for (; stand.first<count; stand.first = stand.end> stand.first ? stand.end : stand.first + 1)
            if (find_stand(frame, count, path, floor, &stand))
                add_offsets(frame, count, path, &stand, offset);
        for (int64_t i = 0; i < count; i++)
            if (v3_length(offset[i]) > 0)
                bend_leg(frame[i].result.joint, leg, v3_add(path[i], offset[i]));
    }
}
