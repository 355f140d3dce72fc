#include "tests/support/drive_trial.h"

#include "base/portable_math.h"

#include <stdlib.h>
#include <string.h>

// All chosen by hand. BODY_M: from the body's middle to its sides, and 4 cm; nothing may stand nearer. WIDE_M: so far
// from things the driver is at ease, a step nearer costs up to NEAR_COST more. HITS: pixels that make an obstacle.
// SPECK: so few cells within 10 cm are pixels at silhouettes that hang in the air. OBSTACLE_M: what is higher above the
// floor is no floor.
#define CELL_M          0.05
#define LOW_X           -2.0
#define LOW_Y           -2.0
#define BODY_M          0.29
#define DIAGONAL_M      0.42 // half of the body's, and 3 cm
#define MARGIN_M        0.03
#define FARTHEST_BACK_M 0.8 // that is gone to turn where there is room
#define WIDE_M          0.55
#define NEAR_COST       8.0
#define CREEP_M         0.2
#define REACHED_M       0.15
#define OBSTACLE_M      0.12
#define SPEED           0.3
#define TURN_RATE       0.5
#define TURN_RAD        0.05 // smaller errors of heading are no reason for a command
#define TICK_S          0.1
// The map's viewpoint: from above, a little from behind. The picture's second: tilted down, to the floor before the
// body.
#define MAP_ELEVATION  1.4
#define MAP_DISTANCE_M 5.0
#define TILT_RAD       0.6
#define UNSEEN_COST    6.0  // of a step over unseen floor against one over seen floor
#define STRAIGHT_COST  1.25 // of the straight way against the best one, for which it is taken
// A look from nearer overrides those from farther away, and one from about as near (SAME_LOOK) counts as much as all of
// them. What was never looked at from within trusted_m is doubted: there pictures continue what they have seen. Where
// that leaves no way, only what was seen from nearer is believed.
#define LOOK         0.5
#define SAME_LOOK_M  0.3
#define DOUBTED_COST 5.0
static const double trusted_m[] = {2, 1, 0.6};
enum { COLUMNS = 180, ROWS = 80, CELLS = ROWS * COLUMNS, HITS = 3, SPECK = 2, MOST_COMMANDS = 120 };

struct driver {
    struct simulated_rover *rover;
    enum trial_view view;
    float occupied[CELLS]; // -1 floor … 1 something stands there; 0: not seen, or undecided
    float looked_m[CELLS]; // from how near it was looked at; 0: never
    float near_m[CELLS];   // to what stands nearest, at most WIDE_M
    bool doubted[CELLS];   // something that is doubted stands nearer than BODY_M
    uint8_t hits[CELLS];   // of what stands there, in the newest look
    bool shown[CELLS];     // it shows something there
    bool pictured[CELLS];  // the newest picture did
    double cost[CELLS];    // of the way from there to the goal
    int heap[CELLS], place[CELLS], heap_count;
    double goal[2];
    int aim;        // the cell that it has turned to; -1: none
    struct vec3 at; // the body, as it is believed to be
};

static int cell_of(double x, double y)
{
    const int column = (int)floor((x - LOW_X) / CELL_M), row = (int)floor((y - LOW_Y) / CELL_M);
    return column >= 0 && column < COLUMNS && row >= 0 && row < ROWS ? row * COLUMNS + column : -1;
}

static struct vec3 middle_of(int cell)
{
    return v3(LOW_X + (cell % COLUMNS + 0.5) * CELL_M, LOW_Y + (cell / COLUMNS + 0.5) * CELL_M, 0);
}

static double apart(struct vec3 a, struct vec3 b) { return portable_hypot(a.x - b.x, a.y - b.y); }

// ---------------------------------------------------------------- what the driver knows

static enum status look_from(struct driver *d, struct pose eye)
{
    const enum status status = surroundings_draw(&d->rover->surroundings, eye);
    const struct surround_view *v = &d->rover->surroundings.view;
    for (int y = 0; y < v->lens.height; y++)
        for (int x = 0; x < v->lens.width && status == OK; x++) {
            const size_t i = (size_t)y * (size_t)v->lens.width + (size_t)x;
            double world[3];
            if (v->source[i] == SOURCE_UNSEEN || !(v->inverse_z[i] > 0))
                continue;
            surround_view_point(v, x, y, v->inverse_z[i], world);
            const int cell = world[2] < d->rover->options.size_m[2] ? cell_of(world[0], world[1]) : -1;
            if (cell < 0)
                continue;
            d->shown[cell] = true;
            d->hits[cell] += world[2] > OBSTACLE_M && d->hits[cell] < HITS;
        }
    return status;
}

