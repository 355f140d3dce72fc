#include "capture/coaching/pose_advice.h"

#include "base/portable_math.h"

static const double PI = 3.14159265358979323846;

// All chosen by hand.
enum { FACED_FRAMES = 3, FACED_REACH = 2 }; // a side was faced in so many frames, within two sectors: 45 degrees
static const double TURN_SHARE = 0.02,
                    POSE_SHARE = 0.02;    // of the surface: less is some dozens of pixels in the picture
static const double LIFTED_COSINE = 0.6;  // of the upper arm against straight down: 53 degrees
static const double SPREAD_COSINE = 0.94; // between the thighs: 20 degrees
static const double PATIENCE_S = 8;
static const double SOLE_COSINE = 0.5, SOLE_SEEN = 0.5; // of the shin against straight down; share of the sole
enum { SOLE_TIMES = 10 };                               // a second, at one call in three frames

static bool faced(const uint32_t facing[SURFACE_ANGLES], int sector)
{
    uint32_t frames = 0;
    for (int k = -FACED_REACH; k <= FACED_REACH; k++)
        frames += facing[(sector + k + SURFACE_ANGLES) % SURFACE_ANGLES];
    return frames >= FACED_FRAMES;
}

static int sector_of(struct vec3 rest)
{
    const double angle = portable_atan2(rest.x, rest.y);
    return (int)floor(angle / (2 * PI) * SURFACE_ANGLES + SURFACE_ANGLES + 0.5) % SURFACE_ANGLES;
}

// Whether an unseen cell would show with lifted arms: the arms themselves and the trunk's sides.
static bool needs_arms(int part, int angle)
{
    const bool side = fabs(portable_sin(surface_angle(angle))) > 0.5;
    return (part >= PART_LEFT_UPPER_ARM && part <= PART_RIGHT_FOREARM) ||
           ((part == PART_UPPER_TORSO || part == PART_LOWER_TORSO) && side);
}

static bool needs_legs(int part) { return part >= PART_LEFT_THIGH && part <= PART_RIGHT_SHIN; }

// Unseen area by what would show it, as shares of the surface.
struct missing {
    double turn[SURFACE_ANGLES], turn_sum, arms, legs;
};

static struct missing missing_of(const struct coverage *c, const struct advisor *a)
{
    struct missing m = {.turn_sum = 0};
    double all = 0;
    for (int p = 0; p < SURFACE_PARTS; p++)
        for (int h = 0; h < SURFACE_HEIGHTS; h++)
            for (int k = 0; k < SURFACE_ANGLES; k++) {
                const double area = coverage_cell_area(c, p, h, k);
                const struct vec3 rest = surface_rest_direction(p, h, k);
                const bool level = portable_hypot(rest.x, rest.y) > 0.7;
                const int sector = sector_of(rest);
                all += area;
                if (area <= 0 || coverage_cell_seen(c, p, h, k))
                    continue;
                if (level && !faced(c->facing, sector)) {
                    m.turn[sector] += area;
                    m.turn_sum += area;
                } else if (a && needs_arms(p, k) && !faced(a->lifted, sector)) {
                    m.arms += area;
                } else if (a && needs_legs(p) && !faced(a->spread, sector)) {
                    m.legs += area;
                }
            }
    for (int k = 0; k < SURFACE_ANGLES && all > 0; k++)
        m.turn[k] /= all;
    if (all > 0) {
        m.turn_sum /= all;
        m.arms /= all;
        m.legs /= all;
    }
    return m;
}

double advisor_turn_share(const struct coverage *c) { return missing_of(c, NULL).turn_sum; }

// By the mean of what is missing, seen from where the camera is now: a turn to the left by d brings the body's angle
// (camera - d) before the camera. A turn once begun is kept, so that the advice does not swing.
static enum pose_advice turn_advice(const struct advisor *a, const struct missing *m, double facing)
{
    double left = 0, right = 0; // what the first half turn to either side would show, the nearest first
    for (int k = 0; k < SURFACE_ANGLES; k++) {
        double d = facing - k * 2 * PI / SURFACE_ANGLES;
        d -= 2 * PI * floor((d + PI) / (2 * PI));
        if (d > 0)
            left += m->turn[k] / (0.3 + d);
        else
            right += m->turn[k] / (0.3 - d);
    }
    if (a->last == ADVICE_TURN_LEFT)
        left *= 4;
    if (a->last == ADVICE_TURN_RIGHT)
        right *= 4;
    return left >= right ? ADVICE_TURN_LEFT : ADVICE_TURN_RIGHT;
}

