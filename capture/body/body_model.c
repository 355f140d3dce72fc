#include "capture/body/body_model.h"

#include "base/portable_math.h"

// Where a segment begins. Lengths are fractions of body height; x scales with `wide`, y and z with `tall`.
struct segment_rule {
    int parent;
    struct vec3 at; // origin in the parent's axes
    enum shape_factor wide, tall;
};

static const struct segment_rule segment_rule[SEG_COUNT] = {
    [SEG_PELVIS] = {-1, {0, 0, 0}, SHAPE_HIPS, SHAPE_TORSO},
    [SEG_ABDOMEN] = {SEG_PELVIS, {0, 0, 0}, SHAPE_HIPS, SHAPE_TORSO},
    [SEG_CHEST] = {SEG_ABDOMEN, {0, 0.125, 0}, SHAPE_HIPS, SHAPE_TORSO},
    [SEG_HEAD] = {SEG_CHEST, {0, 0.159, 0}, SHAPE_SHOULDERS, SHAPE_TORSO},
    [SEG_LEFT_CLAVICLE] = {SEG_CHEST, {0, 0.159, 0}, SHAPE_SHOULDERS, SHAPE_TORSO},
    [SEG_LEFT_UPPER_ARM] = {SEG_LEFT_CLAVICLE, {0.103, -0.035, 0.006}, SHAPE_SHOULDERS, SHAPE_SHOULDERS},
    [SEG_LEFT_FOREARM] = {SEG_LEFT_UPPER_ARM, {0, -0.165, 0}, SHAPE_UPPER_ARM, SHAPE_UPPER_ARM},
    [SEG_LEFT_HAND] = {SEG_LEFT_FOREARM, {0, -0.148, 0}, SHAPE_FOREARM, SHAPE_FOREARM},
    [SEG_RIGHT_CLAVICLE] = {SEG_CHEST, {0, 0.159, 0}, SHAPE_SHOULDERS, SHAPE_TORSO},
    [SEG_RIGHT_UPPER_ARM] = {SEG_RIGHT_CLAVICLE, {-0.103, -0.035, 0.006}, SHAPE_SHOULDERS, SHAPE_SHOULDERS},
    [SEG_RIGHT_FOREARM] = {SEG_RIGHT_UPPER_ARM, {0, -0.165, 0}, SHAPE_UPPER_ARM, SHAPE_UPPER_ARM},
    [SEG_RIGHT_HAND] = {SEG_RIGHT_FOREARM, {0, -0.148, 0}, SHAPE_FOREARM, SHAPE_FOREARM},
    [SEG_LEFT_THIGH] = {SEG_PELVIS, {0.055, -0.038, 0.018}, SHAPE_HIPS, SHAPE_TORSO},
    [SEG_LEFT_SHIN] = {SEG_LEFT_THIGH, {0, -0.250, 0}, SHAPE_THIGH, SHAPE_THIGH},
    [SEG_LEFT_FOOT] = {SEG_LEFT_SHIN, {0, -0.238, 0}, SHAPE_SHIN, SHAPE_SHIN},
    [SEG_RIGHT_THIGH] = {SEG_PELVIS, {-0.055, -0.038, 0.018}, SHAPE_HIPS, SHAPE_TORSO},
    [SEG_RIGHT_SHIN] = {SEG_RIGHT_THIGH, {0, -0.250, 0}, SHAPE_THIGH, SHAPE_THIGH},
    [SEG_RIGHT_FOOT] = {SEG_RIGHT_SHIN, {0, -0.238, 0}, SHAPE_SHIN, SHAPE_SHIN},
};

// Hip joints ahead of the spine, of body height, in a skirt: about half as far as without. Cloth draws hidden thighs
// forward; without this, legs cross while the person rotates.
#define HIPS_FORWARD_IN_SKIRT 0.010

// The model's hem is this much lower than the level of the sharpest narrowing: a hem is not level, and a cone's surface
// ends before its axis does. Cloth beyond the end would be matched to legs and pull knees forward, inward and thick.
// The best of three lengths on rendered skirts and coats (docs/notes/skeleton.md).
#define HEM_SLACK_M 0.06

