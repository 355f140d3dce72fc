#include "reenact/avatar/articulated_icp.h"

#include "base/linear_algebra.h"
#include "reenact/avatar/deformation.h"

#include <string.h>

enum { ITERATIONS = 8, UNKNOWNS = 6 * BONE_COUNT, POINTS = 4000 };

// Standard deviations of the residuals, and scales of the robust kernel (Geman-McClure). Tuned by hand on the takes of
// docs/notes/avatar.md.
static const double DEPTH_SIGMA_M = 0.01;  // of a depth sample
static const double OUTLIER_M = 0.025;     // scale of the kernel for depth
static const double PART_SAMPLES_MAX = 60; // independent samples of a part at most: their errors are correlated
static const double JOINT_SIGMA_M = 0.004; // between the two sides of a joint
static const double START_SIGMA_M = 0.03, START_SIGMA_RAD = 0.12;       // of a bone's change from the start
static const double AXIAL_SIGMA_RAD = 0.02;                             // of axial rotations from colours
static const double SILHOUETTE_SIGMA_PX = 1, SILHOUETTE_OUTLIER_PX = 4; // of a silhouette point
static const double PART_SILHOUETTE_MAX = 20;                           // independent ones of a bone at most
static const double SILHOUETTE_FACING = 0.5; // cosine between the shape's normal and the silhouette's at a contact
static const double CERTAIN_FRAMES = 1;      // a surface seen in as many frames has half of its full weight
static const double MIN_FACING = 0.1;        // cosine: surfaces that a depth sample can show face the sensor

bool rotation_from_colors(int bone)
{
    switch (bone) {
    case PART_LEFT_THIGH:
    case PART_RIGHT_THIGH:
    case PART_LEFT_SHIN:
    case PART_RIGHT_SHIN:
    case BONE_SKULL: return true;
    default: return false; // a trunk is flat; arms came out no better for it (docs/notes/avatar.md)
    }
}

struct bone_corrections bone_corrections_identity(void)
{
    struct bone_corrections a;
    for (int p = 0; p < BONE_COUNT; p++)
        a.bone[p] = POSE_IDENTITY;
    return a;
}

struct bone_transforms bone_corrections_apply(const struct bone_transforms *transforms,
                                              const struct bone_corrections *corrections)
{
    struct bone_transforms out;
    for (int p = 0; p < BONE_COUNT; p++)
        out.bone[p] = pose_multiply(transforms->bone[p], corrections->bone[p]);
    return out;
}

static struct pose pose_mix(struct pose a, struct pose b, double t)
{
    return (struct pose){quat_slerp(a.rotation, b.rotation, t), v3_mix(a.translation, b.translation, t)};
}

struct bone_corrections bone_corrections_mix(const struct bone_corrections *a, const struct bone_corrections *b,
                                             double t)
{
    struct bone_corrections out;
    for (int p = 0; p < BONE_COUNT; p++)
        out.bone[p] = pose_mix(a->bone[p], b->bone[p], t);
    return out;
}

// ---------------------------------------------------------------- normal equations

struct icp_system {
    double a[UNKNOWNS][UNKNOWNS], b[UNKNOWNS]; // a x = b
};

// One equation, J x = value, over the unknowns of one or two bones.
static void add_row(struct icp_system *system, const int *at, const double *j, int count, double value, double weight)
{
    for (int r = 0; r < count; r++) {
        for (int c = 0; c < count; c++)
            system->a[at[r]][at[c]] += weight * j[r] * j[c];
        system->b[at[r]] += weight * j[r] * value;
    }
}

// In place: b becomes x. Positive definite, because every unknown has a prior.
static void solve_system(struct icp_system *system)
{
    cholesky_factor_clamped(&system->a[0][0], UNKNOWNS, 1e-12);
    cholesky_solve(&system->a[0][0], UNKNOWNS, system->b);
}

// The variance of unknown u, after solve().
static double unknown_variance(const struct icp_system *system, int u)
{
    double scratch[UNKNOWNS];
    return cholesky_variance(&system->a[0][0], UNKNOWNS, u, scratch);
}

// ---------------------------------------------------------------- one iteration

