#include "capture/tracker_start.h"

#include <stdlib.h>
#include <string.h>

#define SEARCH_REACH_M 0.12
enum { YAWS = 8 };
#define BACK_RATE 2.0
#define LIMB_MOVE_COST 20 // energy that a limb must gain for each metre a search moves it
#define PI 3.14159265358979323846

double explained_share(const struct body_evidence *e, const struct fit_result *r, double within_m)
{
    int good = 0;
    for (int i = 0; i < e->count; i++)
        good += fabs((double)r->residual[i]) < within_m;
    return e->count ? (double)good / e->count : 0;
}

static int compare_doubles(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double rank_of(double *values, int count, double share)
{
    qsort(values, (size_t)count, sizeof *values, compare_doubles);
    int i = (int)(share * (count - 1));
    return values[i];
}

struct start {
    double top, bottom, height; // over the floor or any level
    struct vec3 trunk;          // a point of the trunk's surface, its middle
    bool cut;    // by the picture's lower edge or by something before the legs
    bool beheaded; // by its upper edge
    int halved;  // by its left (-1) or right (1) edge
};

static double level_of(const struct fit_task *task, struct vec3 p) { return v3_dot(task->up, p) + task->floor_m; }

// Rough measures of the person from the points alone.
static bool measure(const struct fit_task *task, struct start *out)
{
    const struct body_evidence *e = task->evidence;
    double level[EVIDENCE_POINTS_MAX], x[EVIDENCE_POINTS_MAX], z[EVIDENCE_POINTS_MAX];
    for (int i = 0; i < e->count; i++)
        level[i] = level_of(task, e->point[i].p);
    out->top = rank_of(level, e->count, 0.995) + 0.01;
    out->bottom = rank_of(level, e->count, 0.005);
    out->cut = e->bottom >= e->picture.bottom - 2 || (task->have_floor && out->bottom > 0.4);
    out->beheaded = e->top <= e->picture.top + 2;
    out->halved = (e->right >= e->picture.right - 2) - (e->left <= e->picture.left + 2);
    out->height = BODY_AVERAGE_HEIGHT_M;
    if (!out->cut && task->have_floor && out->bottom < 0.25)
        out->bottom = 0;
    double tall = out->top - out->bottom;
    if (!out->cut && !out->beheaded && tall > 0.9 && tall < 2.4)
        out->height = tall;
    if (!out->cut && out->beheaded)
        out->top = out->bottom + fmax(tall, out->height);
    int count = 0;
    double low = out->top - 0.5 * out->height, high = out->top - 0.2 * out->height;
    for (int i = 0; i < e->count; i++) {
        double h = level_of(task, e->point[i].p);
        if (h > low && h < high) {
            x[count] = e->point[i].p.x;
            z[count++] = e->point[i].p.z;
        }
    }
    if (count < 8)
        return false;
    out->trunk.x = rank_of(x, count, 0.5);
    out->trunk.z = rank_of(z, count, 0.5);
    return true;
}

static void raise_arms(struct body_pose *pose, double left, double right)
{
    pose->turn[SEG_LEFT_UPPER_ARM] = quat_from_rotation_vector(v3(0, 0, left));
    pose->turn[SEG_RIGHT_UPPER_ARM] = quat_from_rotation_vector(v3(0, 0, -right));
}

// Fits from `pose` and keeps what is likelier than `best`, the energy so far.
static double fit_start(struct fit_task *task, const struct body_pose *pose, struct fit_room *room, double best, bool cut)
{
    task->expected = *pose;
    task->expected_sigma = 8;
    task->iterations = 5;
    task->reach_m = 0.25;
    body_fit(task, pose, &room->trial);
    struct body_pose rough = room->trial.pose;
    task->iterations = 7;
    task->reach_m = 0.10;
    body_fit(task, &rough, &room->trial);
    // Most people face the sensor at the start: the back must fit clearly better,
    // and without feet nothing tells.
    struct vec3 ahead = quat_rotate(room->trial.pose.turn[SEG_PELVIS], v3(0, 0, 1));
    double energy = room->trial.energy * (ahead.z > 0.3 ? cut ? 3 : BACK_RATE : 1);
    if (energy >= best)
        return best;
    room->best = room->trial;
    return energy;
}

bool start_search(struct fit_task *task, struct fit_room *room)
{
    struct start s;
    if (task->evidence->count < 30 || !measure(task, &s))
        return false;
    double scale_log = log(s.height / BODY_AVERAGE_HEIGHT_M);
    task->shape = shape_belief_start();
    task->shape.mean.log[SHAPE_SCALE] = scale_log;
    if (!s.cut && !s.beheaded) // arms up, knees bent and shoes leave some doubt
        task->shape.information[SHAPE_SCALE][SHAPE_SCALE] = 1 / (0.06 * 0.06);
    task->learn_shape = false;
    // The waist joint: 0.571 of the height up, behind the trunk's surface.
    double waist = s.top - 0.429 * s.height - task->floor_m;
    struct vec3 root = v3(s.trunk.x, 0, s.trunk.z + 0.085 * s.height);
    double rise = (waist - v3_dot(task->up, root)) / fmin(task->up.y, -0.3);
    root.y = rise;
    static const double arms[2] = {0.12, 0.9}, away[3] = {0, 0.06, 0.12}; // of the height
    bool middle = s.cut && s.beheaded; // how far up the picture's edge cuts them is not known, either
    double best = 1e300;
    task->every = 3;
    for (int turn = 0; turn < (s.halved ? 1 : YAWS); turn++) // half a person fits any way
        for (int a = 0; a < 2; a++)
            for (int k = 0; k < (s.halved || middle ? 3 : 1); k++) { // and their middle is nearer to the edge, or beyond
                double by = away[k] * s.height;
                struct vec3 at = v3_add(root, v3_add(v3(s.halved * by, 0, 0), v3_scale(task->up, middle ? 2 * by : 0)));
                struct body_pose pose = body_rest_pose(at, task->up, turn * 2 * PI / YAWS);
                raise_arms(&pose, arms[a], arms[a]);
                best = fit_start(task, &pose, room, best, s.cut);
            }
    task->every = 1;
    task->expected = room->best.pose;
    task->expected_sigma = 4;
    task->iterations = 5;
    task->reach_m = 0.10;
    for (int round = 0; round < 2; round++)
        limbs_search(task, room);
    task->learn_shape = true;
    task->learn_rate = 0.3;
    task->iterations = 10;
    struct body_pose pose = room->best.pose;
    body_fit(task, &pose, &room->trial);
    room->best = room->trial;
    task->reach_m = 0.06;
    pose = room->best.pose;
    task->shape.mean = room->best.shape;
    body_fit(task, &pose, &room->trial);
    room->best = room->trial;
    return explained_share(task->evidence, &room->best, 0.10) > 0.6;
}

// By how much less energy a fit from `pose` ends with than the pose that is now the best has.
static double gain_of(const struct fit_task *given, const struct body_pose *pose, double expected_sigma,
                      struct fit_room *room)
{
    struct fit_task task = *given;
    struct body_pose now = room->best.pose;
    struct body_shape shape = room->best.shape;
    task.learn_shape = false;
    task.shape.mean = shape;
    task.reach_m = SEARCH_REACH_M;
    task.expected = *pose;
    task.expected_sigma = expected_sigma;
    task.iterations = 5;
    task.every = 2;
    body_judge(&task, &now, &shape, &room->trial);
    double energy = room->trial.energy;
    body_fit(&task, pose, &room->trial);
    return energy - room->trial.energy;
}

double turned_round_gain(const struct fit_task *given, struct fit_room *room)
{
    struct body_pose pose = body_turned_round(&room->best.pose);
    return gain_of(given, &pose, 4, room);
}

// ---------------------------------------------------------------- limbs

struct limb {
    enum segment upper, lower, end;
};

static const struct limb limb[4] = {
    {SEG_LEFT_UPPER_ARM, SEG_LEFT_FOREARM, SEG_LEFT_HAND},
    {SEG_RIGHT_UPPER_ARM, SEG_RIGHT_FOREARM, SEG_RIGHT_HAND},
    {SEG_LEFT_THIGH, SEG_LEFT_SHIN, SEG_LEFT_FOOT},
    {SEG_RIGHT_THIGH, SEG_RIGHT_SHIN, SEG_RIGHT_FOOT},
};

static struct vec3 into(double m[3][3], struct vec3 v) // camera to segment axes
{
    return v3(m[0][0] * v.x + m[1][0] * v.y + m[2][0] * v.z, m[0][1] * v.x + m[1][1] * v.y + m[2][1] * v.z,
              m[0][2] * v.x + m[1][2] * v.y + m[2][2] * v.z);
}

// Turns `segment` so that it runs along `direction` (camera axes), with as little twist as can be.
static void aim(const struct body_shape *shape, struct body_pose *pose, enum segment segment, struct vec3 direction)
{
    struct body_build build;
    body_build(shape, pose, &build);
    struct vec3 now = quat_rotate(pose->turn[segment], v3(0, -1, 0)),
                wanted = v3_unit(into(build.parent_axes[segment], direction));
    pose->turn[segment] = quat_unit(quat_multiply(quat_between(now, wanted), pose->turn[segment]));
}

// Bends a limb so that its end reaches `target`, its middle joint bulging to `bulge`.
static struct body_pose reach_for(const struct fit_result *from, const struct limb *l, struct vec3 target, struct vec3 bulge)
{
    struct body_pose pose = from->pose;
    struct vec3 base = from->build.origin[l->upper], way = v3_sub(target, base), along = v3_unit(way);
    double a = v3_distance(base, from->build.origin[l->lower]),
           b = v3_distance(from->build.origin[l->lower], from->build.origin[l->end]), d = v3_length(way);
    d = fmin(fmax(d, fabs(a - b) + 0.02), a + b - 0.005);
    double at = (a * a - b * b + d * d) / (2 * d), high = sqrt(fmax(0, a * a - at * at));
    struct vec3 off = v3_unit(v3_sub(bulge, v3_scale(along, v3_dot(bulge, along))));
    struct vec3 upper = v3_add(v3_scale(along, at), v3_scale(off, high));
    pose.turn[l->end] = (struct quat){0, 0, 0, 1};
    aim(&from->shape, &pose, l->upper, upper);
    aim(&from->shape, &pose, l->lower, v3_sub(v3_scale(along, d), upper));
    return pose;
}

struct loose { // points that nothing explains, within a limb's reach
    struct vec3 far; // the one that is farthest off
    struct vec3 own_far, own_middle; // of those nearer to this limb's root than to its twin's
    int count, own;
};

static struct loose find_loose(const struct body_evidence *e, const struct fit_result *r, const struct limb *l)
{
    struct vec3 base = r->build.origin[l->upper], twin = r->build.origin[body_mirror(l->upper)];
    double reach = 1.25 * (v3_distance(base, r->build.origin[l->lower]) +
                           v3_distance(r->build.origin[l->lower], r->build.origin[l->end])) + 0.05;
    struct loose out = {.far = base, .own_far = base};
    for (int i = 0; i < e->count; i++) {
        struct vec3 p = e->point[i].p;
        double sigma = 1 / sqrt(e->point[i].weight), d = v3_distance(p, base);
        if ((double)r->residual[i] < 0.04 + 1.5 * sigma || d > reach)
            continue;
        out.count++;
        if (d > v3_distance(out.far, base))
            out.far = p;
        if (d > v3_distance(p, twin))
            continue;
        out.own++;
        out.own_middle = v3_add(out.own_middle, p);
        if (d > v3_distance(out.own_far, base))
            out.own_far = p;
    }
    if (out.own)
        out.own_middle = v3_scale(out.own_middle, 1.0 / out.own);
    return out;
}

// Keeps in room->other the likeliest of the places tried so far for one limb. A limb that was
// followed so far is not given up for a slightly better place.
static void try_pose(const struct fit_task *task, const struct body_pose *pose, struct fit_room *room, double *least)
{
    struct fit_task quick = *task;
    quick.learn_shape = false;
    quick.shape.mean = room->best.shape;
    quick.iterations = 4;
    quick.expected = *pose;
    quick.expected_sigma = 1.5;
    body_fit(&quick, pose, &room->trial);
    double far = 0;
    for (int j = 0; j < JOINT_COUNT; j++)
        far = fmax(far, v3_distance(room->trial.build.joint[j], room->best.build.joint[j]));
    double energy = room->trial.energy + LIMB_MOVE_COST * far;
    if (energy >= *least)
        return;
    *least = energy;
    room->other = room->trial;
}

static void try_limb(const struct fit_task *task, int k, struct fit_room *room, double *least)
{
    const struct limb *l = &limb[k];
    const struct fit_result *best = &room->best;
    struct loose loose = find_loose(task->evidence, best, l);
    double astray = best->limb_energy[l->upper] + best->limb_energy[l->lower] + best->limb_energy[l->end];
    double(*pelvis)[3] = room->best.build.axes[SEG_PELVIS];
    struct vec3 ahead = v3(pelvis[0][2], pelvis[1][2], pelvis[2][2]),
                out = v3_scale(v3(pelvis[0][0], pelvis[1][0], pelvis[2][0]), k % 2 ? -1 : 1), down = v3_scale(task->up, -1);
    struct vec3 arm[3] = {down, out, v3_scale(ahead, -1)}, leg[1] = {ahead}, *bulge = k < 2 ? arm : leg;
    int ways = k < 2 ? 3 : 1;
    if (loose.count > 0.008 * task->evidence->count && loose.count >= 5) {
        struct body_pose pose = reach_for(best, l, loose.far, bulge[0]);
        try_pose(task, &pose, room, least);
        for (int b = 0; loose.own >= 3 && b < ways; b++) {
            pose = reach_for(best, l, loose.own_far, bulge[b]);
            try_pose(task, &pose, room, least);
            pose = reach_for(best, l, loose.own_middle, bulge[b]);
            try_pose(task, &pose, room, least);
        }
    }
    if (astray < 6)
        return;
    struct body_pose pose = best->pose; // hanging
    pose.turn[l->upper] = pose.turn[l->lower] = pose.turn[l->end] = (struct quat){0, 0, 0, 1};
    try_pose(task, &pose, room, least);
    struct vec3 base = best->build.origin[l->upper]; // hidden behind the trunk
    pose = reach_for(best, l, v3_add(base, v3_add(v3_scale(down, 0.3), v3(0, 0, 0.2))), down);
    try_pose(task, &pose, room, least);
}

int limbs_search(const struct fit_task *given, struct fit_room *room)
{
    // Points that nothing explains must weigh, or a limb beside them is as good as one on them.
    struct fit_task wide = *given;
    wide.reach_m = SEARCH_REACH_M;
    struct body_pose now = room->best.pose;
    struct body_shape shape = room->best.shape;
    body_judge(&wide, &now, &shape, &room->best);
    int moved = 0;
    for (; moved < 2; moved++) { // the limb that gains most, or another one takes its points
        double least = 0.97 * room->best.energy - 0.5, enough = least;
        for (int k = 0; k < 4; k++)
            try_limb(&wide, k, room, &least);
        if (least >= enough)
            break;
        room->best = room->other;
    }
    return moved;
}

double legs_swapped_gain(const struct fit_task *given, struct fit_room *room)
{
    struct fit_result *best = &room->best;
    double(*pelvis)[3] = best->build.axes[SEG_PELVIS];
    struct vec3 ahead = v3(pelvis[0][2], pelvis[1][2], pelvis[2][2]),
                left = best->build.origin[SEG_LEFT_FOOT], right = best->build.origin[SEG_RIGHT_FOOT];
    struct body_pose one = reach_for(best, &limb[2], right, ahead), other = reach_for(best, &limb[3], left, ahead),
                     pose = best->pose;
    for (int s = SEG_LEFT_THIGH; s <= SEG_RIGHT_FOOT; s++)
        pose.turn[s] = s <= SEG_LEFT_FOOT ? one.turn[s] : other.turn[s];
    return gain_of(given, &pose, 2, room);
}
