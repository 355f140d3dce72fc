#include "app/state/orbit.h"

#include "base/clamp.h"

void orbit_move(struct orbit *orbit, double drag_x, double drag_y, double notches)
{
    if (!isfinite(drag_x) || !isfinite(drag_y) || !isfinite(notches)) // it would stay in the angles for ever
        return;
    // Gains and limits chosen by hand.
    orbit->angle_rad -= 4 * drag_x;
    orbit->rise_rad = clamp_double(orbit->rise_rad + 2 * drag_y, -0.2, 1.4);
    orbit->distance_m = clamp_double(orbit->distance_m * pow(0.9, notches), 0.8, 12);
}

void orbit_look(struct orbit *orbit, enum orbit_view view, double facing_rad, const struct orbit *start)
{
    static const double PI = 3.14159265358979323846, ABOVE_RAD = 1.4, SAME_RAD = 0.05;
    const double left_rad = facing_rad + PI / 2;
    const bool at_left = fabs(remainder(orbit->angle_rad - left_rad, 2 * PI)) < SAME_RAD &&
                         fabs(orbit->rise_rad - start->rise_rad) < SAME_RAD;
    orbit->rise_rad = view == ORBIT_ABOVE ? ABOVE_RAD : start->rise_rad;
    switch (view) {
    case ORBIT_FRONT:
    case ORBIT_ABOVE: orbit->angle_rad = facing_rad; break;
    case ORBIT_SIDE: orbit->angle_rad = at_left ? facing_rad - PI / 2 : left_rad; break;
    case ORBIT_BACK: orbit->angle_rad = facing_rad + PI; break;
    case ORBIT_START:
        orbit->angle_rad = start->angle_rad;
        orbit->distance_m = start->distance_m;
        break;
    }
}

struct pose orbit_world_from_camera(const struct orbit *o)
{
    struct vec3 back =
        v3(cos(o->rise_rad) * sin(o->angle_rad), -cos(o->rise_rad) * cos(o->angle_rad), sin(o->rise_rad));
    struct vec3 z = v3_scale(back, -1);                // forward
    struct vec3 x = v3_unit(v3_cross(z, v3(0, 0, 1))); // right; the elevation stays below a right angle
    struct vec3 y = v3_cross(z, x);                    // down
    double m[3][3] = {{x.x, y.x, z.x}, {x.y, y.y, z.y}, {x.z, y.z, z.z}};
    return (struct pose){quat_from_matrix(m), v3_add(o->centre, v3_scale(back, o->distance_m))};
}
