// Gravity from the floor plane.
#include "capture/gravity_align.h"
#include "base/portable_math.h"

// Up directions that differ by less agree: the accuracy of a plane fitted to a noisy floor. Chosen by hand.
static const double LEVEL_RAD = 0.004;

// How far from z = 0 a levelled plane may lie and still be the floor. Chosen by hand.
static const double FLOOR_M = 0.12;

enum { CELLS_ACROSS = 80, CELLS_MAX = 80 * 80 };

bool gravity_align_floor(const struct lens *lens, const uint16_t *depth, struct floor_plane *out)
{
    static _Thread_local struct grid_ray rays[CELLS_MAX];
    static _Thread_local uint16_t cells[CELLS_MAX];
    int step = lens->width > CELLS_ACROSS ? lens->width / CELLS_ACROSS : 1;
    int across = lens->width / step, down = lens->height / step;
    while (across * down > CELLS_MAX)
        down--; // an image higher than wide: its lowest rows are not used
    for (int y = 0; y < down; y++)
        for (int x = 0; x < across; x++) {
            int px = x * step + step / 2, py = y * step + step / 2;
            struct vec3 ray = lens_ray(lens, (struct pixel){px, py});
            rays[y * across + x] = (struct grid_ray){(float)ray.x, (float)ray.y};
            cells[y * across + x] = depth[(size_t)py * (size_t)lens->width + (size_t)px];
        }
    return floor_plane_fit(cells, rays, across, down, out);
}

bool gravity_align_pose(struct pose *world_from_camera, struct vec3 pivot, const struct floor_plane *floor_in_camera)
{
    struct vec3 up = quat_rotate(world_from_camera->rotation, floor_in_camera->up);
    if (v3_dot(up, v3(0, 0, 1)) > portable_cos(LEVEL_RAD))
        return false;
    struct quat rotation = quat_between(up, v3(0, 0, 1));
    struct pose level = {
        quat_unit(quat_multiply(rotation, world_from_camera->rotation)),
        v3_add(pivot, quat_rotate(rotation, v3_sub(world_from_camera->translation, pivot))),
    };
    if (fabs(level.translation.z - floor_in_camera->height_m) > FLOOR_M)
        return false;
    *world_from_camera = level;
    return true;
}
