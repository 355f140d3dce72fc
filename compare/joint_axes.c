#include "compare/joint_axes.h"

#include "base/portable_math.h"
#include "formats/joints_csv.h"

#include <stdlib.h>
#include <string.h>

// By hand, as cosines of 35, 25, 12 and 45 degrees. A camera is tilted by at most 35; other axes are upright, and one
// who sits leans by at most 25. Balance is within 6 degrees of up in all motions of tests/world. A share: a person who
// turns somersaults is upright longer than not.
static const double NEAR_CAMERA = 0.819, NEAR_AXIS = 0.906, NEAR_BALANCE = 0.978, NEAR_UP = 0.707;
static const double UPRIGHT_SHARE = 0.6, LEAST_UPRIGHT = 0.1;
static const double PARALLEL = 0.866; // of shin and trunk: 30 degrees

static bool known(const struct skeleton *s, enum joint j) { return s->confidence[j] > 0; }

static bool middle(const struct skeleton *s, enum joint a, enum joint b, struct vec3 *out)
{
    *out = v3_mix(s->joint[a], s->joint[b], 0.5);
    return known(s, a) && known(s, b);
}

static bool upper_end(const struct skeleton *s, struct vec3 *out)
{
    if (middle(s, JOINT_LEFT_SHOULDER, JOINT_RIGHT_SHOULDER, out))
        return true;
    *out = s->joint[known(s, JOINT_NECK) ? JOINT_NECK : JOINT_HEAD];
    return known(s, JOINT_NECK) || known(s, JOINT_HEAD);
}

static bool lower_end(const struct skeleton *s, struct vec3 *out)
{
    if (middle(s, JOINT_LEFT_HIP, JOINT_RIGHT_HIP, out))
        return true;
    *out = s->joint[known(s, JOINT_WAIST) ? JOINT_WAIST : JOINT_TORSO];
    return known(s, JOINT_WAIST) || known(s, JOINT_TORSO);
}

// From the hips to the shoulders; of a bust from the shoulders to the head.
static bool trunk_axis(const struct skeleton *s, struct vec3 *axis)
{
    struct vec3 from, to;
    if (!upper_end(s, &to))
        return false;
    if (!lower_end(s, &from)) {
        from = to;
        to = s->joint[JOINT_HEAD];
        if (!known(s, JOINT_HEAD))
            return false;
    }
    *axis = v3_unit(v3_sub(to, from));
    return v3_length(*axis) > 0;
}

// ------------------------------------------------------------- up

// Whether the thighs hang down from the hips, as of one who stands.
static bool thighs_hang(const struct skeleton *s, struct vec3 trunk)
{
    static const enum joint thigh[2][2] = {{JOINT_LEFT_KNEE, JOINT_LEFT_HIP}, {JOINT_RIGHT_KNEE, JOINT_RIGHT_HIP}};
    for (int side = 0; side < 2; side++)
        if (known(s, thigh[side][0]) && known(s, thigh[side][1]) &&
            v3_dot(v3_unit(v3_sub(s->joint[thigh[side][1]], s->joint[thigh[side][0]])), trunk) < 0.5)
            return false;
    return true;
}

// The body's own up where it stands or sits. Of one who stands from the feet to the middle of the trunk, which is
// balanced above them; of one who sits the mean of trunk and shins. legs: whether the file has any.
enum posture { POSTURE_OTHER, POSTURE_SITS, POSTURE_STANDS };

