#include "capture/tracking/limb_pose.h"

#include "capture/body/two_bone_ik.h"

double limb_moved_m(int k, const struct body_build *from, const struct body_build *to)
{
    const struct body_limb *l = &body_limbs[k];
    return fmax(v3_distance(from->origin[l->lower], to->origin[l->lower]),
                v3_distance(from->origin[l->end], to->origin[l->end]));
}

void limb_copy(int k, const struct body_pose *from, struct body_pose *to)
{
    for (int s = (int)body_limbs[k].upper; s <= (int)body_limbs[k].end; s++)
        to->rotation[s] = from->rotation[s];
}

// Rotates segment s about its own origin to the axes that it has in `from`.
static void match_orientation(const struct body_shape *shape, enum segment segment, const struct body_build *from,
                              struct body_pose *to)
{
    struct body_build build;
    double wanted[3][3];
    body_forward_kinematics(shape, to, &build);
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++) {
            wanted[r][c] = 0;
            for (int i = 0; i < 3; i++)
                wanted[r][c] += build.parent_axes[segment][i][r] * from->axes[segment][i][c];
        }
    to->rotation[segment] = quat_from_matrix(wanted);
}

void limb_transfer(int k, const struct body_shape *shape, const struct body_build *from, struct body_pose *to)
{
    const enum segment chain[3] = {body_limbs[k].upper, body_limbs[k].lower, body_limbs[k].end};
    for (int i = 0; i < 3; i++) {
        match_orientation(shape, chain[i], from, to);
        if (i == 2)
            break;
        struct body_build build;
        body_forward_kinematics(shape, to, &build);
        body_aim_segment(shape, to, chain[i], v3_sub(from->origin[chain[i + 1]], build.origin[chain[i]]));
    }
}
