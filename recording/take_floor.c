#include "recording/take_floor.h"

#include "base/floor_plane.h"

// By the poses that are not measured: the identity says nothing, any other is upright.
static enum status take_stated_up(const struct take *take, struct vec3 *up)
{
    struct vec3 sum = {0, 0, 0};
    for (int64_t i = 0; i < take_frame_count(take); i++) {
        const struct take_entry *e = take_entry(take, i);
        const struct quat q = e->world_from_camera.rotation;
        if (!e->located && (q.x != 0 || q.y != 0 || q.z != 0))
            sum = v3_add(sum, quat_rotate(quat_conjugate(q), v3(0, 0, 1)));
    }
    if (!(v3_length(sum) > 0))
        return NOTHING;
    *up = v3_unit(sum);
    return OK;
}

enum status take_floor_up(struct take *take, struct vec3 *up)
{
    enum { LOOKS = 5 };
    const double alike =
        0.9986; // cosine of 3 degrees, by hand: a plane fitted to a noisy floor is within half a degree
    const struct calibration *c = take_calibration(take);
    const int64_t count = take_frame_count(take);
    struct vec3 seen[LOOKS], sum = {0, 0, 0};
    int floors = 0, agreeing = 0;
    for (int k = 0; k < LOOKS && c->depth.width > 0; k++) {
        struct take_images images;
        struct floor_plane floor;
        const enum status status = take_read(take, count * (2 * k + 1) / (2 * LOOKS), TAKE_DEPTH, &images);
        if (status < 0 && status != ERR_CORRUPT)
            return status;
        if (status != OK || !images.depth || !floor_plane_find(&c->depth, images.depth, &floor))
            continue;
        seen[floors++] = floor.up;
        sum = v3_add(sum, floor.up);
    }
    const struct vec3 mean = v3_unit(sum);
    for (int k = 0; k < floors; k++)
        agreeing += v3_dot(seen[k], mean) > alike;
    if (2 * agreeing <= LOOKS)
        return take_stated_up(take, up);
    *up = quat_rotate(c->color_from_depth.rotation, mean);
    return OK;
}