static enum posture upright_axis(const struct skeleton *s, bool legs, struct vec3 *axis)
{
    static const enum joint shin[2][2] = {{JOINT_LEFT_FOOT, JOINT_LEFT_KNEE}, {JOINT_RIGHT_FOOT, JOINT_RIGHT_KNEE}};
    struct vec3 sum, feet, upper, lower;
    if (!trunk_axis(s, &sum))
        return POSTURE_OTHER;
    const struct vec3 trunk = sum;
    bool upright = !legs;
    for (int side = 0; side < 2; side++) {
        if (!known(s, shin[side][0]) || !known(s, shin[side][1]))
            continue;
        const struct vec3 up = v3_unit(v3_sub(s->joint[shin[side][1]], s->joint[shin[side][0]]));
        if (v3_dot(up, trunk) < PARALLEL)
            continue;
        sum = v3_add(sum, up);
        upright = true;
    }
    const bool stands = middle(s, JOINT_LEFT_FOOT, JOINT_RIGHT_FOOT, &feet) && upper_end(s, &upper) &&
                        lower_end(s, &lower) && thighs_hang(s, trunk);
    *axis = v3_unit(stands ? v3_sub(v3_mix(upper, lower, 0.5), feet) : sum);
    if (!upright)
        return POSTURE_OTHER;
    return stands ? POSTURE_STANDS : POSTURE_SITS;
}

struct up {
    struct vec3 axis; // unit
    double share;     // of the upright samples that agree
    int64_t upright;  // samples
    int64_t standing; // of these
};

static struct vec3 sum_near(const struct joint_samples *s, bool legs, const struct vec3 *about, struct up *count)
{
    struct vec3 sum = {0, 0, 0}, axis;
    int64_t near = 0;
    count->upright = count->standing = 0;
    for (int64_t i = 0; i < s->count; i++) {
        const enum posture posture = upright_axis(&s->at[i].skeleton, legs, &axis);
        if (posture == POSTURE_OTHER)
            continue;
        count->upright++;
        count->standing += posture == POSTURE_STANDS;
        if (about && v3_dot(axis, *about) < NEAR_UP)
            continue;
        near++;
        sum = v3_add(sum, axis);
    }
    count->share = count->upright ? (double)near / (double)count->upright : 0;
    return sum;
}

static struct up find_up(const struct joint_samples *s)
{
    struct up up = {0};
    bool legs = false;
    for (int64_t i = 0; i < s->count && !legs; i++) {
        const struct skeleton *k = &s->at[i].skeleton;
        legs = (known(k, JOINT_LEFT_KNEE) && known(k, JOINT_LEFT_FOOT)) ||
               (known(k, JOINT_RIGHT_KNEE) && known(k, JOINT_RIGHT_FOOT));
    }
    up.axis = v3_unit(sum_near(s, legs, NULL, &up));
    for (int pass = 0; pass < 3; pass++) {
        const struct vec3 about = up.axis;
        up.axis = v3_unit(sum_near(s, legs, &about, &up));
    }
    return up;
}

// ------------------------------------------------------------- what rests

// How far a point goes in all: the diagonal of the box that holds it but for a twentieth of the time to each side.
struct track {
    float *x[3]; // [samples]
    int64_t count;
};

