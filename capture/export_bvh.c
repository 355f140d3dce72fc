// BVH, the motion format of animation programs: a hierarchy of bones with offsets and, for each frame, the root's
// position, every joint's rotation and, of joints that move in their parent's axes, their position.
#include "capture/export.h"

#include "base/portable_math.h"
#include "capture/median.h"

#include <stdlib.h>

// BVH has y up and is usually in centimetres.
static const double CM = 100;
static const double DEG = 57.29577951308232;
// A joint that leaves its place in its parent's axes by more than this at any time has position channels.
static const double RIGID_M = 2e-4;

enum { NO_PARENT = -1 };

// The body as a tree, parents before children.
static const struct bvh_bone {
    enum joint joint;
    int parent; // index into this table; NO_PARENT for the root
} bones[] = {
    {JOINT_WAIST, NO_PARENT}, {JOINT_TORSO, 0},      {JOINT_NECK, 1},        {JOINT_HEAD, 2},
    {JOINT_LEFT_SHOULDER, 2}, {JOINT_LEFT_ELBOW, 4}, {JOINT_LEFT_HAND, 5},   {JOINT_RIGHT_SHOULDER, 2},
    {JOINT_RIGHT_ELBOW, 7},   {JOINT_RIGHT_HAND, 8}, {JOINT_LEFT_HIP, 0},    {JOINT_LEFT_KNEE, 10},
    {JOINT_LEFT_FOOT, 11},    {JOINT_RIGHT_HIP, 0},  {JOINT_RIGHT_KNEE, 13}, {JOINT_RIGHT_FOOT, 14},
};
enum { BONES = COUNT_OF(bones) };

// The bind pose, y up, facing +z: the directions from parent to joint.
static const struct vec3 bind_direction[BONES] = {
    {0, 0, 0},  {0, 1, 0},  {0, 1, 0},      {0, 1, 0},  {1, 0, 0},  {1, 0, 0},       {1, 0, 0},  {-1, 0, 0},
    {-1, 0, 0}, {-1, 0, 0}, {0.6, -0.8, 0}, {0, -1, 0}, {0, -1, 0}, {-0.6, -0.8, 0}, {0, -1, 0}, {0, -1, 0},
};

// The skeleton with y up, in the world where the sensor was located, else in the camera's axes.
static struct skeleton y_up_skeleton(const struct take_entry *entry)
{
    static const struct pose y_up_from_z_up = {{-0.7071067811865476, 0, 0, 0.7071067811865476}, {0, 0, 0}};
    static const struct pose y_up_from_camera = {{1, 0, 0, 0}, {0, 0, 0}};
    struct pose from_camera =
        entry->located ? pose_multiply(y_up_from_z_up, entry->world_from_camera) : y_up_from_camera;
    return skeleton_transform(from_camera, &entry->skeleton);
}

static bool usable(const struct skeleton *s, int bone)
{
    return s->confidence[bones[bone].joint] > 0 && v3_finite(s->joint[bones[bone].joint]);
}

// The rotation of the whole body: x across the pelvis, y up the spine. `before` where it is not known.
static struct quat root_rotation(const struct skeleton *s, struct quat before)
{
    if (!(s->confidence[JOINT_LEFT_HIP] > 0 && s->confidence[JOINT_RIGHT_HIP] > 0 && s->confidence[JOINT_TORSO] > 0 &&
          s->confidence[JOINT_WAIST] > 0))
        return before;
    struct vec3 y = v3_unit(v3_sub(s->joint[JOINT_TORSO], s->joint[JOINT_WAIST]));
    struct vec3 across = v3_sub(s->joint[JOINT_LEFT_HIP], s->joint[JOINT_RIGHT_HIP]);
    struct vec3 z = v3_unit(v3_cross(across, y));
    if (v3_dot(y, y) == 0 || v3_dot(z, z) == 0)
        return before;
    struct vec3 x = v3_cross(y, z);
    double m[3][3] = {{x.x, y.x, z.x}, {x.y, y.y, z.y}, {x.z, y.z, z.z}};
    return quat_from_matrix(m);
}