static void take_look(struct driver *d, int cell)
{
    const float now = (float)apart(middle_of(cell), d->at), before = d->looked_m[cell];
    if ((double)now < BODY_M) {
        d->occupied[cell] = -1; // it stands there
        d->looked_m[cell] = now;
    }
    if ((double)now < BODY_M || !d->shown[cell] || (before > 0 && (double)now > (double)before + SAME_LOOK_M))
        return;
    const float verdict = d->hits[cell] >= HITS ? 1 : -1;
    const bool nearer = !(before > 0) || (double)now < (double)before - SAME_LOOK_M;
    d->occupied[cell] = nearer ? verdict : d->occupied[cell] + (float)LOOK * (verdict - d->occupied[cell]);
    d->looked_m[cell] = before > 0 ? fminf(now, before) : now;
}

static enum status look_at(struct driver *d, const struct pose *eyes, int count, const bool *besides)
{
    enum status status = OK;
    memset(d->hits, 0, sizeof d->hits);
    memset(d->shown, 0, sizeof d->shown);
    for (int i = 0; i < count && status == OK; i++)
        status = look_from(d, eyes[i]);
    for (int i = 0; i < CELLS && status == OK; i++)
        if (!besides || !besides[i])
            take_look(d, i);
    return status;
}

// The picture, ahead and tilted down; with the map, that, too, for what the picture does not show.
static enum status look(struct driver *d, struct pose body)
{
    static const struct vec3 down = {-TILT_RAD, 0, 0};
    struct pose eyes[2] = {operator_viewpoint(VIEWPOINT_FIRST, body, d->rover->options.size_m)};
    const struct pose above = operator_orbit(body, 0, MAP_ELEVATION, MAP_DISTANCE_M);
    eyes[1] = (struct pose){quat_multiply(eyes[0].rotation, quat_from_rotation_vector(down)), eyes[0].translation};
    d->at = body.translation;
    enum status status = look_at(d, eyes, 2, NULL);
    memcpy(d->pictured, d->shown, sizeof d->pictured);
    if (status == OK && d->view == TRIAL_MAP)
        status = look_at(d, &above, 1, d->pictured);
    return status;
}

// How near the cells about an obstacle are to it.
static void measure_about(struct driver *d, int obstacle, double trusted_to_m)
{
    const bool trusted = (double)d->looked_m[obstacle] < trusted_to_m;
    const int reach = (int)((trusted ? WIDE_M : BODY_M) / CELL_M), side = 2 * reach + 1;
    for (int k = 0; k < side * side; k++) {
        const int dx = k % side - reach, dy = k / side - reach;
        const int column = obstacle % COLUMNS + dx, row = obstacle / COLUMNS + dy;
        if (column < 0 || column >= COLUMNS || row < 0 || row >= ROWS)
            continue;
        float *near = &d->near_m[row * COLUMNS + column];
        if (trusted)
            *near = fminf(*near, (float)(CELL_M * portable_hypot(dx, dy)));
        else
            d->doubted[row * COLUMNS + column] = true;
    }
}

static bool is_speck(const struct driver *d, int cell)
{
    int count = 0;
    for (int k = 0; k < 25; k++) {
        const int column = cell % COLUMNS + k % 5 - 2, row = cell / COLUMNS + k / 5 - 2;
        count += column >= 0 && column < COLUMNS && row >= 0 && row < ROWS && d->occupied[row * COLUMNS + column] > 0;
    }
    return count <= SPECK;
}

static void measure(struct driver *d, double trusted_to_m)
{
    memset(d->doubted, 0, sizeof d->doubted);
    for (int i = 0; i < CELLS; i++)
        d->near_m[i] = (float)WIDE_M;
    for (int i = 0; i < CELLS; i++)
        if (d->occupied[i] > 0 && !is_speck(d, i))
            measure_about(d, i, trusted_to_m);
}

