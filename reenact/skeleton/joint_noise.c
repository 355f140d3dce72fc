#include "reenact/skeleton/joint_noise.h"

static const double FIRST_M = 0.06, FIRST_RAD = 0.5;
static const double FIRST_END_RAD = 1.2; // joints do not tell how skull, hands and feet are turned
static const double LEAST_M = 0.003, LEAST_RAD = 0.03;

struct bone_errors joint_errors_at_first(void)
{
    struct bone_errors e;
    for (int b = 0; b < BONE_COUNT; b++) {
        e.m[b] = FIRST_M;
        e.rad[b] = b < PART_COUNT ? FIRST_RAD : FIRST_END_RAD;
    }
    return e;
}

void joint_errors_add(struct bone_errors_sum *sum, const struct rest *rest, const struct pose adjusted[BONE_COUNT],
                      const struct bone_errors *unsure)
{
    for (int b = 0; b < BONE_COUNT; b++) {
        const struct vec3 middle = part_frame_middle(&rest->frame[b]);
        const struct vec3 moved = v3_sub(pose_apply(adjusted[b], middle), middle);
        const struct vec3 turned = quat_to_rotation_vector(adjusted[b].rotation);
        sum->m2[b] += v3_dot(moved, moved) / 3 + unsure->m[b] * unsure->m[b];
        sum->rad2[b] += v3_dot(turned, turned) / 3 + unsure->rad[b] * unsure->rad[b];
    }
    sum->frames++;
}

struct bone_errors joint_errors_of(const struct bone_errors_sum *sum)
{
    struct bone_errors e = joint_errors_at_first();
    for (int b = 0; b < BONE_COUNT && sum->frames > 0; b++) {
        e.m[b] = fmax(LEAST_M, fmin(e.m[b], sqrt(sum->m2[b] / sum->frames)));
        e.rad[b] = fmax(LEAST_RAD, fmin(e.rad[b], sqrt(sum->rad2[b] / sum->frames)));
    }
    return e;
}