// Every joint's rotation with respect to the world: its parent's, and the smallest rotation
// that points the bone at its first known child. A joint that is not known
// has its parent's rotation.
static void world_rotations(const struct skeleton *s, struct quat before_root, struct quat rotation[BONES])
{
    for (int b = 0; b < BONES; b++) {
        rotation[b] = bones[b].parent == NO_PARENT ? root_rotation(s, before_root) : rotation[bones[b].parent];
        // waist and neck have several children and rotate with the body
        if (bones[b].joint == JOINT_WAIST || bones[b].joint == JOINT_NECK)
            continue;
        for (int child = b + 1; child < BONES; child++)
            if (bones[child].parent == b && usable(s, b) && usable(s, child)) {
                struct vec3 is = v3_sub(s->joint[bones[child].joint], s->joint[bones[b].joint]);
                struct vec3 expected_direction = quat_rotate(rotation[b], bind_direction[child]);
                rotation[b] = quat_unit(quat_multiply(quat_between(expected_direction, is), rotation[b]));
                break;
            }
    }
}

// One exported frame.
struct motion_frame {
    int64_t time_ns;
    int64_t shown;               // for how many frames of the file, at least 1: it stays until the next one
    struct vec3 root;            // of the root, metres
    struct quat rotation[BONES]; // with respect to the world
    struct vec3 at[BONES];       // in the parent's axes, metres
    bool known[BONES];           // both ends of the bone are
};

struct motion {
    struct motion_frame *frames;
    int64_t count;
    int64_t shown; // frames of the file
    double frame_s;
    struct vec3 offset[BONES]; // the median of `at`, metres
    bool moves[BONES];         // has position channels
};

static enum status motion_open(struct motion *m, const struct take *take)
{
    int64_t frames = take_frame_count(take);
    struct quat root = {0, 0, 0, 1};
    const bool in_world = take_is_located(take); // the same axes all along the file
    *m = (struct motion){.frames = calloc((size_t)(frames ? frames : 1), sizeof *m->frames)};
    if (!m->frames)
        return fail(ERR_MEMORY, "no memory to export the motion");
    for (int64_t i = 0; i < frames; i++) {
        const struct take_entry *entry = take_entry(take, i);
        if (!entry->has_skeleton || (in_world && !entry->located))
            continue;
        struct motion_frame *f = &m->frames[m->count++];
        f->time_ns = entry->time_ns;
        const struct skeleton s = y_up_skeleton(entry);
        world_rotations(&s, root, f->rotation);
        root = f->rotation[0];
        f->root = usable(&s, 0) ? s.joint[JOINT_WAIST] : v3(0, 0, 0);
        for (int b = 1; b < BONES; b++) {
            const int parent = bones[b].parent;
            f->known[b] = usable(&s, b) && usable(&s, parent);
            const struct vec3 bone = v3_sub(s.joint[bones[b].joint], s.joint[bones[parent].joint]);
            if (f->known[b])
                f->at[b] = quat_rotate(quat_conjugate(f->rotation[parent]), bone);
        }
    }
    return m->count ? OK : fail(ERR_INPUT, "the take has no skeleton: no person was tracked in it");
}

// BVH has one step of time for all frames. So a frame before a gap, in which no person was tracked or frames were
// dropped, is shown for as many frames as the gap is long, and the step is the mean one then. A clock that jumps by
// more than a minute has no gap there.
static enum status find_times(struct motion *m)
{
    const double most_s = 60;
    double *steps = malloc(sizeof *steps * (size_t)m->count), seconds = 0;
    if (!steps)
        return fail(ERR_MEMORY, "no memory to export the motion");
    for (int64_t i = 0; i + 1 < m->count; i++)
        steps[i] = (double)(m->frames[i + 1].time_ns - m->frames[i].time_ns) * 1e-9;
    const double usual_s = median_of(steps, (size_t)m->count - 1);
    free(steps);
    m->frames[m->count - 1].shown = m->shown = 1;
    for (int64_t i = 0; i + 1 < m->count; i++) {
        struct motion_frame *f = &m->frames[i];
        const double step_s = (double)(f[1].time_ns - f->time_ns) * 1e-9;
        const bool jump = step_s > most_s;
        f->shown = jump ? 1 : (int64_t)fmax(1, floor(step_s / usual_s + 0.5));
        m->shown += f->shown;
        seconds += jump ? usual_s : step_s;
    }
    m->frame_s = m->count > 1 ? seconds / (double)(m->shown - 1) : 1.0 / 30;
    return OK;
}

// The median place of every joint in its parent's axes, and whether it leaves that.
static enum status find_offsets(struct motion *m)
{
    double *seen = malloc(sizeof *seen * (size_t)(m->count ? m->count : 1));
    if (!seen)
        return fail(ERR_MEMORY, "no memory to export the motion");
    for (int b = 1; b < BONES; b++) {
        double median[3];
        for (int axis = 0; axis < 3; axis++) {
            size_t count = 0;
            for (int64_t i = 0; i < m->count; i++)
                if (m->frames[i].known[b])
                    seen[count++] = (&m->frames[i].at[b].x)[axis];
            median[axis] = median_of(seen, count);
        }
        m->offset[b] = v3(median[0], median[1], median[2]);
        for (int64_t i = 0; i < m->count; i++)
            m->moves[b] |= m->frames[i].known[b] && v3_distance(m->frames[i].at[b], m->offset[b]) > RIGID_M;
    }
    free(seen);
    return OK;
}

