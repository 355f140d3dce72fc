// Viewer-aligned and body-aligned frames of bones.
#include "reenact/skeleton/bone_frame.h"

#include "base/clamp.h"

static const double MIN_LENGTH_M = 1e-3;

static bool joint_known(const struct skeleton *s, enum joint j) { return s->confidence[j] > 0; }

static struct vec3 perpendicular_to(struct vec3 v, struct vec3 unit) // the part of v perpendicular to `unit`
{
    return v3_sub(v, v3_scale(unit, v3_dot(v, unit)));
}

static bool set_bone_axis(const struct skeleton *s, enum part p, struct bone_frame *f)
{
    enum joint from = part_ends[p].from, to = part_ends[p].to;
    if (!joint_known(s, from) || !joint_known(s, to))
        return false;
    struct vec3 along = v3_sub(s->joint[to], s->joint[from]);
    f->length = v3_length(along);
    if (!(f->length >= MIN_LENGTH_M) || !isfinite(f->length))
        return false;
    f->origin = s->joint[from];
    f->z = v3_unit(along);
    return true;
}

// y as near to `wanted` as perpendicularity to the bone allows.
static void set_front(struct bone_frame *f, struct vec3 wanted)
{
    struct vec3 y = perpendicular_to(wanted, f->z);
    // Nearly along the bone only rounding is left: a perpendicular that depends on the bone alone is stable.
    if (!(v3_length(y) > 1e-6 * v3_length(wanted)))
        y = v3_perpendicular(f->z);
    f->y = v3_unit(y);
    f->x = v3_cross(f->y, f->z);
}

struct vec3 bone_frame_midpoint(const struct bone_frame *f) { return v3_add(f->origin, v3_scale(f->z, f->length / 2)); }

// The same bone, rotated about it so that y leans towards `eye`.
static struct bone_frame rotated_to_eye(const struct bone_frame *f, struct vec3 eye)
{
    struct bone_frame rotated = *f;
    set_front(&rotated, v3_sub(eye, bone_frame_midpoint(f)));
    return rotated;
}

bool bone_frame_viewer_aligned(const struct skeleton *s, enum part p, struct vec3 eye, struct bone_frame *out)
{
    struct bone_frame f;
    if (!set_bone_axis(s, p, &f))
        return false;
    *out = rotated_to_eye(&f, eye);
    return true;
}

// ---------------------------------------------------------------- axial rotation of the body

struct trunk {
    struct vec3 down, left, front; // unit; front = down x left
};

// Unit vector from the right to the left joint, or zero.
static struct vec3 lateral_axis(const struct skeleton *s, enum joint left, enum joint right)
{
    return joint_known(s, left) && joint_known(s, right) ? v3_unit(v3_sub(s->joint[left], s->joint[right]))
                                                         : v3(0, 0, 0);
}

static bool find_trunk(const struct skeleton *s, bool lower, struct trunk *out)
{
    static const enum joint heights[] = {JOINT_NECK, JOINT_TORSO, JOINT_WAIST};
    int top = -1, bottom = -1;
    for (int i = 0; i < 3; i++)
        if (joint_known(s, heights[i])) {
            top = top < 0 ? i : top;
            bottom = i;
        }
    if (top < 0 || top == bottom)
        return false;
    out->down = v3_unit(v3_sub(s->joint[heights[bottom]], s->joint[heights[top]]));
    struct vec3 shoulders = lateral_axis(s, JOINT_LEFT_SHOULDER, JOINT_RIGHT_SHOULDER);
    struct vec3 hips = lateral_axis(s, JOINT_LEFT_HIP, JOINT_RIGHT_HIP);
    // The trunk may be twisted: the nearer pair has four times the farther one's weight.
    struct vec3 left = lower ? v3_add(v3_scale(hips, 4), shoulders) : v3_add(v3_scale(shoulders, 4), hips);
    left = perpendicular_to(left, out->down);
    if (!(v3_length(left) > 1e-3))
        return false;
    out->left = v3_unit(left);
    out->front = v3_cross(out->down, out->left);
    return true;
}

