#include "reenact/surround/drive/drive_trial.h"

#include "base/portable_math.h"

#include <stdlib.h>
#include <string.h>

// All chosen by hand. CLEAR_M: from the body's middle to what stands there: half its diagonal and 3 cm, so that it may
// turn on the spot. HITS: pixels that make an obstacle. OBSTACLE_M: what is higher above the floor is no floor.
#define CELL_M     0.05
#define LOW_X      -2.0
#define LOW_Y      -2.0
#define CLEAR_M    0.42
#define CREEP_M    0.2
#define REACHED_M  0.15
#define OBSTACLE_M 0.12
#define SPEED      0.3
#define TURN_RATE  0.5
#define TURN_RAD   0.05 // smaller errors of heading are no reason for a command
#define TICK_S     0.1
// The map's viewpoint: from above, a little from behind.
#define MAP_ELEVATION  1.4
#define MAP_DISTANCE_M 5.0
#define UNSEEN_COST    10.0 // of a step over unseen floor against one over seen floor
#define DOUBTED_COST   5.0
// Obstacles farther away than this are doubted: drawn depth there may be continued from what stands before it. Where
// that leaves no way, or one that is DETOUR times as costly, only nearer ones are believed.
static const double trust_m[] = {2, 1, 0.6};
#define DETOUR 1.5
enum { COLUMNS = 180, ROWS = 80, CELLS = ROWS * COLUMNS, HITS = 3, VOTES = 3, MOST_COMMANDS = 200 };

struct driver {
    struct simulated_rover *rover;
    enum trial_view view;
    int8_t votes[CELLS];   // pictures that showed an obstacle there, less those that showed floor; at most VOTES
    bool floor[CELLS];     // the floor was seen
    bool forbidden[CELLS]; // for the body's middle
    bool doubted[CELLS];   // by what stands far away
    uint8_t newest[CELLS]; // hits of the newest picture
    bool shown[CELLS];     // it shows something there
    double cost[CELLS];    // of the way from there to the goal
    int heap[CELLS], place[CELLS], heap_count;
    double goal[2];
};

static int cell_of(double x, double y)
{
    const int column = (int)floor((x - LOW_X) / CELL_M), row = (int)floor((y - LOW_Y) / CELL_M);
    return column >= 0 && column < COLUMNS && row >= 0 && row < ROWS ? row * COLUMNS + column : -1;
}

// ---------------------------------------------------------------- what the driver knows

static enum status look(struct driver *d, struct pose body)
{
    const double *size = d->rover->how.size_m;
    const struct pose eye = d->view == TRIAL_MAP ? operator_orbit(body, 0, MAP_ELEVATION, MAP_DISTANCE_M)
                                                 : operator_viewpoint(VIEWPOINT_FIRST, body, size);
    const enum status status = simulated_rover_draw(d->rover, eye);
    const struct surround_view *v = &d->rover->surroundings.view;
    memset(d->newest, 0, sizeof d->newest);
    memset(d->shown, 0, sizeof d->shown);
    for (int y = 0; y < v->lens.height && status == OK; y++)
        for (int x = 0; x < v->lens.width; x++) {
            const size_t i = (size_t)y * (size_t)v->lens.width + (size_t)x;
            double world[3];
            if (v->source[i] == SOURCE_UNSEEN || !(v->inverse_z[i] > 0))
                continue;
            surround_view_point(v, x, y, v->inverse_z[i], world);
            const int cell = world[2] < size[2] ? cell_of(world[0], world[1]) : -1;
            if (cell < 0)
                continue;
            d->shown[cell] = true;
            if (world[2] > OBSTACLE_M)
                d->newest[cell] += d->newest[cell] < HITS;
            else
                d->floor[cell] = true;
        }
    for (int i = 0; i < CELLS && status == OK; i++)
        if (d->shown[i]) {
            const int votes = d->votes[i] + (d->newest[i] >= HITS ? 1 : -1);
            d->votes[i] = (int8_t)(votes > VOTES ? VOTES : votes < -VOTES ? -VOTES : votes);
        }
    return status;
}

// Marks the cells about an obstacle.
static void mark_about(bool *cells, int obstacle)
{
    const int reach = (int)(CLEAR_M / CELL_M), side = 2 * reach + 1;
    for (int k = 0; k < side * side; k++) {
        const int dx = k % side - reach, dy = k / side - reach;
        const int column = obstacle % COLUMNS + dx, row = obstacle / COLUMNS + dy;
        if (column >= 0 && column < COLUMNS && row >= 0 && row < ROWS &&
            (dx * dx + dy * dy) * CELL_M * CELL_M < CLEAR_M * CLEAR_M)
            cells[row * COLUMNS + column] = true;
    }
}