// Where a bone without a child ends, in the joint's axes, metres: a hand's, foot's and head's usual length.
static struct vec3 end_site(enum joint joint)
{
    if (joint == JOINT_HEAD)
        return v3(0, 0.12, 0);
    if (joint == JOINT_LEFT_FOOT || joint == JOINT_RIGHT_FOOT)
        return v3(0, -0.06, 0.15);
    return v3(joint == JOINT_LEFT_HAND ? 0.1 : -0.1, 0, 0);
}

static void print_offset(FILE *out, int indent, struct vec3 metres)
{
    fprintf(out, "%*sOFFSET %.5f %.5f %.5f\n", indent, "", CM * metres.x, CM * metres.y, CM * metres.z);
}

static void print_hierarchy(FILE *out, const struct motion *m, int bone, int depth)
{
    const bool root = bones[bone].parent == NO_PARENT, six = root || m->moves[bone];
    const int indent = 2 * depth;
    bool leaf = true;
    fprintf(out, "%*s%s %s\n%*s{\n", indent, "", root ? "ROOT" : "JOINT", joint_name(bones[bone].joint), indent, "");
    print_offset(out, indent + 2, m->offset[bone]);
    fprintf(out, "%*sCHANNELS %s Zrotation Xrotation Yrotation\n", indent + 2, "",
            six ? "6 Xposition Yposition Zposition" : "3");
    for (int child = bone + 1; child < BONES; child++)
        if (bones[child].parent == bone) {
            print_hierarchy(out, m, child, depth + 1);
            leaf = false;
        }
    if (leaf) {
        fprintf(out, "%*sEnd Site\n%*s{\n", indent + 2, "", indent + 2, "");
        print_offset(out, indent + 4, end_site(bones[bone].joint));
        fprintf(out, "%*s}\n", indent + 2, "");
    }
    fprintf(out, "%*s}\n", indent, "");
}

// Euler angles, degrees, about z, then x, then y, the order of CHANNELS.
static void print_rotation(FILE *out, struct quat q)
{
    double m[3][3];
    quat_to_matrix(q, m);
    double x = portable_asin(fmax(-1, fmin(1, m[2][1])));
    bool locked = fabs(m[2][1]) > 1 - 1e-9;
    double z = locked ? portable_atan2(m[1][0], m[0][0]) : portable_atan2(-m[0][1], m[1][1]);
    double y = locked ? 0 : portable_atan2(-m[2][0], m[2][2]);
    fprintf(out, " %.4f %.4f %.4f", z * DEG, x * DEG, y * DEG);
}

// The channels' values, depth first: the order in which print_hierarchy prints the joints, which is the table's.
static void print_frame(FILE *out, const struct motion *m, const struct motion_frame *f)
{
    for (int b = 0; b < BONES; b++) {
        const int parent = bones[b].parent;
        struct vec3 at = f->known[b] ? f->at[b] : m->offset[b];
        if (parent == NO_PARENT)
            at = f->root;
        if (parent == NO_PARENT || m->moves[b])
            fprintf(out, "%s%.4f %.4f %.4f", b ? " " : "", CM * at.x, CM * at.y, CM * at.z);
        print_rotation(out, parent == NO_PARENT ? f->rotation[b]
                                                : quat_multiply(quat_conjugate(f->rotation[parent]), f->rotation[b]));
    }
    fputc('\n', out);
}

static void print_motion(FILE *out, const struct motion *m)
{
    fprintf(out, "MOTION\nFrames: %lld\nFrame Time: %.6f\n", (long long)m->shown, m->frame_s);
    for (int64_t i = 0; i < m->count; i++)
        for (int64_t k = 0; k < m->frames[i].shown; k++)
            print_frame(out, m, &m->frames[i]);
}

enum status export_bvh(const struct take *take, FILE *out)
{
    struct motion motion;
    enum status status = motion_open(&motion, take);
    if (status == OK)
        status = find_times(&motion);
    if (status == OK)
        status = find_offsets(&motion);
    if (status == OK) {
        fputs("HIERARCHY\n", out);
        print_hierarchy(out, &motion, 0, 0);
        print_motion(out, &motion);
    }
    free(motion.frames);
    return status;
}
