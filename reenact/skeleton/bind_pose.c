// Bind pose from median bone lengths; bone transforms; skin weights by capsule distances.
#include "reenact/skeleton/bind_pose.h"

#include "base/clamp.h"

#include <stdlib.h>

// ---------------------------------------------------------------- bone frame

// Viewer-aligned and body-aligned frames of bones.

static const double MIN_LENGTH_M = 1e-3;

static bool joint_known(const struct skeleton *skeleton, enum joint joint) { return skeleton->confidence[joint] > 0; }

static struct vec3 perpendicular_to(struct vec3 v, struct vec3 unit) // the part of v perpendicular to `unit`
{
    return v3_sub(v, v3_scale(unit, v3_dot(v, unit)));
}

static bool set_bone_axis(const struct skeleton *skeleton, enum part part, struct bone_frame *frame)
{
    enum joint from = part_ends[part].from, to = part_ends[part].to;
    if (!joint_known(skeleton, from) || !joint_known(skeleton, to))
        return false;
    struct vec3 along = v3_sub(skeleton->joint[to], skeleton->joint[from]);
    frame->length = v3_length(along);
    if (!(frame->length >= MIN_LENGTH_M) || !isfinite(frame->length))
        return false;
    frame->origin = skeleton->joint[from];
    frame->z = v3_unit(along);
    return true;
}

// y as near to `wanted` as perpendicularity to the bone allows.
static void set_front(struct bone_frame *frame, struct vec3 wanted)
{
    struct vec3 y = perpendicular_to(wanted, frame->z);
    // Nearly along the bone only rounding is left: a perpendicular that depends on the bone alone is stable.
    if (!(v3_length(y) > 1e-6 * v3_length(wanted)))
        y = v3_perpendicular(frame->z);
    frame->y = v3_unit(y);
    frame->x = v3_cross(frame->y, frame->z);
}

struct vec3 bone_frame_midpoint(const struct bone_frame *frame)
{
    return v3_add(frame->origin, v3_scale(frame->z, frame->length / 2));
}

struct quat bone_frame_rotation(const struct bone_frame *frame)
{
    double m[3][3] = {{frame->x.x, frame->y.x, frame->z.x},
                      {frame->x.y, frame->y.y, frame->z.y},
                      {frame->x.z, frame->y.z, frame->z.z}};
    return quat_from_matrix(m);
}

// The same bone, rotated about it so that y leans towards `eye`.
static struct bone_frame rotated_to_eye(const struct bone_frame *frame, struct vec3 eye)
{
    struct bone_frame rotated = *frame;
    set_front(&rotated, v3_sub(eye, bone_frame_midpoint(frame)));
    return rotated;
}

bool bone_frame_viewer_aligned(const struct skeleton *skeleton, enum part part, struct vec3 eye, struct bone_frame *out)
{
    struct bone_frame f;
    if (!set_bone_axis(skeleton, part, &f))
        return false;
    *out = rotated_to_eye(&f, eye);
    return true;
}

// ---------------------------------------------------------------- axial rotation of the body

struct trunk {
    struct vec3 down, left, front; // unit; front = down x left
};

// Unit vector from the right to the left joint, or zero.
static struct vec3 lateral_axis(const struct skeleton *skeleton, enum joint left, enum joint right)
{
    return joint_known(skeleton, left) && joint_known(skeleton, right)
               ? v3_unit(v3_sub(skeleton->joint[left], skeleton->joint[right]))
               : v3(0, 0, 0);
}