static void mark_forbidden(struct driver *d, struct vec3 body, double trusted_m)
{
    memset(d->forbidden, 0, sizeof d->forbidden);
    memset(d->doubted, 0, sizeof d->doubted);
    for (int i = 0; i < CELLS; i++) {
        const double x = LOW_X + (i % COLUMNS + 0.5) * CELL_M - body.x,
                     y = LOW_Y + (i / COLUMNS + 0.5) * CELL_M - body.y;
        if (d->votes[i] > 0)
            mark_about(portable_hypot(x, y) < trusted_m ? d->forbidden : d->doubted, i);
    }
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

static double step_cost(const struct driver *d, int to, int direction)
{
    return (direction < 4 ? 1 : 1.41421356) * CELL_M * (d->floor[to] ? 1 : UNSEEN_COST) *
           (d->doubted[to] ? DOUBTED_COST : 1);
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
            if (to < 0 || d->forbidden[to] || !(d->cost[cell] + step_cost(d, to, k) < d->cost[to]))
                continue;
            d->cost[to] = d->cost[cell] + step_cost(d, to, k);
            rise(d, d->place[to]);
        }
    }
}

// Whether the body can go straight to a cell; *seen: how far over floor that was seen, metres. What is forbidden around
// the beginning, where the body stands, is no hindrance.
static bool straight_to(const struct driver *d, struct vec3 from, int cell, double *seen)
{
    const double x = LOW_X + (cell % COLUMNS + 0.5) * CELL_M - from.x,
                 y = LOW_Y + (cell / COLUMNS + 0.5) * CELL_M - from.y;
    const double length = portable_hypot(x, y);
    bool begun = false, still_seen = true;
    *seen = 0;
    for (double s = 0; s < length; s += CELL_M / 2) {
        const int at = cell_of(from.x + x * s / length, from.y + y * s / length);
        begun |= at >= 0 && !d->forbidden[at];
        if (at < 0 || (begun && (d->forbidden[at] || d->doubted[at])))
            return false;
        still_seen &= d->floor[at] || s < CLEAR_M; // it stands there
        *seen = still_seen ? s : *seen;
    }
    return true;
}

// The farthest cell of the best way that can be gone to straight; -1: there is no way.
static int next_corner(const struct driver *d, struct vec3 from, double *seen)
{
    int at = cell_of(from.x, from.y), best = -1;
    for (int n = 0; at >= 0 && n < CELLS && d->cost[at] > 0; n++) {
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
        if (straight_to(d, from, at, &reach)) {
            best = at;
            *seen = reach;
        } else if (best >= 0) {
            break;
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

// Turns towards the next corner, if need be, and drives straight as far as the floor was seen. NOTHING: no way.
static enum status go_on(struct driver *d, struct pose body, struct trial_result *out)
{
    double seen = 0;
    int corner = -1;
    const int here = cell_of(body.translation.x, body.translation.y);
    double least = 0;
    for (size_t n = 0; n <= COUNT_OF(trust_m) && corner < 0; n++) { // the least trust first, to know the shortest way
        mark_forbidden(d, body.translation, trust_m[n ? n - 1 : COUNT_OF(trust_m) - 1]);
        find_ways(d);
        const double cost = here < 0 ? 0 : d->cost[here];
        if (n && (cost <= DETOUR * least || n == COUNT_OF(trust_m)))
            corner = next_corner(d, body.translation, &seen);
        least = n ? least : cost;
    }
    if (corner < 0)
        return NOTHING;
    const struct vec3 at = v3(LOW_X + (corner % COLUMNS + 0.5) * CELL_M, LOW_Y + (corner / COLUMNS + 0.5) * CELL_M, 0);
    const struct vec3 local = pose_apply(pose_inverse(body), at);
    const double bearing = portable_atan2(local.y, local.x), distance = portable_hypot(local.x, local.y);
    enum status status = OK;
    if (fabs(bearing) > TURN_RAD)
        status = carry_out(d, (struct drive_command){0, bearing > 0 ? TURN_RATE : -TURN_RATE},
                           fabs(bearing) / TURN_RATE, out);
    const double length = fmin(distance, fmax(seen - CLEAR_M, CREEP_M));
    return status == OK ? carry_out(d, (struct drive_command){SPEED, 0}, length / SPEED, out) : status;
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
