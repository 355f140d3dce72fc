#include "app/state/orbit.h"

#include "base/clamp.h"

#include <math.h>

// ---------------------------------------------------------------- gesture

// Chosen by hand.
static const int64_t LONGEST_TAP_NS = 333000000;

static int find(const struct gesture *g, int64_t id)
{
    for (int i = 0; i < g->count; i++)
        if (g->fingers[i].id == id)
            return i;
    return -1;
}

void gesture_down(struct gesture *g, int64_t id, double x, double y, int64_t now_ns)
{
    if (g->count == GESTURE_FINGERS || find(g, id) >= 0)
        return;
    if (g->count == 0) {
        g->travelled = 0;
        g->down_ns = now_ns;
        g->several = false;
    } else {
        g->several = true;
    }
    g->fingers[g->count].id = id;
    g->fingers[g->count].x = x;
    g->fingers[g->count].y = y;
    g->count++;
}

// One of the first two fingers moved to (x, y): adds their push, spread and twist.
static void move_two(struct gesture *g, int moved, double x, double y)
{
    double ax = g->fingers[0].x, ay = g->fingers[0].y, bx = g->fingers[1].x, by = g->fingers[1].y;
    double cx = moved == 0 ? x : ax, cy = moved == 0 ? y : ay, dx = moved == 1 ? x : bx, dy = moved == 1 ? y : by;
    double before = hypot(bx - ax, by - ay), after = hypot(dx - cx, dy - cy);
    g->push_x += (cx + dx - ax - bx) / 2;
    g->push_y += (cy + dy - ay - by) / 2;
    if (before > 0 && after > 0) {
        g->spread *= after / before;
        double angle = atan2(dy - cy, dx - cx) - atan2(by - ay, bx - ax);
        g->twist += remainder(angle, 2 * acos(-1));
    }
}

void gesture_move(struct gesture *g, int64_t id, double x, double y)
{
    int i = find(g, id);
    if (i < 0)
        return;
    if (g->spread == 0)
        g->spread = 1;
    double by_x = x - g->fingers[i].x, by_y = y - g->fingers[i].y;
    if (g->count == 1) {
        g->drag_x += by_x;
        g->drag_y += by_y;
    } else if (i < 2) {
        move_two(g, i, x, y);
    }
    if (i == 0)
        g->travelled += hypot(by_x, by_y);
    g->fingers[i].x = x;
    g->fingers[i].y = y;
}

void gesture_up(struct gesture *g, int64_t id, double slack, int64_t now_ns)
{
    int i = find(g, id);
    if (i < 0)
        return;
    g->tapped |= g->count == 1 && !g->several && g->travelled <= slack && now_ns - g->down_ns <= LONGEST_TAP_NS;
    g->count--;
    for (; i < g->count; i++)
        g->fingers[i] = g->fingers[i + 1];
}

struct gesture gesture_take(struct gesture *g)
{
    struct gesture taken = *g;
    if (taken.spread == 0)
        taken.spread = 1;
    g->drag_x = g->drag_y = g->push_x = g->push_y = g->twist = 0;
    g->spread = 1;
    g->tapped = false;
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