static bool find_trunk(const struct skeleton *skeleton, bool lower, struct trunk *out)
{
    static const enum joint heights[] = {JOINT_NECK, JOINT_TORSO, JOINT_WAIST};
    int top = -1, bottom = -1;
    for (int i = 0; i < 3; i++)
        if (joint_known(skeleton, heights[i])) {
            top = top < 0 ? i : top;
            bottom = i;
        }
    if (top < 0 || top == bottom)
        return false;
    out->down = v3_unit(v3_sub(skeleton->joint[heights[bottom]], skeleton->joint[heights[top]]));
    struct vec3 shoulders = lateral_axis(skeleton, JOINT_LEFT_SHOULDER, JOINT_RIGHT_SHOULDER);
    struct vec3 hips = lateral_axis(skeleton, JOINT_LEFT_HIP, JOINT_RIGHT_HIP);
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

static bool find_hinged_limb(enum part part, struct hinged_limb *limb)
{
    switch (part) {
    case PART_LEFT_UPPER_ARM:
    case PART_LEFT_FOREARM:
        *limb = (struct hinged_limb){JOINT_LEFT_SHOULDER, JOINT_LEFT_ELBOW, JOINT_LEFT_HAND, 1, false, 1};
        return true;
    case PART_RIGHT_UPPER_ARM:
    case PART_RIGHT_FOREARM:
        *limb = (struct hinged_limb){JOINT_RIGHT_SHOULDER, JOINT_RIGHT_ELBOW, JOINT_RIGHT_HAND, 1, false, -1};
        return true;
    case PART_LEFT_THIGH:
    case PART_LEFT_SHIN:
        *limb = (struct hinged_limb){JOINT_LEFT_HIP, JOINT_LEFT_KNEE, JOINT_LEFT_FOOT, -1, true, 1};
        return true;
    case PART_RIGHT_THIGH:
    case PART_RIGHT_SHIN:
        *limb = (struct hinged_limb){JOINT_RIGHT_HIP, JOINT_RIGHT_KNEE, JOINT_RIGHT_FOOT, -1, true, -1};
        return true;
    default: return false;
    }
}

static struct vec3 limb_front(const struct skeleton *skeleton, const struct hinged_limb *limb,
                              const struct trunk *trunk, struct vec3 z)
{
    // From the trunk: shortest rotation from the neutral direction (legs down, arms down and outwards;
    // its opposite, where that rotation is undefined, is one no arm can point to).
    struct vec3 neutral =
        limb->leg ? trunk->down : v3_unit(v3_add(trunk->down, v3_scale(trunk->left, limb->side_sign)));
    struct vec3 from_trunk = quat_rotate(quat_between(neutral, z), trunk->front);
    if (!joint_known(skeleton, limb->root) || !joint_known(skeleton, limb->hinge) || !joint_known(skeleton, limb->tip))
        return from_trunk;
    struct vec3 upper = v3_unit(v3_sub(skeleton->joint[limb->hinge], skeleton->joint[limb->root]));
    struct vec3 lower = v3_unit(v3_sub(skeleton->joint[limb->tip], skeleton->joint[limb->hinge]));
    struct vec3 hinge = v3_cross(upper, lower); // its length is the sine of the bend
    double bend = v3_length(hinge);
    struct vec3 bent = v3_scale(v3_unit(v3_cross(hinge, z)), limb->bend_sign);
    // From 15 to 45 degrees of bend the hinge takes over.
    double t = (bend - 0.26) / (0.71 - 0.26);
    t = clamp_double(t, 0, 1);
    t = t * t * (3 - 2 * t);
    struct vec3 mixed = v3_mix(from_trunk, bent, t);
    if (v3_length(mixed) > 0.1)
        return mixed;
    return t < 0.5 ? from_trunk : bent;
}

bool bone_frame_body_aligned(const struct skeleton *skeleton, enum part part, struct bone_frame *out)
{
    struct bone_frame f;
    struct trunk trunk;
    struct hinged_limb limb = {0};
    bool is_limb = find_hinged_limb(part, &limb);
    if (!set_bone_axis(skeleton, part, &f) ||
        !find_trunk(skeleton, part == PART_LOWER_TORSO || (is_limb && limb.leg), &trunk))
        return false;
    if (is_limb) {
        set_front(&f, limb_front(skeleton, &limb, &trunk, f.z));
    } else {
        struct vec3 neutral = part == PART_HEAD ? v3_scale(trunk.down, -1) : trunk.down;
        set_front(&f, quat_rotate(quat_between(neutral, f.z), trunk.front));
    }
    *out = f;
    return true;
}

struct vec3 bone_frame_local_direction(const struct bone_frame *frame, struct vec3 d)
{
    return v3(v3_dot(d, frame->x), v3_dot(d, frame->y), v3_dot(d, frame->z));
}

struct vec3 bone_frame_local_point(const struct bone_frame *frame, struct vec3 p)
{
    return bone_frame_local_direction(frame, v3_sub(p, frame->origin));
}

// ---------------------------------------------------------------- bind pose

// Skin weights blend over points up to this much farther from the second bone than from the first. Chosen by hand.
static const double BLEND_M = 0.05;

const struct bone_link bone_links[BONE_LINKS] = {
    {PART_UPPER_TORSO, PART_HEAD, JOINT_NECK},
    {PART_UPPER_TORSO, PART_LOWER_TORSO, JOINT_TORSO},
    {PART_UPPER_TORSO, PART_LEFT_UPPER_ARM, JOINT_LEFT_SHOULDER},
    {PART_UPPER_TORSO, PART_RIGHT_UPPER_ARM, JOINT_RIGHT_SHOULDER},
    {PART_LEFT_UPPER_ARM, PART_LEFT_FOREARM, JOINT_LEFT_ELBOW},
    {PART_RIGHT_UPPER_ARM, PART_RIGHT_FOREARM, JOINT_RIGHT_ELBOW},
    {PART_LOWER_TORSO, PART_LEFT_THIGH, JOINT_LEFT_HIP},
    {PART_LOWER_TORSO, PART_RIGHT_THIGH, JOINT_RIGHT_HIP},
    {PART_LEFT_THIGH, PART_LEFT_SHIN, JOINT_LEFT_KNEE},
    {PART_RIGHT_THIGH, PART_RIGHT_SHIN, JOINT_RIGHT_KNEE},
    {PART_LEFT_SHIN, BONE_LEFT_FOOT, JOINT_LEFT_FOOT},
    {PART_RIGHT_SHIN, BONE_RIGHT_FOOT, JOINT_RIGHT_FOOT},
    {PART_LEFT_FOREARM, BONE_LEFT_HAND, JOINT_LEFT_HAND},
    {PART_RIGHT_FOREARM, BONE_RIGHT_HAND, JOINT_RIGHT_HAND},
    {PART_HEAD, BONE_SKULL, JOINT_HEAD},
};

// End bones: where along the part they begin and their direction and length in the part's axes, in part lengths. The
// head part reaches from the base of the neck to between the ears: its lower half is the neck. Chosen by hand.
static const struct end_bone {
    enum part part;
    double from;
    struct vec3 along;
} end_bones[BONE_COUNT - PART_COUNT] = {
    {PART_LEFT_SHIN, 1, {0, 0.4, 0.15}},  {PART_RIGHT_SHIN, 1, {0, 0.4, 0.15}}, {PART_LEFT_FOREARM, 1, {0, 0, 0.4}},
    {PART_RIGHT_FOREARM, 1, {0, 0, 0.4}}, {PART_HEAD, 0.5, {0, 0, 0.8}},
};

enum part bone_part(int bone) { return bone < PART_COUNT ? (enum part)bone : end_bones[bone - PART_COUNT].part; }

bool bones_adjacent(int a, int b)
{
    bool meet = a == b;
    for (int i = 0; i < BONE_LINKS; i++)
        meet |= (bone_links[i].a == a && bone_links[i].b == b) || (bone_links[i].a == b && bone_links[i].b == a);
    return meet;
}

// ---------------------------------------------------------------- the pose

static int by_value(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double find_median(double *values, int64_t count)
{
    qsort(values, (size_t)count, sizeof *values, by_value);
    return values[count / 2];
}

// The median distance of two joints over the take; 0: never known together. scratch: [frames].
static double median_distance(const struct take *take, enum joint a, enum joint b, double *scratch)
{
    int64_t count = 0;
    for (int64_t i = 0; i < take_frame_count(take); i++) {
        const struct take_entry *e = take_entry(take, i);
        if (e->has_skeleton && e->skeleton.confidence[a] > 0 && e->skeleton.confidence[b] > 0)
            scratch[count++] = v3_distance(e->skeleton.joint[a], e->skeleton.joint[b]);
    }
    return count ? find_median(scratch, count) : 0;
}

struct joint_rule {
    enum joint joint, from;
    double x, y; // direction of the bone, unit
};

// Places joints one median bone length from a joint already placed.
static void place_joints(struct skeleton *skeleton, const struct take *take, const struct joint_rule *rules,
                         size_t count, double *scratch)
{
    for (size_t i = 0; i < count; i++) {
        double length = median_distance(take, rules[i].from, rules[i].joint, scratch);
        if (!(length > 0) || !(skeleton->confidence[rules[i].from] > 0))
            continue;
        skeleton->joint[rules[i].joint] =
            v3_add(skeleton->joint[rules[i].from], v3(rules[i].x * length, rules[i].y * length, 0));
        skeleton->confidence[rules[i].joint] = 1;
    }
}

static void set_bind_joints(struct skeleton *skeleton, const struct take *take, double *scratch)
{
    static const struct joint_rule spine[] = {
        {JOINT_HEAD, JOINT_NECK, 0, -1},
        {JOINT_TORSO, JOINT_NECK, 0, 1},
        {JOINT_WAIST, JOINT_TORSO, 0, 1},
    };
    static const struct joint_rule limbs[] = {
        {JOINT_LEFT_ELBOW, JOINT_LEFT_SHOULDER, 0.8, 0.6}, {JOINT_RIGHT_ELBOW, JOINT_RIGHT_SHOULDER, -0.8, 0.6},
        {JOINT_LEFT_HAND, JOINT_LEFT_ELBOW, 0.8, 0.6},     {JOINT_RIGHT_HAND, JOINT_RIGHT_ELBOW, -0.8, 0.6},
        {JOINT_LEFT_KNEE, JOINT_LEFT_HIP, 0.24, 0.97},     {JOINT_RIGHT_KNEE, JOINT_RIGHT_HIP, -0.24, 0.97},
        {JOINT_LEFT_FOOT, JOINT_LEFT_KNEE, 0.24, 0.97},    {JOINT_RIGHT_FOOT, JOINT_RIGHT_KNEE, -0.24, 0.97},
    };
    static const enum joint pairs[2][3] = {{JOINT_LEFT_SHOULDER, JOINT_RIGHT_SHOULDER, JOINT_NECK},
                                           {JOINT_LEFT_HIP, JOINT_RIGHT_HIP, JOINT_WAIST}};
    skeleton->confidence[JOINT_NECK] = 1;
    place_joints(skeleton, take, spine, COUNT_OF(spine), scratch);
    for (int i = 0; i < 2; i++) { // shoulders and hips: beside the spine, below it as the distances require
        double across = median_distance(take, pairs[i][0], pairs[i][1], scratch) / 2;
        double slope = (median_distance(take, pairs[i][0], pairs[i][2], scratch) +
                        median_distance(take, pairs[i][1], pairs[i][2], scratch)) /
                       2;
        if (!(across > 0) || !(skeleton->confidence[pairs[i][2]] > 0))
            continue;
        double down = slope > across ? sqrt(slope * slope - across * across) : 0;
        for (int side = 0; side < 2; side++) {
            skeleton->joint[pairs[i][side]] =
                v3_add(skeleton->joint[pairs[i][2]], v3(side ? -across : across, down, 0));
            skeleton->confidence[pairs[i][side]] = 1;
        }
    }
    place_joints(skeleton, take, limbs, COUNT_OF(limbs), scratch);
}

// The orientation of an end bone in its part is the typical one of a standing person.
static void set_end_bone(struct bind_pose *bind, int bone)
{
    const struct end_bone *end = &end_bones[bone - PART_COUNT];
    const struct bone_frame *f = &bind->frame[end->part];
    bind->known[bone] = bind->known[end->part];
    if (!bind->known[bone])
        return;
    struct vec3 along = v3_add(v3_scale(f->y, end->along.y), v3_scale(f->z, end->along.z));
    struct bone_frame *own = &bind->frame[bone];
    own->origin = v3_add(f->origin, v3_scale(f->z, end->from * f->length));
    bind->own_length[end->part] = end->from * f->length;
    own->length = f->length * v3_length(along);
    own->x = f->x;
    bind->own_length[bone] = own->length;
    own->z = v3_unit(along);
    own->y = v3_cross(own->z, own->x);
    bind->radius[bone] = bind->radius[end->part];
}

enum status bind_pose_make(struct bind_pose *out, const struct take *take)
{
    *out = (struct bind_pose){0};
    int64_t frames = take_frame_count(take);
    double *scratch = malloc(sizeof *scratch * (size_t)(frames > 0 ? frames : 1));
    if (!scratch)
        return fail(ERR_MEMORY, "no memory for the bind pose");
    set_bind_joints(&out->skeleton, take, scratch);
    free(scratch);
    const struct body *body = take_body(take);
    for (int p = 0; p < PART_COUNT; p++) {
        out->known[p] = part_is_known(body, &out->skeleton, (enum part)p) &&
                        bone_frame_body_aligned(&out->skeleton, (enum part)p, &out->frame[p]);
        out->own_length[p] = out->frame[p].length;
        if (out->known[p])
            out->radius[p] = body->radius_rate[p] * out->frame[p].length;
    }
    for (int b = PART_COUNT; b < BONE_COUNT; b++)
        set_end_bone(out, b);
    return out->known[PART_UPPER_TORSO] ? OK : NOTHING;
}

// ---------------------------------------------------------------- bone transforms

static struct pose bone_frame_pose(const struct bone_frame *frame)
{
    // About the bone's middle: where lengths differ, the error is split between both ends.
    return (struct pose){bone_frame_rotation(frame), bone_frame_midpoint(frame)};
}

enum status bone_transforms_of(const struct bind_pose *bind, const struct skeleton *skeleton,
                               struct bone_transforms *out)
{
    bool placed[BONE_COUNT] = {false};
    for (int p = 0; p < BONE_COUNT; p++) {
        struct bone_frame f;
        out->bone[p] = POSE_IDENTITY;
        placed[p] = p < PART_COUNT && bind->known[p] && bone_frame_body_aligned(skeleton, (enum part)p, &f);
        if (placed[p])
            out->bone[p] = pose_multiply(bone_frame_pose(&f), pose_inverse(bone_frame_pose(&bind->frame[p])));
    }
    if (!placed[PART_UPPER_TORSO])
        return NOTHING;
    for (int i = 0; i < BONE_LINKS; i++) // from the trunk outwards
        if (!placed[bone_links[i].b])
            out->bone[bone_links[i].b] = out->bone[bone_links[i].a];
    return OK;
}

struct skeleton bone_transforms_skeleton(const struct bind_pose *bind, const struct bone_transforms *transforms)
{
    struct skeleton s = bind->skeleton;
    int count[JOINT_COUNT] = {0};
    struct vec3 sum[JOINT_COUNT] = {{0, 0, 0}};
    for (int p = 0; p < PART_COUNT; p++) {
        if (!bind->known[p])
            continue;
        const enum joint ends[] = {part_ends[p].from, part_ends[p].to};
        for (int e = 0; e < 2; e++) {
            sum[ends[e]] = v3_add(sum[ends[e]], pose_apply(transforms->bone[p], bind->skeleton.joint[ends[e]]));
            count[ends[e]]++;
        }
    }
    for (int j = 0; j < JOINT_COUNT; j++) {
        s.confidence[j] = count[j] ? 1 : 0;
        s.joint[j] = count[j] ? v3_scale(sum[j], 1.0 / count[j]) : v3(0, 0, 0);
    }
    return s;
}

// ---------------------------------------------------------------- skin weights

static double capsule_distance(const struct bind_pose *bind, int p, struct vec3 at)
{
    struct vec3 in = v3_sub(at, bind->frame[p].origin);
    const double along = v3_dot(in, bind->frame[p].z), max = bind->own_length[p];
    const double t = clamp_double(along, 0, max);
    return v3_length(v3_sub(in, v3_scale(bind->frame[p].z, t))) - bind->radius[p];
}

double bind_pose_distance(const struct bind_pose *bind, struct vec3 point)
{
    double best = INFINITY;
    for (int p = 0; p < PART_COUNT; p++)
        if (bind->known[p])
            best = fmin(best, capsule_distance(bind, p, point));
    return best;
}

int bind_pose_bone_at(const struct bind_pose *bind, enum part part, struct vec3 point,
                      const struct pose bind_from[BONE_COUNT])
{
    for (int b = PART_COUNT; b < BONE_COUNT; b++)
        if (bone_part(b) == part && bind->known[b] &&
            capsule_distance(bind, b, pose_apply(bind_from[b], point)) <
                capsule_distance(bind, (int)part, pose_apply(bind_from[part], point)))
            return b;
    return (int)part;
}

struct skin_weights bind_pose_skin_weights(const struct bind_pose *bind, struct vec3 point)
{
    double gaps[BONE_COUNT];
    int nearest = -1;
    for (int p = 0; p < BONE_COUNT; p++) {
        gaps[p] = bind->known[p] ? capsule_distance(bind, p, point) : INFINITY;
        if (nearest < 0 || gaps[p] < gaps[nearest])
            nearest = p;
    }
    struct skin_weights s = {{(uint8_t)nearest, (uint8_t)nearest, (uint8_t)nearest}, {1, 0, 0}};
    double total = 1;
    for (int p = 0; p < BONE_COUNT; p++) {
        double share = 1 - (gaps[p] - gaps[nearest]) / BLEND_M;
        if (p == nearest || !(share > 0) || !bones_adjacent(p, nearest))
            continue;
        share = share * share * (3 - 2 * share);
        int slot = s.weight[1] < s.weight[2] ? 1 : 2;
        if (share <= (double)s.weight[slot])
            continue;
        total += share - (double)s.weight[slot];
        s.bone[slot] = (uint8_t)p;
        s.weight[slot] = (float)share;
    }
    for (int i = 0; i < SKIN_BONES; i++)
        s.weight[i] = (float)((double)s.weight[i] / total);
    return s;
}

void linear_blend_skin(const struct skin_weights *skin, const struct bone_transforms *transforms, struct vec3 point,
                       struct vec3 normal, struct vec3 *p, struct vec3 *n)
{
    *p = *n = v3(0, 0, 0);
    for (int i = 0; i < SKIN_BONES; i++) {
        if (!(skin->weight[i] > 0))
            continue;
        const struct pose *pose = &transforms->bone[skin->bone[i]];
        *p = v3_add(*p, v3_scale(pose_apply(*pose, point), (double)skin->weight[i]));
        *n = v3_add(*n, v3_scale(quat_rotate(pose->rotation, normal), (double)skin->weight[i]));
    }
    *n = v3_unit(*n);
}