#define SKIRT_FORWARD 0.024 // of body height: the skirt's upper end ahead of the waist joint

// A solid in its segment. Fractions of body height; x scales with `wide`, y with `tall`; widths, radii and z with
// `girth`. Lengths are those of segment_rule; breadths, depths and offsets are from the sources in body_model.h, or
// else chosen by hand.
struct solid_rule {
    enum segment segment;
    struct vec3 a, b;
    double width_a, width_b, radius_a, radius_b;
    enum shape_factor wide, tall, girth;
};

#define ARM(side, sign)                                                                                                \
    {SEG_##side##_CLAVICLE,                                                                                            \
     {sign * 0.015, -0.020, 0.008},                                                                                    \
     {sign * 0.098, -0.035, 0.006},                                                                                    \
     0,                                                                                                                \
     0,                                                                                                                \
     0.036,                                                                                                            \
     0.033,                                                                                                            \
     SHAPE_SHOULDERS,                                                                                                  \
     SHAPE_SHOULDERS,                                                                                                  \
     SHAPE_ARM_GIRTH},                                                                                                 \
        {SEG_##side##_UPPER_ARM, {0, 0, 0},       {0, -0.165, 0}, 0, 0, 0.030, 0.0235,                                 \
         SHAPE_SHOULDERS,        SHAPE_UPPER_ARM, SHAPE_ARM_GIRTH},                                                    \
        {SEG_##side##_FOREARM, {0, 0, 0},     {0, -0.148, 0}, 0, 0, 0.0245, 0.0165,                                    \
         SHAPE_SHOULDERS,      SHAPE_FOREARM, SHAPE_ARM_GIRTH},                                                        \
    {                                                                                                                  \
        SEG_##side##_HAND, {0, -0.010, 0}, {0, -0.075, 0}, 0, 0, 0.0190, 0.0160, SHAPE_SHOULDERS, SHAPE_FOREARM,       \
            SHAPE_FOREARM                                                                                              \
    }