// ---------------------------------------------------------------- the way (Dijkstra 1959, from the goal)

static void swap(struct driver *d, int a, int b)
{
    const int cell = d->heap[a];
    d->heap[a] = d->heap[b];
    d->heap[b] = cell;
    d->place[d->heap[a]] = a;
    d->place[d->heap[b]] = b;
}

static void rise(struct driver *d, int at)
{
    for (; at && d->cost[d->heap[at]] < d->cost[d->heap[(at - 1) / 2]]; at = (at - 1) / 2)
        swap(d, at, (at - 1) / 2);
}

static int take_nearest(struct driver *d)
{
    const int cell = d->heap[0];
    swap(d, 0, --d->heap_count);
    for (int at = 0, child = 1; child < d->heap_count; child = 2 * at + 1) {
        child += child + 1 < d->heap_count && d->cost[d->heap[child + 1]] < d->cost[d->heap[child]];
        if (!(d->cost[d->heap[child]] < d->cost[d->heap[at]]))
            break;
        swap(d, at, child);
        at = child;
    }
    return cell;
}

static const int around[8][2] = {{1, 0}, {0, 1}, {-1, 0}, {0, -1}, {1, 1}, {-1, 1}, {-1, -1}, {1, -1}};

// The neighbour of a cell; -1: outside.
static int neighbour(int cell, int direction)
{
    const int column = cell % COLUMNS + around[direction][0], row = cell / COLUMNS + around[direction][1];
    return column >= 0 && column < COLUMNS && row >= 0 && row < ROWS ? row * COLUMNS + column : -1;
}

// Of a metre there; 0: the body cannot be there. Where it stands already it can.
static double cost_at(const struct driver *d, int cell)
{
    const double near = (double)d->near_m[cell], short_of = fmax(0, WIDE_M - near) / (WIDE_M - BODY_M);
    if (near < BODY_M && apart(middle_of(cell), d->at) > BODY_M)
        return 0;
    return (1 + NEAR_COST * short_of) * (d->occupied[cell] < 0 ? 1 : UNSEEN_COST) *
           (d->doubted[cell] ? DOUBTED_COST : 1);
}

static double step_cost(const struct driver *d, int to, int direction)
{
    return (direction < 4 ? 1 : 1.41421356) * CELL_M * cost_at(d, to);
}

static void find_ways(struct driver *d)
{
    const int goal = cell_of(d->goal[0], d->goal[1]);
    for (int i = 0; i < CELLS; i++) {
        d->cost[i] = 1e9;
        d->heap[i] = d->place[i] = i;
    }
    d->heap_count = CELLS;
    d->cost[goal] = 0;
    rise(d, d->place[goal]);
    while (d->heap_count) {
        const int cell = take_nearest(d);
        if (d->cost[cell] >= 1e9)
            return;
        for (int k = 0; k < 8; k++) {
            const int to = neighbour(cell, k);
            if (to < 0 || !(cost_at(d, to) > 0) || !(d->cost[cell] + step_cost(d, to, k) < d->cost[to]))
                continue;
            d->cost[to] = d->cost[cell] + step_cost(d, to, k);
            rise(d, d->place[to]);
        }
    }
}

// Whether all of the floor across the body and its margin was seen, on a way to which `across` is normal.
static bool floor_seen(const struct driver *d, struct vec3 at, struct vec3 across)
{
    bool seen = true;
    for (double side = -BODY_M; side <= BODY_M; side += CELL_M / 2) {
        const struct vec3 p = v3_add(at, v3_scale(across, side));
        const int cell = cell_of(p.x, p.y);
        seen &= cell >= 0 && d->occupied[cell] < 0;
    }
    return seen;
}