struct icp_state {
    const struct tsdf *tsdf;
    const struct bind_pose *bind_pose;
    const struct depth_frame *depth_frame;
    const struct icp_input *from;
    struct bone_transforms start, now;
    struct vec3 middle[BONE_COUNT]; // of each bone: the centre of its rotation; camera axes
    int stride;                     // between the pixels that are used
    struct silhouette_point silhouette[SILHOUETTE_POINTS_MAX];
    int silhouette_count;
};

// The derivative of a point of bone p along a direction. Motion in camera axes: x -> x + w cross (x - middle) + t;
// unknowns t, w.
static void bone_row(const struct icp_state *state, int p, struct vec3 at, struct vec3 along, int *index, double *j)
{
    struct vec3 moment = v3_cross(v3_sub(at, state->middle[p]), along);
    const double values[6] = {along.x, along.y, along.z, moment.x, moment.y, moment.z};
    for (int i = 0; i < 6; i++) {
        index[i] = 6 * p + i;
        j[i] = values[i];
    }
}

static int count_samples(const struct icp_state *state, int count[PART_COUNT])
{
    int total = 0;
    memset(count, 0, sizeof(int) * PART_COUNT);
    for (int y = state->depth_frame->top; y <= state->depth_frame->bottom; y += state->stride)
        for (int x = state->depth_frame->left; x <= state->depth_frame->right; x += state->stride) {
            int p = state->depth_frame->part[y * state->depth_frame->width + x];
            if (p < PART_COUNT) {
                count[p]++;
                total++;
            }
        }
    return total;
}

static void add_depth_samples(const struct icp_state *state, struct icp_system *system)
{
    struct pose bind_from_camera[BONE_COUNT];
    int count[PART_COUNT];
    count_samples(state, count);
    for (int p = 0; p < BONE_COUNT; p++)
        bind_from_camera[p] = pose_inverse(state->now.bone[p]);
    for (int y = state->depth_frame->top; y <= state->depth_frame->bottom; y += state->stride)
        for (int x = state->depth_frame->left; x <= state->depth_frame->right; x += state->stride) {
            int i = y * state->depth_frame->width + x, part = state->depth_frame->part[i];
            if (part >= PART_COUNT || !state->bind_pose->known[part])
                continue;
            struct vec3 at = source_rays_point(state->depth_frame->rays, i, state->depth_frame->depth[i]), gradient;
            int p = bind_pose_bone_at(state->bind_pose, (enum part)part, at, bind_from_camera);
            double distance, seen;
            if (!tsdf_sample(state->tsdf, pose_apply(bind_from_camera[p], at), &distance, &gradient, &seen) ||
                v3_length(gradient) < 0.3)
                continue;
            struct vec3 normal = quat_rotate(state->now.bone[p].rotation, v3_unit(gradient));
            if (-v3_dot(normal, v3_unit(at)) < MIN_FACING)
                continue; // or the back of a limb that is too near would be fitted to it
            double robust = OUTLIER_M * OUTLIER_M / (OUTLIER_M * OUTLIER_M + distance * distance);
            double share = fmin(1, PART_SAMPLES_MAX / count[part]) * seen / (seen + CERTAIN_FRAMES);
            int index[6];
            double j[6];
            bone_row(state, p, at, normal, index, j);
            add_row(system, index, j, 6, distance, robust * robust * share / (DEPTH_SIGMA_M * DEPTH_SIGMA_M));
        }
}

// Head and trunk have many depth samples, which determine their axial rotation better than the silhouette: a shape a
// little too wide would rotate to appear as narrow as it is seen.
static bool axial_from_silhouette(int bone)
{
    return bone != BONE_SKULL && bone != PART_HEAD && bone != PART_UPPER_TORSO && bone != PART_LOWER_TORSO;
}

// Projects the axial rotation out of a bone's row.
static void remove_axial(const struct icp_state *state, int p, double j[6])
{
    const struct vec3 axis = quat_rotate(state->now.bone[p].rotation, state->bind_pose->frame[p].z);
    const double about = j[3] * axis.x + j[4] * axis.y + j[5] * axis.z;
    j[3] -= about * axis.x, j[4] -= about * axis.y, j[5] -= about * axis.z;
}