static bool arm_lifted(const struct surface_pose *pose, int part)
{
    return pose->part[part].known && -v3_dot(pose->part[part].z, pose->up) < LIFTED_COSINE;
}

static void note_pose(struct advisor *a, const struct surface_pose *pose)
{
    const struct surface_frame *l = &pose->part[PART_LEFT_THIGH], *r = &pose->part[PART_RIGHT_THIGH];
    const int sector =
        (int)floor(coverage_facing(pose) / (2 * PI) * SURFACE_ANGLES + SURFACE_ANGLES + 0.5) % SURFACE_ANGLES;
    if (arm_lifted(pose, PART_LEFT_UPPER_ARM) && arm_lifted(pose, PART_RIGHT_UPPER_ARM))
        a->lifted[sector]++;
    if (l->known && r->known && v3_dot(l->z, r->z) < SPREAD_COSINE)
        a->spread[sector]++;
    // Down is the sensor's, which stands within some degrees of level.
    for (int k = 0; k < 2; k++) {
        const struct surface_frame *shin = &pose->part[k ? PART_RIGHT_SHIN : PART_LEFT_SHIN];
        a->soles[k] += shin->known && shin->z.y < SOLE_COSINE;
    }
}

// Whether a sole was turned to the side for a while and was not seen: then a picture from there has to show it.
static bool needs_soles(const struct advisor *a, const struct coverage *c)
{
    for (int k = 0; k < 2; k++) {
        const int foot = k ? SURFACE_RIGHT_FOOT : SURFACE_LEFT_FOOT;
        double all = 0, seen = 0;
        for (int h = 0; h < SURFACE_HEIGHTS; h++)
            for (int angle = 0; angle < SURFACE_ANGLES; angle++) {
                if (portable_cos(surface_angle(angle)) > -0.5) // a foot's own front is up
                    continue;
                const double area = coverage_cell_area(c, foot, h, angle);
                all += area;
                seen += coverage_cell_seen(c, foot, h, angle) ? area : 0;
            }
        if (a->soles[k] >= SOLE_TIMES && seen < SOLE_SEEN * all)
            return true;
    }
    return false;
}

// A pose that is not taken is not asked for for ever.
static enum pose_advice ask(struct advisor *a, enum pose_advice wanted, int64_t time_ns, bool *refused)
{
    if (a->last != wanted)
        a->asked_ns = time_ns;
    else if ((double)(time_ns - a->asked_ns) * 1e-9 > PATIENCE_S)
        *refused = true;
    return wanted;
}

enum pose_advice advisor_next(struct advisor *a, const struct coverage *c, const struct skeleton *s, int64_t time_ns)
{
    struct surface_pose pose;
    if (!surface_pose_of(s, &pose) || !pose.part[PART_UPPER_TORSO].known)
        return a->last;
    note_pose(a, &pose);
    const struct missing m = missing_of(c, a);
    enum pose_advice advice = ADVICE_ENOUGH;
    if (m.turn_sum > TURN_SHARE)
        advice = turn_advice(a, &m, coverage_facing(&pose));
    else if (m.arms > POSE_SHARE && !a->lift_refused)
        advice = ask(a, ADVICE_LIFT_ARMS, time_ns, &a->lift_refused);
    else if (m.legs > POSE_SHARE && !a->spread_refused)
        advice = ask(a, ADVICE_SPREAD_LEGS, time_ns, &a->spread_refused);
    else if (!a->soles_refused && needs_soles(a, c))
        advice = ask(a, ADVICE_SHOW_SOLES, time_ns, &a->soles_refused);
    a->last = advice;
    return advice;
}