#define LEG(side)                                                                                                      \
    {SEG_##side##_THIGH, {0, 0, 0}, {0, -0.250, 0}, 0, 0, 0.050, 0.034, SHAPE_HIPS, SHAPE_THIGH, SHAPE_LEG_GIRTH},     \
        {SEG_##side##_SHIN, {0, 0, 0}, {0, -0.238, 0}, 0, 0, 0.0335, 0.0215, SHAPE_HIPS, SHAPE_SHIN, SHAPE_LEG_GIRTH}, \
    {                                                                                                                  \
        SEG_##side##_FOOT, {0, -0.018, -0.012}, {0, -0.026, 0.095}, 0, 0, 0.0215, 0.0170, SHAPE_HIPS, SHAPE_SHIN,      \
            SHAPE_LEG_GIRTH                                                                                            \
    }

static const struct solid_rule solid_rule[SOLID_SKIRT] = {
    {SEG_PELVIS,
     {0, -0.050, 0.022},
     {0, 0.012, 0.028},
     0.026,
     0.020,
     0.072,
     0.068,
     SHAPE_HIPS,
     SHAPE_TORSO,
     SHAPE_HIP_GIRTH},
    {SEG_ABDOMEN,
     {0, 0.020, 0.032},
     {0, 0.115, 0.034},
     0.012,
     0.010,
     0.067,
     0.068,
     SHAPE_HIPS,
     SHAPE_TORSO,
     SHAPE_WAIST_GIRTH},
    {SEG_CHEST,
     {0, 0.0, 0.034},
     {0, 0.094, 0.030},
     0.010,
     0.028,
     0.072,
     0.067,
     SHAPE_SHOULDERS,
     SHAPE_TORSO,
     SHAPE_CHEST_GIRTH},
    {SEG_HEAD, {0, -0.010, 0.004}, {0, 0.055, 0.008}, 0, 0, 0.036, 0.034, SHAPE_HEAD, SHAPE_HEAD, SHAPE_HEAD},
    {SEG_HEAD, {0, 0.060, 0.024}, {0, 0.094, 0.018}, 0, 0, 0.046, 0.052, SHAPE_HEAD, SHAPE_HEAD, SHAPE_HEAD},
    ARM(LEFT, 1),
    ARM(RIGHT, -1),
    LEG(LEFT),
    LEG(RIGHT),
};

#define TRUNK_FORWARD 0.03 // the middle of the trunk ahead of the spine's joints, of body height

// Joints within segments, fractions of body height. From the head's joint at the seventh cervical vertebra: the head
// between the ears, the neck where it meets the shoulders. Measured on rendered people (docs/notes/skeleton.md).
static const struct vec3 head_centre = {0, 0.084, 0};
static const struct vec3 neck = {0, -0.006, 0.0035};
static const struct vec3 palm = {0, -0.154, 0};        // its beginning, from the elbow: beyond the wrist
static const struct vec3 chest_centre = {0, 0.006, 0}; // above its joint with the abdomen

const struct body_limb body_limbs[LIMB_COUNT] = {
    {SEG_LEFT_UPPER_ARM, SEG_LEFT_FOREARM, SEG_LEFT_HAND, JOINT_LEFT_SHOULDER, JOINT_LEFT_ELBOW, JOINT_LEFT_HAND,
     SOLID_LEFT_ARM + 1},
    {SEG_RIGHT_UPPER_ARM, SEG_RIGHT_FOREARM, SEG_RIGHT_HAND, JOINT_RIGHT_SHOULDER, JOINT_RIGHT_ELBOW, JOINT_RIGHT_HAND,
     SOLID_RIGHT_ARM + 1},
    {SEG_LEFT_THIGH, SEG_LEFT_SHIN, SEG_LEFT_FOOT, JOINT_LEFT_HIP, JOINT_LEFT_KNEE, JOINT_LEFT_FOOT, SOLID_LEFT_LEG},
    {SEG_RIGHT_THIGH, SEG_RIGHT_SHIN, SEG_RIGHT_FOOT, JOINT_RIGHT_HIP, JOINT_RIGHT_KNEE, JOINT_RIGHT_FOOT,
     SOLID_RIGHT_LEG},
};

int body_parent(enum segment segment) { return segment_rule[segment].parent; }

enum segment body_mirror(enum segment s)
{
    if (s >= SEG_LEFT_CLAVICLE && s <= SEG_LEFT_HAND)
        return s + 4;
    if (s >= SEG_RIGHT_CLAVICLE && s <= SEG_RIGHT_HAND)
        return s - 4;
    if (s >= SEG_LEFT_THIGH && s <= SEG_LEFT_FOOT)
        return s + 3;
    if (s >= SEG_RIGHT_THIGH)
        return s - 3;
    return s;
}

static struct vec3 rotate(double m[3][3], struct vec3 v)
{
    return v3(m[0][0] * v.x + m[0][1] * v.y + m[0][2] * v.z, m[1][0] * v.x + m[1][1] * v.y + m[1][2] * v.z,
              m[2][0] * v.x + m[2][1] * v.y + m[2][2] * v.z);
}

// Two cones from the waist down to the hem, as wide as the hips at the top. Each swings with its thigh, the more the
// lower. They hang from straight below the waist joint, not from the hip joints ahead of it.
static void add_skirt(const struct body_shape *shape, double hip_girth, struct body_build *out)
{
    const struct body_solid *hips = &out->solid[0];
    struct vec3 down = v3(0, -1, 0), waist = out->origin[SEG_PELVIS], hanging = rotate(out->axes[SEG_PELVIS], down),
                ahead = rotate(out->axes[SEG_PELVIS], v3(0, 0, 1)), middle = out->origin[SEG_LEFT_THIGH];
    middle = v3_mix(middle, out->origin[SEG_RIGHT_THIGH], 0.5);
    middle = v3_sub(middle, v3_scale(ahead, v3_dot(ahead, v3_sub(middle, waist))));
    for (int side = 0; side < 2; side++) {
        struct body_solid *s = &out->solid[SOLID_SKIRT + side];
        struct vec3 beside = v3_scale(hips->side, side ? -1 : 1),
                    thigh = rotate(out->axes[side ? SEG_RIGHT_THIGH : SEG_LEFT_THIGH], down),
                    along = v3_unit(v3_mix(hanging, thigh, BODY_SKIRT_SWING)),
                    top = v3_add(waist, rotate(out->axes[SEG_PELVIS], v3(0, 0, SKIRT_FORWARD * hip_girth))),
                    low = v3_add(middle, v3_scale(along, shape->hem_m + HEM_SLACK_M - v3_distance(waist, middle)));
        s->segment = SEG_PELVIS;
        s->a = v3_add(top, v3_scale(beside, hips->width_b));
        s->b = v3_add(low, v3_scale(beside, 0.25 * shape->hem_radius_m));
        s->side = hips->side;
        s->width_a = s->width_b = 0;
        s->radius_a = hips->radius_b;
        s->radius_b = 0.75 * shape->hem_radius_m;
        s->open = true;
    }
    out->solids = SOLID_COUNT;
}

// Origins and axes of the segments.
static void place_segments(const struct body_shape *shape, const struct body_pose *pose,
                           const double factor[SHAPE_COUNT], struct body_build *out)
{
    for (int s = 0; s < SEG_COUNT; s++) {
        const struct segment_rule *rule = &segment_rule[s];
        double own[3][3];
        quat_to_matrix(pose->rotation[s], own);
        if (rule->parent < 0) {
            out->origin[s] = pose->root;
            for (int r = 0; r < 3; r++)
                for (int c = 0; c < 3; c++) {
                    out->parent_axes[s][r][c] = r == c;
                    out->axes[s][r][c] = own[r][c];
                }
            continue;
        }
        bool in_skirt = shape->hem_m > 0 && (s == SEG_LEFT_THIGH || s == SEG_RIGHT_THIGH);
        double ahead = in_skirt ? HIPS_FORWARD_IN_SKIRT : rule->at.z;
        struct vec3 at =
            v3(rule->at.x * factor[rule->wide], rule->at.y * factor[rule->tall], ahead * factor[rule->tall]);
        out->origin[s] = v3_add(out->origin[rule->parent], rotate(out->axes[rule->parent], at));
        for (int r = 0; r < 3; r++)
            for (int c = 0; c < 3; c++) {
                const double(*p)[3] = (const double(*)[3])out->axes[rule->parent];
                out->parent_axes[s][r][c] = p[r][c];
                out->axes[s][r][c] = p[r][0] * own[0][c] + p[r][1] * own[1][c] + p[r][2] * own[2][c];
            }
    }
}

static void place_solids(const double factor[SHAPE_COUNT], struct body_build *out)
{
    for (int i = 0; i < SOLID_SKIRT; i++) {
        const struct solid_rule *rule = &solid_rule[i];
        double wide = factor[rule->wide], tall = factor[rule->tall], girth = factor[rule->girth];
        struct vec3 a = v3(rule->a.x * wide, rule->a.y * tall, rule->a.z * girth),
                    b = v3(rule->b.x * wide, rule->b.y * tall, rule->b.z * girth);
        struct body_solid *solid = &out->solid[i];
        solid->segment = rule->segment;
        solid->a = v3_add(out->origin[rule->segment], rotate(out->axes[rule->segment], a));
        solid->b = v3_add(out->origin[rule->segment], rotate(out->axes[rule->segment], b));
        solid->side = rotate(out->axes[rule->segment], v3(1, 0, 0));
        solid->width_a = rule->width_a * girth;
        solid->width_b = rule->width_b * girth;
        solid->radius_a = rule->radius_a * girth;
        solid->radius_b = rule->radius_b * girth;
        solid->open = false;
    }
    out->solids = SOLID_SKIRT;
}

static void place_joints(const double factor[SHAPE_COUNT], struct body_build *out)
{
    static const struct {
        enum joint joint;
        enum segment segment;
    } at_origin[] = {
        {JOINT_LEFT_SHOULDER, SEG_LEFT_UPPER_ARM},
        {JOINT_LEFT_ELBOW, SEG_LEFT_FOREARM},
        {JOINT_RIGHT_SHOULDER, SEG_RIGHT_UPPER_ARM},
        {JOINT_RIGHT_ELBOW, SEG_RIGHT_FOREARM},
        {JOINT_WAIST, SEG_PELVIS},
        {JOINT_LEFT_HIP, SEG_LEFT_THIGH},
        {JOINT_LEFT_KNEE, SEG_LEFT_SHIN},
        {JOINT_LEFT_FOOT, SEG_LEFT_FOOT},
        {JOINT_RIGHT_HIP, SEG_RIGHT_THIGH},
        {JOINT_RIGHT_KNEE, SEG_RIGHT_SHIN},
        {JOINT_RIGHT_FOOT, SEG_RIGHT_FOOT},
    };
    for (size_t i = 0; i < COUNT_OF(at_origin); i++)
        out->joint[at_origin[i].joint] = out->origin[at_origin[i].segment];
    const struct {
        enum joint joint;
        enum segment segment;
        struct vec3 at;
        double size;
    } within[] = {
        {JOINT_HEAD, SEG_HEAD, head_centre, factor[SHAPE_HEAD]},
        {JOINT_NECK, SEG_HEAD, neck, factor[SHAPE_TORSO]},
        {JOINT_TORSO, SEG_CHEST, chest_centre, factor[SHAPE_TORSO]},
        {JOINT_LEFT_HAND, SEG_LEFT_FOREARM, palm, factor[SHAPE_FOREARM]},
        {JOINT_RIGHT_HAND, SEG_RIGHT_FOREARM, palm, factor[SHAPE_FOREARM]},
    };
    for (size_t i = 0; i < COUNT_OF(within); i++)
        out->joint[within[i].joint] =
            v3_add(out->origin[within[i].segment],
                   rotate(out->axes[within[i].segment], v3_scale(within[i].at, within[i].size)));
}

void body_forward_kinematics(const struct body_shape *shape, const struct body_pose *pose, struct body_build *out)
{
    double factor[SHAPE_COUNT];
    for (int i = 0; i < SHAPE_COUNT; i++)
        factor[i] = portable_exp(shape->log[i] + (i ? shape->log[SHAPE_SCALE] : 0)) * BODY_AVERAGE_HEIGHT_M;
    place_segments(shape, pose, factor, out);
    place_solids(factor, out);
    if (shape->hem_m > 0)
        add_skirt(shape, factor[SHAPE_HIP_GIRTH], out);
    place_joints(factor, out);
}

struct body_pose body_standing_pose(struct vec3 root, struct vec3 up, double yaw)
{
    // Facing the camera: left is +x of the image, ahead is towards the camera.
    struct vec3 ahead = v3_unit(v3_sub(v3(0, 0, -1), v3_scale(up, v3_dot(up, v3(0, 0, -1)))));
    struct vec3 left = v3_cross(up, ahead);
    double m[3][3] = {{left.x, up.x, ahead.x}, {left.y, up.y, ahead.y}, {left.z, up.z, ahead.z}};
    struct body_pose pose = {.root = root};
    for (int s = 0; s < SEG_COUNT; s++)
        pose.rotation[s] = (struct quat){0, 0, 0, 1};
    pose.rotation[SEG_PELVIS] = quat_multiply(quat_from_rotation_vector(v3_scale(up, yaw)), quat_from_matrix(m));
    return pose;
}

struct body_pose body_pose_flip_facing(const struct body_shape *shape, const struct body_pose *pose)
{
    static const struct quat half_turn = {0, 1, 0, 0}; // about every segment's own y
    // The root lies in the spine, behind the middle of the trunk.
    double ahead_m = TRUNK_FORWARD * portable_exp(shape->log[SHAPE_SCALE]) * BODY_AVERAGE_HEIGHT_M;
    struct vec3 ahead = quat_rotate(pose->rotation[SEG_PELVIS], v3(0, 0, 2 * ahead_m));
    struct body_pose out = {.root = v3_add(pose->root, ahead)};
    out.rotation[SEG_PELVIS] = quat_multiply(pose->rotation[SEG_PELVIS], half_turn);
    for (int s = 1; s < SEG_COUNT; s++)
        out.rotation[s] = quat_multiply(quat_conjugate(half_turn),
                                        quat_multiply(pose->rotation[body_mirror((enum segment)s)], half_turn));
    return out;
}