// Whether the straight way to a cell is about as good as the best; *seen: how far there and beyond over floor that
// was seen, metres, at most by DIAGONAL_M beyond.
static bool straight_to(const struct driver *d, int cell, double *seen)
{
    const struct vec3 to = middle_of(cell);
    const double length = apart(to, d->at), step = CELL_M / 2;
    const struct vec3 across = v3_scale(v3(d->at.y - to.y, to.x - d->at.x, 0), 1 / length);
    bool still_seen = true;
    double cost = 0;
    *seen = 0;
    for (double s = 0; s < length + DIAGONAL_M; s += step) {
        const struct vec3 p = v3_add(d->at, v3_scale(v3_sub(to, d->at), s / length));
        const int at = cell_of(p.x, p.y);
        const double here = at < 0 ? 0 : cost_at(d, at);
        if (s < length && !(here > 0))
            return false;
        cost += s < length ? here * step : 0;
        still_seen &= floor_seen(d, p, across);
        *seen = still_seen ? s : *seen;
    }
    return cost <= STRAIGHT_COST * (d->cost[cell_of(d->at.x, d->at.y)] - d->cost[cell]) + CREEP_M;
}

// The farthest cell of the best way that can be gone to straight and, if there is such, has room to turn; -1: there is
// no way.
static int next_corner(const struct driver *d, double *seen)
{
    int at = cell_of(d->at.x, d->at.y), best = -1;
    bool roomy = false;
    for (int n = 0; at >= 0 && n < CELLS && d->cost[at] > 0 && d->cost[at] < 1e9; n++) {
        int lowest = -1;
        double reach;
        for (int k = 0; k < 8; k++) {
            const int to = neighbour(at, k);
            if (to >= 0 && d->cost[to] < (lowest < 0 ? d->cost[at] : d->cost[lowest]))
                lowest = to;
        }
        if (lowest < 0)
            break;
        at = lowest;
        const bool room = (double)d->near_m[at] >= DIAGONAL_M || !(d->cost[at] > 0);
        if ((room || !roomy) && straight_to(d, at, &reach)) {
            best = at;
            *seen = reach;
            roomy = room;
        }
    }
    return best;
}

// ---------------------------------------------------------------- driving

static enum status carry_out(struct driver *d, struct drive_command command, double seconds, struct trial_result *out)
{
    enum status status = OK;
    for (double left = seconds; left > 1e-9 && status == OK && !d->rover->touched; left -= TICK_S)
        status = simulated_rover_step(d->rover, command, fmin(left, TICK_S));
    out->length_m += fabs(command.speed) * seconds;
    out->commands++;
    return status;
}

// Whether what stands there lets the body turn so far; what is shown inside it already cannot be there.
static bool may_turn(const struct driver *d, struct pose body, double angle)
{
    const double *size = d->rover->options.size_m;
    const int steps = 1 + (int)(fabs(angle) / 0.1);
    for (int i = 0; i < CELLS; i++) {
        if (!(d->occupied[i] > 0) || apart(middle_of(i), body.translation) > DIAGONAL_M || is_speck(d, i))
            continue;
        const struct vec3 at = pose_apply(pose_inverse(body), middle_of(i));
        for (int k = 0; k <= steps; k++) {
            const struct vec3 then = quat_rotate(quat_from_rotation_vector(v3(0, 0, -angle * k / steps)), at);
            const bool inside = fabs(then.x) < size[0] / 2 + MARGIN_M && fabs(then.y) < size[1] / 2 + MARGIN_M;
            if (inside && k == 0)
                break;
            if (inside)
                return false;
        }
    }
    return true;
}

static double bearing_of(struct pose body, int cell)
{
    const struct vec3 local = pose_apply(pose_inverse(body), middle_of(cell));
    return portable_atan2(local.y, local.x);
}

// The shortest way straight back or ahead to where the body may turn towards the cell; 0: there is none.
static double way_to_turn(const struct driver *d, struct pose body, int cell)
{
    for (double way = CELL_M; way <= FARTHEST_BACK_M; way += CELL_M)
        for (int sign = -1; sign <= 1; sign += 2) {
            const struct pose there = robot_motion_after(body, (struct drive_command){sign * way, 0}, 1);
            const int at = cell_of(there.translation.x, there.translation.y);
            if (at >= 0 && d->occupied[at] < 0 && (double)d->near_m[at] > BODY_M &&
                may_turn(d, there, bearing_of(there, cell)))
                return sign * way;
        }
    return 0;
}

