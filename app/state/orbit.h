// A camera that circles a point at arm's length, for looking without a tablet.
#pragma once
#include "base/lens.h"

struct orbit {
    struct vec3 centre; // looked at; world axes, z up
    double angle_rad;   // round z, 0 = from -y
    double rise_rad;    // above the horizon
    double distance_m;
};

// Turned by a drag of those shares of the picture, moved by that many notches; kept within sense.
void orbit_move(struct orbit *orbit, double drag_x, double drag_y, double notches);

struct pose orbit_world_from_camera(const struct orbit *orbit);
