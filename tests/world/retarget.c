#include "tests/world/retarget.h"

#include "formats/bvh_reader.h"
#include "platform/files/file.h"
#include "tests/world/numbers.h"

#include <stdlib.h>
#include <string.h>

// The joints used from the file; of pairs the left one comes first.
enum role {
    ROLE_PELVIS,
    ROLE_SPINE,
    ROLE_NECK,
    ROLE_HEAD,
    ROLE_LEFT_EYE,
    ROLE_RIGHT_EYE,
    ROLE_LEFT_UPPER_ARM,
    ROLE_RIGHT_UPPER_ARM,
    ROLE_LEFT_FOREARM,
    ROLE_RIGHT_FOREARM,
    ROLE_LEFT_HAND,
    ROLE_RIGHT_HAND,
    ROLE_LEFT_THIGH,
    ROLE_RIGHT_THIGH,
    ROLE_LEFT_SHIN,
    ROLE_RIGHT_SHIN,
    ROLE_LEFT_FOOT,
    ROLE_RIGHT_FOOT,
    ROLE_LEFT_TOE,
    ROLE_RIGHT_TOE,
    ROLE_COUNT
};

// Known naming schemes: Character Creator, CMU as MotionBuilder exports it, Daz.
static const struct {
    const char *what;
    const char *names[5];
} roles[ROLE_COUNT] = {
    {"the pelvis", {"CC_Base_Hip", "Hips", "Hip", "pelvis"}},
    {"the spine", {"CC_Base_Spine01", "Spine", "abdomen", "LowerBack"}},
    {"the neck", {"CC_Base_NeckTwist01", "Neck", "Neck1"}},
    {"the head", {"CC_Base_Head", "Head"}},
    {NULL, {"CC_Base_L_Eye", "LeftEye", "lEye"}},
    {NULL, {"CC_Base_R_Eye", "RightEye", "rEye"}},
    {"the left upper arm", {"CC_Base_L_Upperarm", "LeftArm", "LeftUpArm", "lShldr"}},
    {"the right upper arm", {"CC_Base_R_Upperarm", "RightArm", "RightUpArm", "rShldr"}},
    {"the left forearm", {"CC_Base_L_Forearm", "LeftForeArm", "LeftLowArm", "lForeArm"}},
    {"the right forearm", {"CC_Base_R_Forearm", "RightForeArm", "RightLowArm", "rForeArm"}},
    {"the left hand", {"CC_Base_L_Hand", "LeftHand", "lHand"}},
    {"the right hand", {"CC_Base_R_Hand", "RightHand", "rHand"}},
    {"the left thigh", {"CC_Base_L_Thigh", "LeftUpLeg", "lThigh"}},
    {"the right thigh", {"CC_Base_R_Thigh", "RightUpLeg", "rThigh"}},
    {"the left shin", {"CC_Base_L_Calf", "LeftLeg", "LeftLowLeg", "lShin"}},
    {"the right shin", {"CC_Base_R_Calf", "RightLeg", "RightLowLeg", "rShin"}},
    {"the left foot", {"CC_Base_L_Foot", "LeftFoot", "lFoot"}},
    {"the right foot", {"CC_Base_R_Foot", "RightFoot", "rFoot"}},
    {NULL, {"CC_Base_L_ToeBase", "LeftToeBase", "LeftToe"}},
    {NULL, {"CC_Base_R_ToeBase", "RightToeBase", "RightToe"}},
};

struct retarget {
    struct vec3 (*at)[ROLE_COUNT]; // per frame, our axes, metres of our figure, above the floor
    bool eyes, toes;
    int count;
    double frame_s;
};

static enum status find_roles(const struct bvh *b, const char *path, int joint[ROLE_COUNT])
{
    for (int r = 0; r < ROLE_COUNT; r++) {
        joint[r] = -1;
        for (int n = 0; n < 5 && roles[r].names[n] && joint[r] < 0; n++)
            joint[r] = bvh_find(b, roles[r].names[n]);
        if (joint[r] < 0 && roles[r].what)
            return fail(ERR_INPUT, "%s has no joint for %s under a name we know (such as %s)", path, roles[r].what,
                        roles[r].names[0]);
    }
    return OK;
}