struct hinged_limb {
    enum joint root, hinge, tip;
    double bend_sign; // +1: the tip swings to the front when it bends (elbow), -1: to the back (knee)
    bool leg;
    double side_sign; // +1 on the left, -1 on the right
};

static bool find_hinged_limb(enum part p, struct hinged_limb *l)
{
    switch (p) {
    case PART_LEFT_UPPER_ARM:
    case PART_LEFT_FOREARM:
        *l = (struct hinged_limb){JOINT_LEFT_SHOULDER, JOINT_LEFT_ELBOW, JOINT_LEFT_HAND, 1, false, 1};
        return true;
    case PART_RIGHT_UPPER_ARM:
    case PART_RIGHT_FOREARM:
        *l = (struct hinged_limb){JOINT_RIGHT_SHOULDER, JOINT_RIGHT_ELBOW, JOINT_RIGHT_HAND, 1, false, -1};
        return true;
    case PART_LEFT_THIGH:
    case PART_LEFT_SHIN:
        *l = (struct hinged_limb){JOINT_LEFT_HIP, JOINT_LEFT_KNEE, JOINT_LEFT_FOOT, -1, true, 1};
        return true;
    case PART_RIGHT_THIGH:
    case PART_RIGHT_SHIN:
        *l = (struct hinged_limb){JOINT_RIGHT_HIP, JOINT_RIGHT_KNEE, JOINT_RIGHT_FOOT, -1, true, -1};
        return true;
    default: return false;
    }
}

static struct vec3 limb_front(const struct skeleton *s, const struct hinged_limb *l, const struct trunk *trunk,
                              struct vec3 z)
{
    // From the trunk: shortest rotation from the neutral direction (legs down, arms down and outwards;
    // its opposite, where that rotation is undefined, is one no arm can point to).
    struct vec3 neutral = l->leg ? trunk->down : v3_unit(v3_add(trunk->down, v3_scale(trunk->left, l->side_sign)));
    struct vec3 from_trunk = quat_rotate(quat_between(neutral, z), trunk->front);
    if (!joint_known(s, l->root) || !joint_known(s, l->hinge) || !joint_known(s, l->tip))
        return from_trunk;
    struct vec3 upper = v3_unit(v3_sub(s->joint[l->hinge], s->joint[l->root]));
    struct vec3 lower = v3_unit(v3_sub(s->joint[l->tip], s->joint[l->hinge]));
    struct vec3 hinge = v3_cross(upper, lower); // its length is the sine of the bend
    double bend = v3_length(hinge);
    struct vec3 bent = v3_scale(v3_unit(v3_cross(hinge, z)), l->bend_sign);
    // From 15 to 45 degrees of bend the hinge takes over.
    double t = (bend - 0.26) / (0.71 - 0.26);
    t = clamp_double(t, 0, 1);
    t = t * t * (3 - 2 * t);
    struct vec3 mixed = v3_mix(from_trunk, bent, t);
    if (v3_length(mixed) > 0.1)
        return mixed;
    return t < 0.5 ? from_trunk : bent;
}

bool bone_frame_body_aligned(const struct skeleton *s, enum part p, struct bone_frame *out)
{
    struct bone_frame f;
    struct trunk trunk;
    struct hinged_limb limb = {0};
    bool is_limb = find_hinged_limb(p, &limb);
    if (!set_bone_axis(s, p, &f) || !find_trunk(s, p == PART_LOWER_TORSO || (is_limb && limb.leg), &trunk))
        return false;
    if (is_limb) {
        set_front(&f, limb_front(s, &limb, &trunk, f.z));
    } else {
        struct vec3 neutral = p == PART_HEAD ? v3_scale(trunk.down, -1) : trunk.down;
        set_front(&f, quat_rotate(quat_between(neutral, f.z), trunk.front));
    }
    *out = f;
    return true;
}

struct vec3 bone_frame_local_direction(const struct bone_frame *f, struct vec3 d)
{
    return v3(v3_dot(d, f->x), v3_dot(d, f->y), v3_dot(d, f->z));
}

struct vec3 bone_frame_local_point(const struct bone_frame *f, struct vec3 p)
{
    return bone_frame_local_direction(f, v3_sub(p, f->origin));
}
