#include "reenact/skeleton/bone_frame.h"

static const double SHORTEST_M = 1e-3;

static bool known(const struct skeleton *s, enum joint j) { return s->confidence[j] > 0; }

static struct vec3 across(struct vec3 v, struct vec3 unit) // the part of v perpendicular to `unit`
{
    return v3_sub(v, v3_scale(unit, v3_dot(v, unit)));
}

static bool bone(const struct skeleton *s, enum part p, struct part_frame *f)
{
    enum joint from = part_ends[p].from, to = part_ends[p].to;
    if (!known(s, from) || !known(s, to))
        return false;
    struct vec3 along = v3_sub(s->joint[to], s->joint[from]);
    f->length = v3_length(along);
    if (!(f->length >= SHORTEST_M) || !isfinite(f->length))
        return false;
    f->origin = s->joint[from];
    f->z = v3_unit(along);
    return true;
}

// y as near to `wanted` as the bone allows.
static void set_front(struct part_frame *f, struct vec3 wanted)
{
    struct vec3 y = across(wanted, f->z);
    // Nearly along the bone the rest is rounding: any perpendicular is as good, and steady.
    if (!(v3_length(y) > 1e-6 * v3_length(wanted)))
        y = v3_perpendicular(f->z);
    f->y = v3_unit(y);
    f->x = v3_cross(f->y, f->z);
}

struct vec3 part_frame_middle(const struct part_frame *f) { return v3_add(f->origin, v3_scale(f->z, f->length / 2)); }

// The same bone, turned about it so that y leans towards `eye`.
static struct part_frame turned_to(const struct part_frame *f, struct vec3 eye)
{
    struct part_frame turned = *f;
    set_front(&turned, v3_sub(eye, part_frame_middle(f)));
    return turned;
}

bool part_frame_facing(const struct skeleton *s, enum part p, struct vec3 eye, struct part_frame *out)
{
    struct part_frame f;
    if (!bone(s, p, &f))
        return false;
    *out = turned_to(&f, eye);
    return true;
}

// ---------------------------------------------------------------- the body's own twist

struct trunk {
    struct vec3 down, left, front; // unit; front = down x left
};

// Unit vector from the right to the left joint, or zero.
static struct vec3 sideways(const struct skeleton *s, enum joint left, enum joint right)
{
    return known(s, left) && known(s, right) ? v3_unit(v3_sub(s->joint[left], s->joint[right])) : v3(0, 0, 0);
}

static bool trunk_of(const struct skeleton *s, bool lower, struct trunk *out)
{
    static const enum joint heights[] = {JOINT_NECK, JOINT_TORSO, JOINT_WAIST};
    int top = -1, bottom = -1;
    for (int i = 0; i < 3; i++)
        if (known(s, heights[i])) {
            top = top < 0 ? i : top;
            bottom = i;
        }
    if (top < 0 || top == bottom)
        return false;
    out->down = v3_unit(v3_sub(s->joint[heights[bottom]], s->joint[heights[top]]));
    struct vec3 shoulders = sideways(s, JOINT_LEFT_SHOULDER, JOINT_RIGHT_SHOULDER);
    struct vec3 hips = sideways(s, JOINT_LEFT_HIP, JOINT_RIGHT_HIP);
    // The trunk twists on its way down: the near pair leads, the far pair stands in.
    struct vec3 left = lower ? v3_add(v3_scale(hips, 4), shoulders) : v3_add(v3_scale(shoulders, 4), hips);
    left = across(left, out->down);
    if (!(v3_length(left) > 1e-3))
        return false;
    out->left = v3_unit(left);
    out->front = v3_cross(out->down, out->left);
    return true;
}

struct limb {
    enum joint root, hinge, tip;
    double bends; // +1: the tip swings to the front when it bends (elbow), -1: to the back (knee)
    bool leg;
    double out; // +1 on the left, -1 on the right
};

static bool limb_of(enum part p, struct limb *l)
{
    switch (p) {
    case PART_LEFT_UPPER_ARM:
    case PART_LEFT_FOREARM:
        *l = (struct limb){JOINT_LEFT_SHOULDER, JOINT_LEFT_ELBOW, JOINT_LEFT_HAND, 1, false, 1};
        return true;
    case PART_RIGHT_UPPER_ARM:
    case PART_RIGHT_FOREARM:
        *l = (struct limb){JOINT_RIGHT_SHOULDER, JOINT_RIGHT_ELBOW, JOINT_RIGHT_HAND, 1, false, -1};
        return true;
    case PART_LEFT_THIGH:
    case PART_LEFT_SHIN: *l = (struct limb){JOINT_LEFT_HIP, JOINT_LEFT_KNEE, JOINT_LEFT_FOOT, -1, true, 1}; return true;
    case PART_RIGHT_THIGH:
    case PART_RIGHT_SHIN:
        *l = (struct limb){JOINT_RIGHT_HIP, JOINT_RIGHT_KNEE, JOINT_RIGHT_FOOT, -1, true, -1};
        return true;
    default: return false;
    }
}

static struct vec3 limb_front(const struct skeleton *s, const struct limb *l, const struct trunk *trunk, struct vec3 z)
{
    // Carried: from rest (legs down, arms down and outwards, which keeps the one
    // direction where the shortest turn is undefined where no arm can point).
    struct vec3 rest = l->leg ? trunk->down : v3_unit(v3_add(trunk->down, v3_scale(trunk->left, l->out)));
    struct vec3 carried = quat_rotate(quat_between(rest, z), trunk->front);
    if (!known(s, l->root) || !known(s, l->hinge) || !known(s, l->tip))
        return carried;
    struct vec3 upper = v3_unit(v3_sub(s->joint[l->hinge], s->joint[l->root]));
    struct vec3 lower = v3_unit(v3_sub(s->joint[l->tip], s->joint[l->hinge]));
    struct vec3 hinge = v3_cross(upper, lower); // its length is the sine of the bend
    double bend = v3_length(hinge);
    struct vec3 bent = v3_scale(v3_unit(v3_cross(hinge, z)), l->bends);
    // From 15 to 45 degrees of bend the hinge takes over.
    double t = (bend - 0.26) / (0.71 - 0.26);
    t = t < 0 ? 0 : t > 1 ? 1 : t;
    t = t * t * (3 - 2 * t);
    struct vec3 mixed = v3_mix(carried, bent, t);
    return v3_length(mixed) > 0.1 ? mixed : t < 0.5 ? carried : bent;
}

bool part_frame_bodily(const struct skeleton *s, enum part p, struct part_frame *out)
{
    struct part_frame f;
    struct trunk trunk;
    struct limb limb = {0};
    bool is_limb = limb_of(p, &limb);
    if (!bone(s, p, &f) || !trunk_of(s, p == PART_LOWER_TORSO || (is_limb && limb.leg), &trunk))
        return false;
    if (is_limb) {
        set_front(&f, limb_front(s, &limb, &trunk, f.z));
    } else {
        struct vec3 rest = p == PART_HEAD ? v3_scale(trunk.down, -1) : trunk.down;
        set_front(&f, quat_rotate(quat_between(rest, f.z), trunk.front));
    }
    *out = f;
    return true;
}

struct vec3 part_frame_direction_in(const struct part_frame *f, struct vec3 d)
{
    return v3(v3_dot(d, f->x), v3_dot(d, f->y), v3_dot(d, f->z));
}

struct vec3 part_frame_point_in(const struct part_frame *f, struct vec3 p)
{
    return part_frame_direction_in(f, v3_sub(p, f->origin));
}
