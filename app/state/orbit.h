// A virtual camera on a sphere about a point: the viewpoint moved by fingers, without a camera. Pure.
#pragma once
#include "base/lens.h"
#include "base/status.h"

// ---------------------------------------------------------------- gesture

// Recognises touch gestures on the image: one finger drags, two spread, twist and push, a short touch taps.
// Lengths are in any one unit, in and out. y runs down. Pure.

enum { GESTURE_FINGERS = 5 };

struct gesture {
    int count;
    struct {
        int64_t id;
        double x, y;
    } fingers[GESTURE_FINGERS];
    double travelled; // path length of the first finger since it went down
    int64_t down_ns;
    bool several; // more than one finger took part since the first went down
    // Accumulated since the last gesture_take:
    double drag_x, drag_y; // of a single finger
    double push_x, push_y; // of the midpoint of two fingers
    double spread;         // ratio of the fingers' distances; 1: unchanged
    double twist;          // radians, clockwise as seen
    bool tapped;
};

// A tap travels no farther than `slack` and takes no longer than a third of a second.
void gesture_down(struct gesture *gesture, int64_t id, double x, double y, int64_t now_ns);
void gesture_move(struct gesture *gesture, int64_t id, double x, double y);
void gesture_up(struct gesture *gesture, int64_t id, double slack, int64_t now_ns);

// Returns what has accumulated, and resets it.
struct gesture gesture_take(struct gesture *gesture);

// ---------------------------------------------------------------- orbit

struct orbit {
    struct vec3 centre; // of the sphere, world axes, z up; always in the middle of the view
    double angle_rad;   // azimuth about z; 0: seen from -y
    double rise_rad;    // elevation above the horizon, -0.2 to 1.4
    double distance_m;  // 0.8 to 12
};

// drag_x, drag_y: shares of the image's height, right and down. notches: of the wheel; each comes a tenth nearer.
// The elevation and the distance stay in their ranges.
void orbit_move(struct orbit *orbit, double drag_x, double drag_y, double notches);

// From which side of a person who faces facing_rad: the azimuth of the orbit in front of them. SIDE: their left, and
// from there their right. The distance stays. START: as the orbit was at first.
enum orbit_view { ORBIT_FRONT, ORBIT_SIDE, ORBIT_BACK, ORBIT_ABOVE, ORBIT_START };
void orbit_look(struct orbit *orbit, enum orbit_view view, double facing_rad, const struct orbit *start);

// Camera axes: x right, y down, z towards the centre; never rolled.
struct pose orbit_world_from_camera(const struct orbit *orbit);
