// Estimates joint noise from registrations.
#include "reenact/skeleton/joint_noise.h"

// Chosen by hand.
static const double PRIOR_M = 0.06, PRIOR_RAD = 0.5;
static const double PRIOR_END_RAD = 1.2; // joints do not determine the rotation of skull, hands and feet
static const double MIN_M = 0.003, MIN_RAD = 0.03;

struct joint_noise joint_noise_prior(void)
{
    struct joint_noise e;
    for (int b = 0; b < BONE_COUNT; b++) {
        e.m[b] = PRIOR_M;
        e.rad[b] = b < PART_COUNT ? PRIOR_RAD : PRIOR_END_RAD;
    }
    return e;
}

void joint_noise_add(struct joint_noise_sum *sum, const struct bind_pose *bind,
                     const struct pose correction[BONE_COUNT], const struct joint_noise *uncertainty)
{
    for (int b = 0; b < BONE_COUNT; b++) {
        const struct vec3 middle = bone_frame_midpoint(&bind->frame[b]);
        const struct vec3 moved = v3_sub(pose_apply(correction[b], middle), middle);
        const struct vec3 rotated = quat_to_rotation_vector(correction[b].rotation);
        sum->m2[b] += v3_dot(moved, moved) / 3 + uncertainty->m[b] * uncertainty->m[b];
        sum->rad2[b] += v3_dot(rotated, rotated) / 3 + uncertainty->rad[b] * uncertainty->rad[b];
    }
    sum->frames++;
}

struct joint_noise joint_noise_estimate(const struct joint_noise_sum *sum)
{
    struct joint_noise e = joint_noise_prior();
    for (int b = 0; b < BONE_COUNT && sum->frames > 0; b++) {
        e.m[b] = fmax(MIN_M, fmin(e.m[b], sqrt(sum->m2[b] / sum->frames)));
        e.rad[b] = fmax(MIN_RAD, fmin(e.rad[b], sqrt(sum->rad2[b] / sum->frames)));
    }
    return e;
}
