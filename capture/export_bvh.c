// BVH, the motion format of animation programs: a hierarchy of bones with fixed
// offsets and, for each frame, the root's position and every joint's rotation.
#include "capture/export.h"
#include "base/portable_math.h"

#include "capture/median.h"
#include "platform/file.h"

#include <stdio.h>
#include <stdlib.h>

// BVH has y up and is usually in centimetres.
static const double CM = 100;
static const double DEG = 57.29577951308232;

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

// The median length of every bone over the take, metres; 0 where it was not known in any frame.
static enum status bone_lengths(const struct take *take, double length[BONES])
{
    int64_t frames = take_frame_count(take);
    double *seen = malloc(sizeof *seen * (size_t)(frames ? frames : 1));
    if (!seen)
        return fail(ERR_MEMORY, "no memory to export the motion");
    for (int b = 0; b < BONES; b++) {
        int64_t count = 0;
        for (int64_t i = 0; i < frames && bones[b].parent != NO_PARENT; i++) {
            const struct take_entry *e = take_entry(take, i);
            if (e->has_skeleton && usable(&e->skeleton, b) && usable(&e->skeleton, bones[b].parent))
                seen[count++] =
                    v3_distance(e->skeleton.joint[bones[b].joint], e->skeleton.joint[bones[bones[b].parent].joint]);
        }
        length[b] = median_of(seen, (size_t)count);
    }
    free(seen);
    return OK;
}

static void print_hierarchy(FILE *out, const double length[BONES], int bone, int depth)
{
    struct vec3 offset = v3_scale(v3_unit(bind_direction[bone]), CM * length[bone]);
    bool root = bones[bone].parent == NO_PARENT, leaf = true;
    fprintf(out, "%*s%s %s\n%*s{\n", 2 * depth, "", root ? "ROOT" : "JOINT", joint_name(bones[bone].joint), 2 * depth,
            "");
    fprintf(out, "%*sOFFSET %.4f %.4f %.4f\n", 2 * depth + 2, "", offset.x, offset.y, offset.z);
    fprintf(out, "%*sCHANNELS %s Zrotation Xrotation Yrotation\n", 2 * depth + 2, "",
            root ? "6 Xposition Yposition Zposition" : "3");
    for (int child = bone + 1; child < BONES; child++)
        if (bones[child].parent == bone) {
            print_hierarchy(out, length, child, depth + 1);
            leaf = false;
        }
    if (leaf)
        fprintf(out, "%*sEnd Site\n%*s{\n%*sOFFSET 0 0 0\n%*s}\n", 2 * depth + 2, "", 2 * depth + 2, "", 2 * depth + 4,
                "", 2 * depth + 2, "");
    fprintf(out, "%*s}\n", 2 * depth, "");
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

static void print_motion(FILE *out, const struct take *take)
{
    int64_t frames = 0, first = -1, last = -1;
    for (int64_t i = 0; i < take_frame_count(take); i++)
        if (take_entry(take, i)->has_skeleton) {
            first = first < 0 ? i : first;
            last = i;
            frames++;
        }
    double seconds =
        frames > 1 ? (double)(take_entry(take, last)->time_ns - take_entry(take, first)->time_ns) / 1e9 : 0;
    fprintf(out, "MOTION\nFrames: %lld\nFrame Time: %.6f\n", (long long)frames,
            frames > 1 ? seconds / (double)(frames - 1) : 1.0 / 30);
    struct quat root = {0, 0, 0, 1};
    for (int64_t i = 0; i < take_frame_count(take); i++) {
        const struct take_entry *entry = take_entry(take, i);
        if (!entry->has_skeleton)
            continue;
        struct skeleton s = y_up_skeleton(entry);
        struct quat rotation[BONES];
        world_rotations(&s, root, rotation);
        root = rotation[0];
        struct vec3 at = s.confidence[JOINT_WAIST] > 0 ? v3_scale(s.joint[JOINT_WAIST], CM) : v3(0, 0, 0);
        fprintf(out, "%.4f %.4f %.4f", at.x, at.y, at.z);
        // depth first, the order in which print_hierarchy prints the joints, which is the table's order
        for (int b = 0; b < BONES; b++)
            print_rotation(out, bones[b].parent == NO_PARENT
                                    ? rotation[b]
                                    : quat_multiply(quat_conjugate(rotation[bones[b].parent]), rotation[b]));
        fputc('\n', out);
    }
}

enum status export_bvh(const struct take *take, const char *path)
{
    double length[BONES];
    enum status status = bone_lengths(take, length);
    if (status != OK)
        return status;
    char *text = NULL;
    size_t size = 0;
    FILE *out = open_memstream(&text, &size);
    if (!out)
        return fail(ERR_MEMORY, "no memory to export the motion");
    fputs("HIERARCHY\n", out);
    print_hierarchy(out, length, 0, 0);
    print_motion(out, take);
    bool written = !ferror(out);
    written = fclose(out) == 0 && written;
    status = written ? file_write(path, text, size) : fail(ERR_MEMORY, "no memory to export the motion");
    free(text);
    return status;
}