// Viewing rays along the silhouette touch the shape. Depth alone hardly determines a limb's lateral position: it is
// quantised, and thin round limbs have few samples.
static void add_silhouette(const struct icp_state *state, struct icp_system *system)
{
    const struct calibration *calibration = tsdf_calibration(state->tsdf);
    struct pose bind_from_camera[BONE_COUNT];
    uint8_t bone[SILHOUETTE_POINTS_MAX];
    int count[BONE_COUNT] = {0};
    for (int p = 0; p < BONE_COUNT; p++)
        bind_from_camera[p] = pose_inverse(state->now.bone[p]);
    for (int i = 0; i < state->silhouette_count; i++) {
        bone[i] = (uint8_t)silhouette_point_bone(state->bind_pose, state->depth_frame, &state->silhouette[i],
                                                 bind_from_camera);
        count[bone[i]]++;
    }
    for (int i = 0; i < state->silhouette_count; i++) {
        const int p = bone[i];
        struct silhouette_contact contact;
        if (!state->bind_pose->known[p] ||
            !silhouette_find_contact(state->tsdf, calibration, state->depth_frame, &state->silhouette[i],
                                     bind_from_camera[p], &contact))
            continue;
        const struct vec3 normal = quat_rotate(state->now.bone[p].rotation, contact.normal);
        if (-v3_dot(normal, contact.inward) < SILHOUETTE_FACING)
            continue;
        const double pixel_m = state->depth_frame->depth[state->silhouette[i].inside] * 1e-3 / calibration->depth.fx;
        const double outlier = SILHOUETTE_OUTLIER_PX * pixel_m, good = SILHOUETTE_SIGMA_PX * pixel_m;
        const double robust = outlier * outlier / (outlier * outlier + contact.gap * contact.gap);
        int index[6];
        double j[6];
        bone_row(state, p, contact.at, normal, index, j);
        if (!axial_from_silhouette(p))
            remove_axial(state, p, j);
        add_row(system, index, j, 6, contact.gap,
                robust * robust * fmin(1, PART_SILHOUETTE_MAX / count[p]) / (good * good));
    }
}

