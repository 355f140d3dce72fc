#include "app/state/orbit.h"

#include "base/clamp.h"

#include <math.h>

// ---------------------------------------------------------------- gesture

// Chosen by hand.
static const int64_t LONGEST_TAP_NS = 333000000;

static int find_finger(const struct gesture *gesture, int64_t id)
{
    for (int i = 0; i < gesture->count; i++)
        if (gesture->fingers[i].id == id)
            return i;
    return -1;
}

void gesture_down(struct gesture *gesture, int64_t id, double x, double y, int64_t now_ns)
{
    if (gesture->count == GESTURE_FINGERS || find_finger(gesture, id) >= 0)
        return;
    if (gesture->count == 0) {
        gesture->travelled = 0;
        gesture->down_ns = now_ns;
        gesture->several = false;
    } else {
        gesture->several = true;
    }
    gesture->fingers[gesture->count].id = id;
    gesture->fingers[gesture->count].x = x;
    gesture->fingers[gesture->count].y = y;
    gesture->count++;
}

// One of the first two fingers moved to (x, y): adds their push, spread and twist.
static void move_two(struct gesture *gesture, int moved, double x, double y)
{
    double ax = gesture->fingers[0].x, ay = gesture->fingers[0].y, bx = gesture->fingers[1].x,
           by = gesture->fingers[1].y;
    double cx = moved == 0 ? x : ax, cy = moved == 0 ? y : ay, dx = moved == 1 ? x : bx, dy = moved == 1 ? y : by;
    double before = hypot(bx - ax, by - ay), after = hypot(dx - cx, dy - cy);
    gesture->push_x += (cx + dx - ax - bx) / 2;
    gesture->push_y += (cy + dy - ay - by) / 2;
    if (before > 0 && after > 0) {
        gesture->spread *= after / before;
        double angle = atan2(dy - cy, dx - cx) - atan2(by - ay, bx - ax);
        gesture->twist += remainder(angle, 2 * acos(-1));
    }
}

void gesture_move(struct gesture *gesture, int64_t id, double x, double y)
{
    int i = find_finger(gesture, id);
    if (i < 0)
        return;
    if (gesture->spread == 0)
        gesture->spread = 1;
    double by_x = x - gesture->fingers[i].x, by_y = y - gesture->fingers[i].y;
    if (gesture->count == 1) {
        gesture->drag_x += by_x;
        gesture->drag_y += by_y;
    } else if (i < 2) {
        move_two(gesture, i, x, y);
    }
    if (i == 0)
        gesture->travelled += hypot(by_x, by_y);
    gesture->fingers[i].x = x;
    gesture->fingers[i].y = y;
}

void gesture_up(struct gesture *gesture, int64_t id, double slack, int64_t now_ns)
{
    int i = find_finger(gesture, id);
    if (i < 0)
        return;
    gesture->tapped |= gesture->count == 1 && !gesture->several && gesture->travelled <= slack &&
                       now_ns - gesture->down_ns <= LONGEST_TAP_NS;
    gesture->count--;
    for (; i < gesture->count; i++)
        gesture->fingers[i] = gesture->fingers[i + 1];
}

struct gesture gesture_take(struct gesture *gesture)
{
    struct gesture taken = *gesture;
    if (taken.spread == 0)
        taken.spread = 1;
    gesture->drag_x = gesture->drag_y = gesture->push_x = gesture->push_y = gesture->twist = 0;
    gesture->spread = 1;
    gesture->tapped = false;
    return taken;
}

// ---------------------------------------------------------------- orbit

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

struct pose orbit_world_from_camera(const struct orbit *orbit)
{
    struct vec3 back = v3(cos(orbit->rise_rad) * sin(orbit->angle_rad), -cos(orbit->rise_rad) * cos(orbit->angle_rad),
                          sin(orbit->rise_rad));
    struct vec3 z = v3_scale(back, -1);                // forward
    struct vec3 x = v3_unit(v3_cross(z, v3(0, 0, 1))); // right; the elevation stays below a right angle
    struct vec3 y = v3_cross(z, x);                    // down
    double m[3][3] = {{x.x, y.x, z.x}, {x.y, y.y, z.y}, {x.z, y.z, z.z}};
    return (struct pose){quat_from_matrix(m), v3_add(orbit->centre, v3_scale(back, orbit->distance_m))};
}
