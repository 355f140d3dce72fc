#include "capture/body_points.h"

#include <string.h>

// The mean of all channels, 0..255, below which an image is too dark; chosen by hand. A room in which a sensor's colour
// image shows anything has 40 and more.
enum { DARK = 16, SAMPLE_EVERY = 97 };

static bool is_dark(const uint8_t *rgb, size_t bytes)
{
    size_t sum = 0, count = 0;
    for (size_t i = 0; i < bytes; i += SAMPLE_EVERY, count++)
        sum += rgb[i];
    return sum < DARK * count;
}

static const enum pose_point_name pose_point[BODY_POINT_COUNT] = {
    [BODY_POINT_NOSE] = POSE_NOSE,
    [BODY_POINT_LEFT_EYE] = POSE_LEFT_EYE,
    [BODY_POINT_RIGHT_EYE] = POSE_RIGHT_EYE,
    [BODY_POINT_LEFT_EAR] = POSE_LEFT_EAR,
    [BODY_POINT_RIGHT_EAR] = POSE_RIGHT_EAR,
    [BODY_POINT_LEFT_SHOULDER] = POSE_LEFT_SHOULDER,
    [BODY_POINT_RIGHT_SHOULDER] = POSE_RIGHT_SHOULDER,
    [BODY_POINT_LEFT_ELBOW] = POSE_LEFT_ELBOW,
    [BODY_POINT_RIGHT_ELBOW] = POSE_RIGHT_ELBOW,
    [BODY_POINT_LEFT_WRIST] = POSE_LEFT_WRIST,
    [BODY_POINT_RIGHT_WRIST] = POSE_RIGHT_WRIST,
    [BODY_POINT_LEFT_HIP] = POSE_LEFT_HIP,
    [BODY_POINT_RIGHT_HIP] = POSE_RIGHT_HIP,
    [BODY_POINT_LEFT_KNEE] = POSE_LEFT_KNEE,
    [BODY_POINT_RIGHT_KNEE] = POSE_RIGHT_KNEE,
    [BODY_POINT_LEFT_ANKLE] = POSE_LEFT_ANKLE,
    [BODY_POINT_RIGHT_ANKLE] = POSE_RIGHT_ANKLE,
    [BODY_POINT_LEFT_HEEL] = POSE_LEFT_HEEL,
    [BODY_POINT_RIGHT_HEEL] = POSE_RIGHT_HEEL,
    [BODY_POINT_LEFT_TOE] = POSE_LEFT_TOE,
    [BODY_POINT_RIGHT_TOE] = POSE_RIGHT_TOE,
};

enum status body_points_of_image(struct pose_network *n, const uint8_t *rgb, int width, int height,
                                 struct body_points *out)
{
    struct pose_points found;
    memset(out, 0, sizeof *out);
    if (is_dark(rgb, 3 * (size_t)width * (size_t)height))
        return NOTHING;
    enum status status = pose_network_find(n, rgb, width, height, &found);
    if (status < 0)
        return status;
    out->person = status == OK;
    for (int k = 0; out->person && k < BODY_POINT_COUNT; k++) {
        const struct pose_point *p = &found.point[pose_point[k]];
        out->at[k] = (struct body_point){(float)p->x_px, (float)p->y_px, (float)p->visibility};
    }
    return OK;
}