// Turns towards the next corner; or, where it has turned to one to which there still is a way, drives straight as far
// as the floor was seen. NOTHING: no way.
static enum status go_on(struct driver *d, struct pose body, struct trial_result *out)
{
    double seen = 0;
    int corner = -1;
    for (size_t n = 0; n < COUNT_OF(trusted_m) && corner < 0; n++) {
        measure(d, trusted_m[n]);
        find_ways(d);
        corner = d->aim >= 0 && straight_to(d, d->aim, &seen) ? d->aim : next_corner(d, &seen);
    }
    d->aim = -1;
    if (corner < 0)
        return NOTHING;
    const double bearing = bearing_of(body, corner), distance = apart(middle_of(corner), d->at);
    if (fabs(bearing) > TURN_RAD && !may_turn(d, body, bearing)) {
        const double way = way_to_turn(d, body, corner);
        if (way != 0)
            return carry_out(d, (struct drive_command){way > 0 ? SPEED : -SPEED, 0}, fabs(way) / SPEED, out);
    }
    if (fabs(bearing) > TURN_RAD) { // and look there before it goes
        d->aim = corner;
        return carry_out(d, (struct drive_command){0, bearing > 0 ? TURN_RATE : -TURN_RATE}, fabs(bearing) / TURN_RATE,
                         out);
    }
    const double length = fmin(distance, fmax(seen - DIAGONAL_M, CREEP_M));
    return carry_out(d, (struct drive_command){SPEED, 0}, length / SPEED, out);
}

enum status drive_trial_open(struct simulated_rover *r, int number)
{
    struct box_world world;
    struct pose start;
    struct rover_options how = rover_default_options();
    how.seed = (uint32_t)number + 1;
    how.panorama_height = 128; // its pictures' edges are finer than the driver's cells
    rover_stage_world(2, &world, &start);
    start.translation.y = 0.04 * (number % 5) - 0.08;
    start.rotation = quat_from_rotation_vector(v3(0, 0, 0.05 * (number % 7) - 0.15));
    return simulated_rover_open(r, &world, start, &how);
}

enum status drive_trial_run(struct simulated_rover *r, enum trial_view view, struct trial_result *out)
{
    struct driver *d = calloc(1, sizeof *d);
    *out = (struct trial_result){0};
    if (!d)
        return fail(ERR_MEMORY, "out of memory");
    const struct vec3 goal = pose_apply(pose_inverse(r->start), v3(5, -0.1, 0)); // the passage's end
    d->rover = r;
    d->view = view;
    d->aim = -1;
    d->goal[0] = goal.x;
    d->goal[1] = goal.y;
    enum status status = OK;
    while (status == OK && out->commands < MOST_COMMANDS && !r->touched && !out->arrived) {
        const struct pose body = simulated_rover_pose(r);
        out->arrived = portable_hypot(goal.x - body.translation.x, goal.y - body.translation.y) < REACHED_M;
        status = out->arrived ? OK : look(d, body);
        if (status == OK && !out->arrived)
            status = go_on(d, body, out);
    }
    out->touched = r->touched;
    free(d);
    return status < 0 ? status : OK;
}

// ---------------------------------------------------------------- approaching

// The driver slows down as it comes closer and stops at CLOSE_M: as close as the depth's noise and the odometry since
// the last capture allow.
#define CLOSE_M 0.03
#define STEP_S  0.2
#define FASTEST 0.3
enum { MAX_STEPS = 200 };

enum status drive_trial_approach(struct simulated_rover *r, double *clearance_m)
{
    enum status status = OK;
    for (int i = 0; status == OK && i < MAX_STEPS && !r->touched; i++) {
        const struct pose body = simulated_rover_pose(r);
        struct nearest_thing thing;
        status = surroundings_draw(&r->surroundings, operator_viewpoint(VIEWPOINT_ABOVE, body, r->options.size_m));
        if (status != OK)
            break;
        const bool seen = nearest_in_view(&r->surroundings.view, body, r->options.size_m, 0.1, &thing) == OK;
        const double left = seen ? thing.distance_m - CLOSE_M : 0.3;
        if (left <= 0.002)
            break;
        const double speed = fmin(FASTEST, 0.5 * left / STEP_S);
        status = simulated_rover_step(r, (struct drive_command){speed, 0}, STEP_S);
    }
    *clearance_m = r->touched ? 0 : box_world_clearance(&r->world, r->world_from_body, r->options.size_m);
    return status;
}