static int by_value(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

// Keeps the longest contiguous stretch in which the pelvis stays in the sensor's good range; `within` in the file's
// units.
static void keep_longest(struct retarget *r, double within)
{
    int best = 0, best_count = 0, from = 0;
    double low_x = 1e300, high_x = -1e300, low_y = 1e300, high_y = -1e300;
    for (int f = 0; f < r->count; f++) {
        struct vec3 w = r->at[f][ROLE_PELVIS];
        low_x = least(low_x, w.x), high_x = most(high_x, w.x);
        low_y = least(low_y, w.y), high_y = most(high_y, w.y);
        if (high_x - low_x > within || high_y - low_y > within) {
            from = f;
            low_x = high_x = w.x, low_y = high_y = w.y;
        }
        if (f - from + 1 > best_count)
            best = from, best_count = f - from + 1;
    }
    memmove(r->at, r->at + best, (size_t)best_count * sizeof *r->at);
    r->count = best_count;
}

// From the file's axes and units to ours: legs as long as the figure's, facing the sensor at first, the path centred,
// ankles as high above the floor as ours.
static enum status centre_in_room(struct retarget *r, const struct physique *p, const char *path, bool whole)
{
    struct vec3 *first = r->at[0];
    double leg = 0, ours = p->thigh_m + p->shin_m;
    for (int side = 0; side < 2; side++)
        leg += 0.5 * (v3_distance(first[ROLE_LEFT_THIGH + side], first[ROLE_LEFT_SHIN + side]) +
                      v3_distance(first[ROLE_LEFT_SHIN + side], first[ROLE_LEFT_FOOT + side]));
    if (!(leg > 1e-6))
        return fail(ERR_INPUT, "%s: the legs have no length", path);
    double scale = ours / leg;
    if (!whole)
        keep_longest(r, 2.6 / scale);
    struct vec3 left = v3_sub(first[ROLE_LEFT_THIGH], first[ROLE_RIGHT_THIGH]); // to become +x
    struct quat heading = quat_from_rotation_vector(v3(0, 0, -atan2(left.y, left.x)));
    double *heights = malloc((size_t)r->count * sizeof *heights);
    if (!heights)
        return fail(ERR_MEMORY, "out of memory for the motion of %s", path);
    double low_x = 1e9, high_x = -1e9, low_y = 1e9, high_y = -1e9;
    for (int f = 0; f < r->count; f++) {
        for (int k = 0; k < ROLE_COUNT; k++)
            r->at[f][k] = v3_scale(quat_rotate(heading, r->at[f][k]), scale);
        struct vec3 w = r->at[f][ROLE_PELVIS];
        low_x = least(low_x, w.x), high_x = most(high_x, w.x);
        low_y = least(low_y, w.y), high_y = most(high_y, w.y);
        heights[f] = least(r->at[f][ROLE_LEFT_FOOT].z, r->at[f][ROLE_RIGHT_FOOT].z);
    }
    // The floor: the 5th percentile of the lower ankle's height.
    qsort(heights, (size_t)r->count, sizeof *heights, by_value);
    double floor_z = heights[r->count / 20];
    free(heights);
    struct vec3 shift =
        v3(-(low_x + high_x) / 2, 0.25 - (low_y + high_y) / 2, p->bind_joint[JOINT_LEFT_FOOT].z - floor_z);
    for (int f = 0; f < r->count; f++)
        for (int k = 0; k < ROLE_COUNT; k++)
            r->at[f][k] = v3_add(r->at[f][k], shift);
    return OK;
}

static enum status fill(struct retarget *r, const struct bvh *b, const int joint[ROLE_COUNT], const char *path)
{
    r->count = bvh_frame_count(b);
    r->frame_s = bvh_frame_s(b);
    r->eyes = joint[ROLE_LEFT_EYE] >= 0 && joint[ROLE_RIGHT_EYE] >= 0;
    r->toes = joint[ROLE_LEFT_TOE] >= 0 && joint[ROLE_RIGHT_TOE] >= 0;
    r->at = calloc((size_t)r->count, sizeof *r->at);
    struct vec3 *all = malloc((size_t)bvh_joint_count(b) * sizeof *all);
    if (!r->at || !all) {
        free(all);
        return fail(ERR_MEMORY, "out of memory for the motion of %s", path);
    }
    for (int f = 0; f < r->count; f++) {
        bvh_positions(b, f, all);
        for (int k = 0; k < ROLE_COUNT; k++)
            if (joint[k] >= 0) // y up, facing z, to z up, facing -y
                r->at[f][k] = v3(all[joint[k]].x, -all[joint[k]].z, all[joint[k]].y);
    }
    free(all);
    return OK;
}

enum status retarget_open(struct retarget **out, const char *path, const struct physique *p, bool whole)
{
    *out = NULL;
    uint8_t *bytes;
    size_t count;
    enum status status = file_read(path, &bytes, &count);
    if (status)
        return status;
    struct bvh *b = NULL;
    struct retarget *r = NULL;
    int joint[ROLE_COUNT];
    status = bvh_parse(&b, path, bytes, count);
    free(bytes);
    if (!status)
        status = find_roles(b, path, joint);
    if (!status && !(r = calloc(1, sizeof *r)))
        status = fail(ERR_MEMORY, "out of memory for the motion of %s", path);
    if (!status)
        status = fill(r, b, joint, path);
    if (!status)
        status = centre_in_room(r, p, path, whole);
    bvh_free(&b);
    if (status)
        retarget_close(&r);
    *out = r;
    return status;
}

void retarget_close(struct retarget **r)
{
    if (*r) {
        free((*r)->at);
        free(*r);
        *r = NULL;
    }
}

double retarget_seconds(const struct retarget *r) { return (r->count - 1) * r->frame_s; }

// The rotation with x along `left` and z as close to `up` as possible.
static struct quat upright(struct vec3 left, struct vec3 up)
{
    struct vec3 x = v3_unit(left), y = v3_unit(v3_cross(up, x)), z = v3_cross(x, y);
    double m[3][3] = {{x.x, y.x, z.x}, {x.y, y.y, z.y}, {x.z, y.z, z.z}};
    return quat_from_matrix(m);
}

struct stance retarget_at(const struct retarget *r, const struct physique *p, double time_s)
{
    double at = time_s / r->frame_s;
    int i = (int)least(most(floor(at), 0), r->count - 1), j = i + 1 < r->count ? i + 1 : i;
    struct vec3 q[ROLE_COUNT];
    for (int k = 0; k < ROLE_COUNT; k++)
        q[k] = v3_mix(r->at[i][k], r->at[j][k], least(1, at - i));

    struct stance s = {0};
    struct vec3 hips = v3_scale(v3_add(q[ROLE_LEFT_THIGH], q[ROLE_RIGHT_THIGH]), 0.5);
    struct vec3 shoulders = v3_sub(q[ROLE_LEFT_UPPER_ARM], q[ROLE_RIGHT_UPPER_ARM]);
    s.pelvis = upright(v3_sub(q[ROLE_LEFT_THIGH], q[ROLE_RIGHT_THIGH]), v3_sub(q[ROLE_SPINE], hips));
    s.chest = upright(shoulders, v3_sub(q[ROLE_NECK], q[ROLE_SPINE]));
    s.head = s.chest;
    if (r->eyes) { // the eyes are in front of the head's joint and above it
        struct vec3 gaze = v3_sub(v3_scale(v3_add(q[ROLE_LEFT_EYE], q[ROLE_RIGHT_EYE]), 0.5), q[ROLE_HEAD]);
        struct vec3 left = v3_unit(v3_sub(q[ROLE_LEFT_EYE], q[ROLE_RIGHT_EYE]));
        // The eyes are 38 degrees above the joint when the head looks straight ahead: tilt back by that to find "up".
        struct vec3 forward = v3_unit(v3_sub(gaze, v3_scale(left, v3_dot(gaze, left))));
        struct vec3 over = v3_cross(forward, left); // across the gaze, towards the crown
        s.head = upright(left, v3_add(over, v3_scale(forward, 0.78)));
    } else {
        s.head = upright(shoulders, v3_sub(q[ROLE_HEAD], q[ROLE_NECK]));
    }
    struct vec3 bind_hips = v3_scale(v3_add(p->bind_joint[JOINT_LEFT_HIP], p->bind_joint[JOINT_RIGHT_HIP]), 0.5);
    s.waist = v3_add(hips, quat_rotate(s.pelvis, v3_sub(p->bind_joint[JOINT_WAIST], bind_hips)));
    for (int side = LEFT; side <= RIGHT; side++) {
        s.upper_arm[side] = v3_unit(v3_sub(q[ROLE_LEFT_FOREARM + side], q[ROLE_LEFT_UPPER_ARM + side]));
        s.forearm[side] = v3_unit(v3_sub(q[ROLE_LEFT_HAND + side], q[ROLE_LEFT_FOREARM + side]));
        s.ankle[side] = q[ROLE_LEFT_FOOT + side];
        struct vec3 thigh = v3_sub(q[ROLE_LEFT_SHIN + side], q[ROLE_LEFT_THIGH + side]);
        struct vec3 shin = v3_sub(q[ROLE_LEFT_FOOT + side], q[ROLE_LEFT_SHIN + side]);
        struct vec3 bent = v3_sub(v3_unit(thigh), v3_unit(shin)); // towards the knee's front
        struct vec3 toes = quat_rotate(s.pelvis, v3(0, -1, 0));
        if (r->toes)
            toes = v3_unit(v3_sub(q[ROLE_LEFT_TOE + side], q[ROLE_LEFT_FOOT + side]));
        s.knee[side] = v3_add(bent, v3_scale(toes, 0.15));
        // From the ankle to the ball of the foot it descends by about 32 degrees in the bind pose.
        struct vec3 across = v3_unit(v3_cross(v3(0, 0, 1), v3_scale(toes, 1)));
        if (!(v3_dot(across, across) > 0.5))
            across = quat_rotate(s.pelvis, v3(1, 0, 0));
        struct quat foot = upright(across, v3_cross(toes, across));
        s.foot[side] = r->toes ? quat_multiply(foot, quat_from_rotation_vector(v3(-0.56, 0, 0))) : foot;
        double toe = 0.115 * p->figure.height_m, heel = 0.035 * p->figure.height_m,
               sole = p->bind_joint[JOINT_LEFT_FOOT].z;
        double tip =
            least(quat_rotate(s.foot[side], v3(0, -toe, -sole)).z, quat_rotate(s.foot[side], v3(0, heel, -sole)).z);
        s.ankle[side].z = most(s.ankle[side].z, -tip);
    }
    return s;
}