static int ascending(const void *a, const void *b)
{
    const float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

static double range_of(struct track *t)
{
    double sum = 0;
    if (!t->count)
        return 0;
    for (int k = 0; k < 3; k++) {
        qsort(t->x[k], (size_t)t->count, sizeof(float), ascending);
        const int64_t margin = t->count / 20;
        const double range = (double)t->x[k][t->count - 1 - margin] - t->x[k][margin];
        sum += range * range;
    }
    return sqrt(sum);
}

static double joint_range(const struct joint_samples *s, enum joint a, enum joint b, struct track *t)
{
    t->count = 0;
    for (int64_t i = 0; i < s->count; i++) {
        struct vec3 p;
        if (!middle(&s->at[i].skeleton, a, b, &p))
            continue;
        t->x[0][t->count] = (float)p.x;
        t->x[1][t->count] = (float)p.y;
        t->x[2][t->count++] = (float)p.z;
    }
    return range_of(t);
}

static bool hands_beyond_head(const struct joint_samples *s, struct vec3 up)
{
    int64_t beyond = 0, seen = 0;
    for (int64_t i = 0; i < s->count; i++) {
        const struct skeleton *k = &s->at[i].skeleton;
        struct vec3 hands;
        if (!middle(k, JOINT_LEFT_HAND, JOINT_RIGHT_HAND, &hands) || !known(k, JOINT_HEAD))
            continue;
        seen++;
        beyond += v3_dot(v3_sub(hands, k->joint[JOINT_HEAD]), up) > 0;
    }
    return seen && 10 * beyond > 9 * seen;
}

static enum status cannot_tell(const char *path, const char *why)
{
    return fail(ERR_INPUT,
                "%s does not say its axes, and they cannot be told: %s; write '" JOINTS_CSV_MARK
                " camera' (y down) or '" JOINTS_CSV_MARK " room' (z up) as its first line",
                path, why);
}

// A body that stands rests on a foot. Where both feet go about and the trunk lies still, or the hands beyond the head
// do, the body lies, hangs or stands on its hands: its up is not the world's. By hand: 5 cm, 15 cm.
static enum status check_support(const struct joint_samples *s, const char *path, struct vec3 up)
{
    static const double STILL_M = 0.05, GOING_M = 0.15;
    float *room = malloc(3 * (size_t)s->count * sizeof *room);
    if (!room)
        return fail(ERR_MEMORY, "no memory to find a movement's axes");
    struct track t = {.x = {room, room + s->count, room + 2 * s->count}};
    const double left = joint_range(s, JOINT_LEFT_FOOT, JOINT_LEFT_FOOT, &t),
                 right = joint_range(s, JOINT_RIGHT_FOOT, JOINT_RIGHT_FOOT, &t),
                 trunk = joint_range(s, JOINT_LEFT_SHOULDER, JOINT_RIGHT_SHOULDER, &t), feet = fmin(left, right);
    const bool lies = t.count && trunk < STILL_M;
    const double hands = joint_range(s, JOINT_LEFT_HAND, JOINT_RIGHT_HAND, &t);
    const bool hangs = t.count && hands < STILL_M && hands_beyond_head(s, up);
    free(room);
    if (feet < GOING_M || (!lies && !hangs))
        return OK;
    return cannot_tell(path, lies ? "both feet move while the trunk lies still, so the person may be lying"
                                  : "both feet move while the hands beyond the head do not, so the person may hang, or "
                                    "stand on the hands");
}

// ------------------------------------------------------------- handedness

struct hinge {
    enum joint upper, middle, lower;
};

static void bends_of(const struct skeleton *s, const struct hinge *h, struct vec3 left, double bend[2], int64_t *count)
{
    if (!known(s, h->upper) || !known(s, h->middle) || !known(s, h->lower))
        return;
    const struct vec3 upper = v3_unit(v3_sub(s->joint[h->middle], s->joint[h->upper])),
                      lower = v3_unit(v3_sub(s->joint[h->lower], s->joint[h->middle]));
    const double sense = v3_dot(v3_cross(upper, lower), left);
    if (!(fabs(sense) > 0.2)) // 12 degrees: less is noise
        return;
    bend[sense > 0] += fabs(sense);
    (*count)++;
}

// 1: the axes are right-handed; -1: left-handed, or left and right are exchanged; 0: not known. doubt: whether elbows
// count, too.
static int handedness(const struct joint_samples *s, bool doubt)
{
    static const struct hinge knees[2] = {{JOINT_LEFT_HIP, JOINT_LEFT_KNEE, JOINT_LEFT_FOOT},
                                          {JOINT_RIGHT_HIP, JOINT_RIGHT_KNEE, JOINT_RIGHT_FOOT}},
                              elbows[2] = {{JOINT_LEFT_SHOULDER, JOINT_LEFT_ELBOW, JOINT_LEFT_HAND},
                                           {JOINT_RIGHT_SHOULDER, JOINT_RIGHT_ELBOW, JOINT_RIGHT_HAND}};
    static const enum joint pairs[2][2] = {{JOINT_LEFT_HIP, JOINT_RIGHT_HIP},
                                           {JOINT_LEFT_SHOULDER, JOINT_RIGHT_SHOULDER}};
    double bend[2][2] = {{0}};
    int64_t count[2] = {0, 0};
    for (int64_t i = 0; i < s->count; i++) {
        const struct skeleton *k = &s->at[i].skeleton;
        for (int pair = 0; pair < 2; pair++) {
            const enum joint l = pairs[pair][0], r = pairs[pair][1];
            if (!known(k, l) || !known(k, r))
                continue;
            const struct vec3 left = v3_unit(v3_sub(k->joint[l], k->joint[r]));
            for (int side = 0; side < 2; side++)
                bends_of(k, pair ? &elbows[side] : &knees[side], left, bend[pair], &count[pair]);
        }
    }
    // By hand: ten bent knees, four fifths of them one way; of elbows thrice as many.
    enum { LEAST = 10 };
    static const double CLEAR = 4;
    if (count[0] >= LEAST && fmax(bend[0][0], bend[0][1]) > CLEAR * fmin(bend[0][0], bend[0][1]))
        return bend[0][1] > bend[0][0] ? 1 : -1;
    if (doubt && count[1] >= 3 * LEAST && fmax(bend[1][0], bend[1][1]) > CLEAR * fmin(bend[1][0], bend[1][1]))
        return bend[1][1] > bend[1][0] ? -1 : 1;
    return 0;
}

// ------------------------------------------------------------- turning

// Rows of a matrix into the axes of joint_samples.h.
struct turn {
    struct vec3 row[3];
};

static void apply(struct joint_samples *s, const struct turn *t)
{
    for (int64_t i = 0; i < s->count; i++)
        for (int j = 0; j < JOINT_COUNT; j++) {
            const struct vec3 p = s->at[i].skeleton.joint[j];
            s->at[i].skeleton.joint[j] = v3(v3_dot(t->row[0], p), v3_dot(t->row[1], p), v3_dot(t->row[2], p));
        }
}

static double component(struct vec3 v, int axis)
{
    if (axis == 0)
        return v.x;
    return axis == 1 ? v.y : v.z;
}

static struct vec3 unit_along(int axis, double sign)
{
    return v3(axis == 0 ? sign : 0, axis == 1 ? sign : 0, axis == 2 ? sign : 0);
}

// Up as camera axes have it, which files without a line have most often.
static bool is_camera(struct vec3 up) { return -up.y >= NEAR_CAMERA; }

// The axis that up is nearest to, and whether it is up or down.
static struct vec3 nearest_axis(struct vec3 up)
{
    int axis = 0;
    for (int k = 1; k < 3; k++)
        if (fabs(component(up, k)) > fabs(component(up, axis)))
            axis = k;
    return unit_along(axis, component(up, axis) < 0 ? -1 : 1);
}

// Up becomes -y by a rotation, mirrored in x if so wanted.
static struct turn turn_for(struct vec3 up, bool mirror)
{
    // Some level direction; x where it is one, so that little is turned.
    const bool along = v3_distance(up, nearest_axis(up)) < 1e-9;
    const struct vec3 x = along ? unit_along(fabs(up.x) > 0.5, 1) : v3_perpendicular(up), down = v3_scale(up, -1);
    return (struct turn){{v3_scale(x, mirror ? -1 : 1), down, v3_cross(x, down)}};
}

static const char *axis_words(struct vec3 up, char out[60])
{
    const struct vec3 axis = nearest_axis(up);
    const double off = portable_acos(fmin(1, v3_dot(up, axis)));
    char letter = 'z';
    if (fabs(axis.x) > 0.5)
        letter = 'x';
    else if (fabs(axis.y) > 0.5)
        letter = 'y';
    const int used = snprintf(out, 60, "%c %s", letter, axis.x + axis.y + axis.z > 0 ? "up" : "down");
    if (off > 1e-6)
        snprintf(out + used, 60 - (size_t)used, ", tilted by %.0f degrees", off * 180 / 3.14159265358979323846);
    return out;
}

static const char backwards[] =
    "knees bend backwards: its axes are left-handed, or left and right are exchanged; it was read as left-handed, and "
    "if sides are exchanged, what is said of a side holds for the other";

static enum status believe(struct joint_samples *s, enum joints_csv_axes said)
{
    static const struct turn from_room = {{{1, 0, 0}, {0, 0, -1}, {0, 1, 0}}},
                             mirrored = {{{-1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
    if (said == JOINTS_CSV_ROOM)
        apply(s, &from_room);
    const struct up up = find_up(s);
    static const double LIES = 0.5;                                  // a cosine: 60 degrees from up; by hand
    const double above = up.share >= UPRIGHT_SHARE ? -up.axis.y : 1; // cosine
    if (handedness(s, false) < 0) {
        joint_note(&s->notes, "%s", backwards);
        const struct turn turn = above < NEAR_UP ? turn_for(nearest_axis(up.axis), true) : mirrored;
        apply(s, &turn);
    } else if (above < LIES) {
        joint_note(&s->notes,
                   "by its line '" JOINTS_CSV_MARK " %s' the person %s; if that is not so, take the line out",
                   joints_csv_axes_names[said], above < -NEAR_UP ? "is upside down" : "lies");
    }
    if (said != JOINTS_CSV_ROOM)
        joint_samples_level(s);
    return OK;
}

static bool can_be_compared(const struct joint_samples *s)
{
    bool ever[JOINT_COUNT] = {0};
    for (int64_t i = 0; i < s->count; i++)
        for (int j = 0; j < JOINT_COUNT; j++)
            ever[j] = ever[j] || known(&s->at[i].skeleton, (enum joint)j);
    return (ever[JOINT_LEFT_HIP] && ever[JOINT_RIGHT_HIP]) || (ever[JOINT_LEFT_SHOULDER] && ever[JOINT_RIGHT_SHOULDER]);
}

// The direction that is to be made up. *up: an axis, where up is near one; what remains is a sensor's tilt, which
// standing tells. False: it is not clear.
static bool settle_up(const struct joint_samples *s, const struct up *found, struct vec3 *up)
{
    struct vec3 straight;
    const bool stands_straight = joint_samples_standing(s, &straight) && v3_dot(straight, found->axis) >= NEAR_UP,
               balanced = !stands_straight && 2 * found->standing > found->upright;
    *up = stands_straight ? straight : found->axis;
    const struct vec3 axis = nearest_axis(*up);
    const bool near = balanced ? v3_dot(*up, axis) >= NEAR_BALANCE : is_camera(*up) || v3_dot(*up, axis) >= NEAR_AXIS;
    if (near)
        *up = axis;
    return near || balanced || stands_straight;
}

static void note_axes(struct joint_samples *s, struct vec3 up, int hand)
{
    char words[60];
    if (-up.y >= 1) {
        if (hand < 0)
            joint_note(&s->notes, "%s", backwards);
        return;
    }
    const char *right_handed = hand ? "" : "; right-handed ones were taken for granted";
    joint_note(&s->notes, "it does not say its axes; by the person's head and feet they are %s%s",
               axis_words(up, words), hand < 0 ? ", and left-handed by the knees" : right_handed);
}

static enum status find_out(struct joint_samples *s, const char *path)
{
    struct vec3 axis;
    const struct up up = find_up(s);
    if ((double)up.upright < LEAST_UPRIGHT * (double)s->count)
        return cannot_tell(path, "the person neither stands nor sits");
    if (up.share < UPRIGHT_SHARE)
        return cannot_tell(path, "the person is upright and upside down by turns");
    if (!settle_up(s, &up, &axis))
        return cannot_tell(path, "no axis points up or down, and the person never stands");
    enum status status = is_camera(axis) ? OK : check_support(s, path, axis);
    if (status != OK)
        return status;
    const int hand = handedness(s, true);
    note_axes(s, axis, hand);
    if (!(-axis.y >= 1) || hand < 0) {
        const struct turn turn = turn_for(axis, hand < 0);
        apply(s, &turn);
    }
    joint_samples_level(s);
    return OK;
}

enum status joint_axes_settle(struct joint_samples *s, const char *path, int said)
{
    if (!can_be_compared(s))
        return OK;
    return said >= 0 ? believe(s, (enum joints_csv_axes)said) : find_out(s, path);
}
