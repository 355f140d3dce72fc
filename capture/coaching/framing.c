#include "capture/coaching/framing.h"

// All chosen by hand. A Kinect measures from 0.8 m, and a person of 1.8 m fits its picture from 2 m on; beyond 4.5 m
// its depth is uncertain by 3 cm.
static const double NEAR_M = 1.0, FAR_M = 4.5;
static const double SOLE_M = 0.09, CROWN_M = 0.13; // below the ankle, above the head's joint, of an adult
enum { MIN_PIXELS = 3 };                           // of the mask along an edge

// Mask pixels on the rows or columns nearest to an edge, where the depth image has any.
static int count_row(const struct lens *l, const uint8_t *mask, int y)
{
    int count = 0;
    for (int x = 0; x < l->width; x++)
        count += mask[y * l->width + x] != 0;
    return count;
}

static int count_column(const struct lens *l, const uint8_t *mask, int x)
{
    int count = 0;
    for (int y = 0; y < l->height; y++)
        count += mask[y * l->width + x] != 0;
    return count;
}

// The row of a point that lies `down_m` below a joint. Camera axes: y is down.
static double row_of(const struct lens *l, struct pose depth_from_color, struct vec3 joint, double down_m)
{
    const struct vec3 p = pose_apply(depth_from_color, v3_add(joint, v3(0, down_m, 0)));
    return p.z > 0.1 ? l->fy * p.y / p.z + l->cy : l->height;
}

static bool known(const struct skeleton *s, enum joint j) { return s->confidence[j] > 0; }

struct framing framing_of(const struct framing_view *view)
{
    const struct lens *l = &view->calibration->depth;
    const struct skeleton *s = view->skeleton;
    const struct pose depth_from_color = pose_inverse(view->calibration->color_from_depth);
    struct framing f = {.distance_m = 0};
    bool low = false, high = false;
    for (int side = 0; side < 2; side++) {
        const enum joint foot = side ? JOINT_LEFT_FOOT : JOINT_RIGHT_FOOT;
        low |= known(s, foot) && row_of(l, depth_from_color, s->joint[foot], SOLE_M) > l->height - 1;
    }
    high = known(s, JOINT_HEAD) && row_of(l, depth_from_color, s->joint[JOINT_HEAD], -CROWN_M) < 0;
    // Registered depth may leave some rows at the edges empty: an edge counts within a hundredth of the picture.
    const int margin_y = l->height / 100, margin_x = l->width / 100;
    f.feet_outside = low || count_row(l, view->mask, l->height - 1 - margin_y) >= MIN_PIXELS;
    f.head_outside = high || count_row(l, view->mask, margin_y) >= MIN_PIXELS;
    f.side_outside = count_column(l, view->mask, margin_x) >= MIN_PIXELS ||
                     count_column(l, view->mask, l->width - 1 - margin_x) >= MIN_PIXELS;
    if (known(s, JOINT_WAIST)) {
        f.distance_m = s->joint[JOINT_WAIST].z;
        f.too_near = f.distance_m < NEAR_M;
        f.too_far = f.distance_m > FAR_M;
    }
    return f;
}
