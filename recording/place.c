#include "recording/place.h"

#include "base/portable_math.h"
#include "platform/files/jpeg.h"

#include <stdlib.h>

// ---------------------------------------------------------------- pose score

// lambda of equation 3. Each of the two arm terms is at most theta * sin(theta), so together they reach 3.64. lambda is
// larger, so that a frame with crossed legs, in which neither thigh nor shin can be measured, never has a higher score
// than one without.
static const double LAMBDA = 4;

static bool is_joint_known(const struct skeleton *skeleton, enum joint joint)
{
    return skeleton->confidence[joint] > 0;
}

// theta_n * a_n of equation 3 for one arm: the angle between torso and arm, times
// how parallel to the image plane the arm is.
static double arm_term(const struct skeleton *skeleton, enum joint shoulder, enum joint hand)
{
    if (!is_joint_known(skeleton, shoulder) || !is_joint_known(skeleton, hand) ||
        !is_joint_known(skeleton, JOINT_NECK) || !is_joint_known(skeleton, JOINT_TORSO))
        return 0;
    struct vec3 arm = v3_unit(v3_sub(skeleton->joint[hand], skeleton->joint[shoulder]));
    struct vec3 torso = v3_unit(v3_sub(skeleton->joint[JOINT_TORSO], skeleton->joint[JOINT_NECK]));
    double theta = portable_acos(fmax(-1, fmin(1, v3_dot(arm, torso))));
    return theta * fabs(arm.x);
}

// g of equation 2: 1 when the legs are not crossed. For a person seen from behind,
// left and right have changed sides in the image.
static double legs_uncrossed(const struct skeleton *skeleton)
{
    const enum joint need[] = {JOINT_LEFT_HIP, JOINT_LEFT_FOOT, JOINT_RIGHT_HIP, JOINT_RIGHT_FOOT};
    for (size_t i = 0; i < COUNT_OF(need); i++)
        if (!is_joint_known(skeleton, need[i]))
            return 0;
    struct vec3 left = v3_unit(v3_sub(skeleton->joint[JOINT_LEFT_FOOT], skeleton->joint[JOINT_LEFT_HIP]));
    struct vec3 right = v3_unit(v3_sub(skeleton->joint[JOINT_RIGHT_FOOT], skeleton->joint[JOINT_RIGHT_HIP]));
    bool faces_camera = skeleton->joint[JOINT_LEFT_HIP].x >= skeleton->joint[JOINT_RIGHT_HIP].x;
    // phi is the angle to the x axis, so phi_R > phi_L means that the left leg leans more to +x.
    return faces_camera ? left.x > right.x : right.x > left.x;
}

double pose_score(const struct skeleton *skeleton)
{
    return arm_term(skeleton, JOINT_LEFT_SHOULDER, JOINT_LEFT_HAND) +
           arm_term(skeleton, JOINT_RIGHT_SHOULDER, JOINT_RIGHT_HAND) + LAMBDA * legs_uncrossed(skeleton);
}

// ---------------------------------------------------------------- place

void place_tag_corners(const struct place_tag *tag, struct vec3 world[4])
{
    double h = tag->side_m / 2;
    const struct vec3 own[4] = {{-h, -h, 0}, {h, -h, 0}, {h, h, 0}, {-h, h, 0}};
    for (int i = 0; i < 4; i++)
        world[i] = pose_apply(tag->world_from_tag, own[i]);
}

static void free_view(struct place_view *view)
{
    free(view->jpeg);
    free(view->depth);
}

enum status place_drop_undecodable_views(struct place *place, int32_t *lost)
{
    const struct lens *lens = &place->calibration.color;
    uint8_t *rgb = malloc((size_t)lens->width * (size_t)lens->height * 3 + 1); // + 1: malloc(0) may be NULL
    enum status status = rgb ? OK : fail(ERR_MEMORY, "no memory for an image");
    int32_t kept = 0, i = 0;
    for (; i < place->view_count && status == OK; i++) {
        struct place_view *view = &place->views[i];
        if (view->jpeg)
            status = jpeg_decode(view->jpeg, view->jpeg_bytes, rgb, lens->width, lens->height);
        if (status == OK)
            place->views[kept++] = *view;
        else if (status == ERR_CORRUPT)
            free_view(view), status = OK;
        else
            break;
    }
    *lost = i - kept;
    while (i < place->view_count) // of which an error left unknown whether they can be decoded
        place->views[kept++] = place->views[i++];
    place->view_count = kept;
    free(rgb);
    return status;
}

void place_free(struct place *place)
{
    for (int32_t i = 0; i < place->view_count; i++)
        free_view(&place->views[i]);
    free(place->views);
    free(place->points);
    free(place->tags);
    *place = (struct place){0};
}