static void add_links(const struct icp_state *state, struct icp_system *system)
{
    for (int l = 0; l < BONE_LINKS; l++) {
        const struct bone_link *link = &bone_links[l];
        if (!state->bind_pose->known[link->a] || !state->bind_pose->known[link->b])
            continue;
        struct vec3 joint = state->bind_pose->skeleton.joint[link->joint];
        struct vec3 a = pose_apply(state->now.bone[link->a], joint), b = pose_apply(state->now.bone[link->b], joint);
        // Half of the distance that the joints have: the skeleton's bones differ in length from frame to frame.
        struct vec3 apart = v3_sub(pose_apply(state->from->joints.bone[link->b], joint),
                                   pose_apply(state->from->joints.bone[link->a], joint));
        struct vec3 gap = v3_sub(v3_sub(b, a), v3_scale(apart, 0.5));
        const struct vec3 axes[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
        const double gaps[3] = {gap.x, gap.y, gap.z};
        for (int axis = 0; axis < 3; axis++) {
            int index[12];
            double j[12];
            bone_row(state, link->a, a, axes[axis], index, j);
            bone_row(state, link->b, b, v3_scale(axes[axis], -1), index + 6, j + 6);
            add_row(system, index, j, 12, gaps[axis], 1 / (JOINT_SIGMA_M * JOINT_SIGMA_M));
        }
    }
}

// A prior that bone p is at `to`, within m metres and rad radians.
static void add_prior(const struct icp_state *state, struct icp_system *system, int p, const struct pose *to, double m,
                      double rad)
{
    struct pose back = pose_multiply(*to, pose_inverse(state->now.bone[p])); // in camera axes
    struct vec3 move = v3_sub(pose_apply(back, state->middle[p]), state->middle[p]);
    struct vec3 rotation = quat_to_rotation_vector(back.rotation);
    const double want[6] = {move.x, move.y, move.z, rotation.x, rotation.y, rotation.z};
    for (int i = 0; i < 6; i++) {
        int index = 6 * p + i;
        double one = 1, weight = i < 3 ? 1 / (m * m) : 1 / (rad * rad);
        add_row(system, &index, &one, 1, want[i], weight);
    }
}

// A prior that bone p keeps the start's axial rotation.
static void add_axial_prior(const struct icp_state *state, struct icp_system *system, int p)
{
    struct vec3 axis = quat_rotate(state->now.bone[p].rotation, state->bind_pose->frame[p].z);
    struct vec3 rotation = quat_to_rotation_vector(
        quat_multiply(state->start.bone[p].rotation, quat_conjugate(state->now.bone[p].rotation)));
    const int index[3] = {6 * p + 3, 6 * p + 4, 6 * p + 5};
    const double j[3] = {axis.x, axis.y, axis.z};
    add_row(system, index, j, 3, v3_dot(axis, rotation), 1 / (AXIAL_SIGMA_RAD * AXIAL_SIGMA_RAD));
}

static void iterate_pose(struct icp_state *state, struct icp_system *system)
{
    memset(system, 0, sizeof *system);
    for (int p = 0; p < BONE_COUNT; p++) {
        state->middle[p] = pose_apply(state->now.bone[p], bone_frame_midpoint(&state->bind_pose->frame[p]));
        add_prior(state, system, p, &state->from->joints.bone[p], state->from->joint_errors.m[p],
                  state->from->joint_errors.rad[p]);
        add_prior(state, system, p, &state->start.bone[p], START_SIGMA_M, START_SIGMA_RAD);
        if (state->from->axial_fixed && rotation_from_colors(p))
            add_axial_prior(state, system, p);
    }
    add_depth_samples(state, system);
    add_silhouette(state, system);
    add_links(state, system);
    solve_system(system);
    for (int p = 0; p < BONE_COUNT; p++) {
        const double *x = system->b + 6 * p;
        struct quat rotation = quat_from_rotation_vector(v3(x[3], x[4], x[5]));
        struct pose *now = &state->now.bone[p];
        struct vec3 moved = v3_add(state->middle[p], v3(x[0], x[1], x[2]));
        now->translation = v3_add(quat_rotate(rotation, v3_sub(now->translation, state->middle[p])), moved);
        now->rotation = quat_unit(quat_multiply(rotation, now->rotation));
    }
}

static void find_uncertainty(const struct icp_system *system, struct joint_noise *uncertainty)
{
    for (int p = 0; p < BONE_COUNT; p++) {
        double m2 = 0, rad2 = 0;
        for (int i = 0; i < 3; i++) {
            m2 += unknown_variance(system, 6 * p + i) / 3;
            rad2 += unknown_variance(system, 6 * p + 3 + i) / 3;
        }
        uncertainty->m[p] = sqrt(m2);
        uncertainty->rad[p] = sqrt(rad2);
    }
}

struct bone_corrections articulated_icp(const struct tsdf *tsdf, struct depth_frame *depth_frame,
                                        const struct icp_input *from, struct joint_noise *uncertainty)
{
    struct icp_system system;
    struct icp_state s = {.tsdf = tsdf, .bind_pose = tsdf_bind_pose(tsdf), .depth_frame = depth_frame, .from = from};
    s.start = s.now = bone_corrections_apply(&from->joints, &from->start);
    s.stride = 1;
    int count[PART_COUNT];
    while (count_samples(&s, count) > POINTS)
        s.stride++;
    const int iterations = from->axial_fixed ? ITERATIONS / 2 : ITERATIONS;
    for (int iteration = 0; iteration < iterations; iteration++) {
        if (iteration == 0 || iteration == iterations / 2) {
            struct skeleton refined = bone_transforms_skeleton(s.bind_pose, &s.now);
            depth_frame_relabel(depth_frame, &refined);
            if (iteration > 0) // only now: before, bones may be nearer to another bone's silhouette than to their own
                s.silhouette_count = silhouette_find_points(depth_frame, s.silhouette);
        }
        iterate_pose(&s, &system);
    }
    if (uncertainty)
        find_uncertainty(&system, uncertainty);
    struct bone_corrections out;
    for (int p = 0; p < BONE_COUNT; p++)
        out.bone[p] = pose_multiply(pose_inverse(from->joints.bone[p]), s.now.bone[p]);
    return out;
}
