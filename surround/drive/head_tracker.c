#include "surround/drive/head_tracker.h"

struct pose head_tracker_eye(struct head_tracker *t, struct pose place_from_camera, struct vec3 viewpoint)
{
    if (!t->centred) {
        // Looking straight up or down, the top or bottom of the picture says which way
        struct vec3 ahead = quat_rotate(place_from_camera.rotation, v3(0, 0, 1));
        if (ahead.x * ahead.x + ahead.y * ahead.y < 0.02)
            ahead = quat_rotate(place_from_camera.rotation, v3(0, ahead.z > 0 ? 1 : -1, 0));
        const double length = sqrt(ahead.x * ahead.x + ahead.y * ahead.y);
        t->c = length > 0 ? ahead.x / length : 1;
        t->s = length > 0 ? ahead.y / length : 0;
        t->origin = place_from_camera.translation;
        t->centred = true;
    }
    double back[3][3] = {{t->c, t->s, 0}, {-t->s, t->c, 0}, {0, 0, 1}};
    const struct quat turn = quat_from_matrix(back);
    const struct vec3 moved = v3_sub(place_from_camera.translation, t->origin);
    return (struct pose){quat_multiply(turn, place_from_camera.rotation), v3_add(viewpoint, quat_rotate(turn, moved))};
}
