#include "capture/tracking/limb_hypotheses.h"

#include "capture/body/two_bone_ik.h"

#define SEARCH_REACH_M 0.12
#define LIMB_MOVE_COST 20 // energy that a limb must gain for each metre a search moves it

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
    struct body_pose pose = body_turned_round(&room->best.shape, &room->best.pose);
    return gain_of(given, &pose, 4, room);
}

struct limb {
    enum segment upper, lower, end;
    int first; // of its three solids
};

enum { LIMB_SOLIDS = 3 };

static const struct limb limb[LIMB_COUNT] = {
    {SEG_LEFT_UPPER_ARM, SEG_LEFT_FOREARM, SEG_LEFT_HAND, 6},
    {SEG_RIGHT_UPPER_ARM, SEG_RIGHT_FOREARM, SEG_RIGHT_HAND, 10},
    {SEG_LEFT_THIGH, SEG_LEFT_SHIN, SEG_LEFT_FOOT, 13},
    {SEG_RIGHT_THIGH, SEG_RIGHT_SHIN, SEG_RIGHT_FOOT, 16},
};

static struct body_pose reach_for(const struct fit_result *from, const struct limb *l, struct vec3 target,
                                  struct vec3 bulge)
{
    struct body_pose pose = from->pose;
    pose.turn[l->end] = (struct quat){0, 0, 0, 1};
    body_reach(&from->shape, &pose, l->upper, target, bulge);
    return pose;
}

struct loose {                       // points that nothing explains, within a limb's reach
    struct vec3 far;                 // the one that is farthest off
    struct vec3 own_far, own_middle; // of those nearer to this limb's root than to its twin's
    int count, own;
};

static struct loose find_loose(const struct body_evidence *e, const struct fit_result *r, const struct limb *l)
{
    struct vec3 base = r->build.origin[l->upper], twin = r->build.origin[body_mirror(l->upper)];
    double reach = 1.25 * (v3_distance(base, r->build.origin[l->lower]) +
                           v3_distance(r->build.origin[l->lower], r->build.origin[l->end])) +
                   0.05;
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

enum { BULGES = 3 };

// Where a limb's middle joint may point: an elbow down, out or back, a knee ahead. Returns how many ways.
static int find_bulges(const struct fit_task *task, const struct fit_result *r, int k, struct vec3 out[BULGES])
{
    const double(*pelvis)[3] = (const double(*)[3])r->build.axes[SEG_PELVIS];
    struct vec3 ahead = v3(pelvis[0][2], pelvis[1][2], pelvis[2][2]);
    if (k >= 2) {
        out[0] = ahead;
        return 1;
    }
    out[0] = v3_scale(task->up, -1);
    out[1] = v3_scale(v3(pelvis[0][0], pelvis[1][0], pelvis[2][0]), k ? -1 : 1);
    out[2] = v3_scale(ahead, -1);
    return 3;
}

static void try_limb(const struct fit_task *task, int k, struct fit_room *room, double *least)
{
    const struct limb *l = &limb[k];
    const struct fit_result *best = &room->best;
    struct loose loose = find_loose(task->evidence, best, l);
    double astray = best->limb_energy[l->upper] + best->limb_energy[l->lower] + best->limb_energy[l->end];
    struct vec3 bulge[BULGES], down = v3_scale(task->up, -1);
    int ways = find_bulges(task, best, k, bulge);
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
    struct vec3 ahead = v3(pelvis[0][2], pelvis[1][2], pelvis[2][2]), left = best->build.origin[SEG_LEFT_FOOT],
                right = best->build.origin[SEG_RIGHT_FOOT];
    struct body_pose one = reach_for(best, &limb[2], right, ahead), other = reach_for(best, &limb[3], left, ahead),
                     pose = best->pose, now = best->pose;
    for (int s = SEG_LEFT_THIGH; s <= SEG_RIGHT_FOOT; s++)
        pose.turn[s] = s <= SEG_LEFT_FOOT ? one.turn[s] : other.turn[s];
    double fresh = best->shape.hem_m > 0 ? gain_of(given, &now, 2, room) : 0;
    return gain_of(given, &pose, 2, room) - fresh;
}

double limb_moved_m(int k, const struct body_build *from, const struct body_build *to)
{
    const struct limb *l = &limb[k];
    return fmax(v3_distance(from->origin[l->lower], to->origin[l->lower]),
                v3_distance(from->origin[l->end], to->origin[l->end]));
}

void limb_copy(int k, const struct body_pose *from, struct body_pose *to)
{
    for (int s = (int)limb[k].upper; s <= (int)limb[k].end; s++)
        to->turn[s] = from->turn[s];
}

// Turns segment s about its own origin to the axes that it has in `from`.
static void turn_alike(const struct body_shape *shape, enum segment s, const struct body_build *from,
                       struct body_pose *to)
{
    struct body_build build;
    double wanted[3][3];
    body_build(shape, to, &build);
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++) {
            wanted[r][c] = 0;
            for (int i = 0; i < 3; i++)
                wanted[r][c] += build.parent_axes[s][i][r] * from->axes[s][i][c];
        }
    to->turn[s] = quat_from_matrix(wanted);
}

void limb_lay(int k, const struct body_shape *shape, const struct body_build *from, struct body_pose *to)
{
    const enum segment chain[3] = {limb[k].upper, limb[k].lower, limb[k].end};
    for (int i = 0; i < 3; i++) {
        turn_alike(shape, chain[i], from, to);
        if (i == 2)
            break;
        struct body_build build;
        body_build(shape, to, &build);
        body_aim(shape, to, chain[i], v3_sub(from->origin[chain[i + 1]], build.origin[chain[i]]));
    }
}

// ---------------------------------------------------------------- a limb elsewhere

enum { TARGETS = 4, KEPT = 2 };

#define APART_M 0.12 // places nearer to each other than this are one, and a fit comes from the one to the other
#define ROUGH   3.0 // a fit takes about this much energy off a place: four of five that a fit makes better are within it

struct place {
    struct body_pose pose;
    double energy;
};

struct limb_task {
    const struct fit_task *task;
    const struct limb *limb;
    const struct fit_result *best;
    struct limb_point point[EVIDENCE_POINTS_MAX]; // within its reach, off every other solid
    int count;
    struct vec3 target[TARGETS]; // for the hand, far from each other
    int targets;
    struct place kept[KEPT];
};

// How far the nearest solid is that is not of this limb.
static double other_distance(const struct fit_result *r, const struct limb *l, int i, struct vec3 p)
{
    if (r->solid[i] < l->first || r->solid[i] >= l->first + LIMB_SOLIDS)
        return (double)r->residual[i];
    double least = 1e9;
    for (int k = 0; k < r->build.solids; k++) {
        struct vec3 normal, on;
        double t, side_m;
        if (k == l->first)
            k += LIMB_SOLIDS;
        if (k == r->build.solids)
            break;
        double d = solid_distance(&r->build.solid[k], p, &normal, &on, &t, &side_m);
        least = fabs(d) < fabs(least) ? d : least;
    }
    return least;
}

// Points for the limb, and of those well off the rest of the body some that are far apart,
// the first the farthest from the limb's root.
static void find_targets(struct limb_task *t)
{
    const struct body_evidence *e = t->task->evidence;
    const struct fit_result *r = t->best;
    struct vec3 base = r->build.origin[t->limb->upper];
    double reach = 1.15 * (v3_distance(base, r->build.origin[t->limb->lower]) +
                           v3_distance(r->build.origin[t->limb->lower], r->build.origin[t->limb->end])) +
                   0.05;
    t->count = t->targets = 0;
    for (int i = 0; i < e->count; i++) {
        struct vec3 p = e->point[i].p;
        if (v3_distance(p, base) > reach)
            continue;
        t->point[t->count] = (struct limb_point){i, other_distance(r, t->limb, i, p)};
        t->count += fabs(t->point[t->count].other_m) > 0.01;
    }
    double near[EVIDENCE_POINTS_MAX]; // of each to the nearest target so far
    for (int i = 0; i < t->count; i++) {
        const struct evidence_point *p = &e->point[t->point[i].index];
        near[i] = t->point[i].other_m > 0.02 + 1 / sqrt(p->weight) ? v3_distance(p->p, base) : 0;
    }
    while (t->targets < TARGETS) {
        int most = -1;
        for (int i = 0; i < t->count; i++)
            if (near[i] > APART_M && (most < 0 || near[i] > near[most]))
                most = i;
        if (most < 0)
            return;
        struct vec3 found = e->point[t->point[most].index].p;
        t->target[t->targets++] = found;
        for (int i = 0; i < t->count; i++)
            near[i] = fmin(near[i], v3_distance(e->point[t->point[i].index].p, found));
    }
}

// Judges a place by the limb's own solids and keeps it if it is one of the likeliest.
static void keep_place(struct limb_task *t, struct vec3 target, struct vec3 bulge)
{
    const struct fit_result *r = t->best;
    struct place place = {reach_for(r, t->limb, target, bulge), 0};
    struct body_build build;
    body_build(&r->shape, &place.pose, &build);
    if (limb_moved_m((int)(t->limb - limb), &r->build, &build) < APART_M)
        return;
    place.energy = body_judge_limb(t->task, &build, t->limb->first, LIMB_SOLIDS, t->point, t->count);
    for (int i = 0; i < KEPT; i++)
        if (place.energy < t->kept[i].energy) {
            struct place other = t->kept[i];
            t->kept[i] = place;
            place = other;
        }
}

double limb_elsewhere_gain(const struct fit_task *given, int k, struct fit_room *room)
{
    struct fit_task task = *given;
    struct limb_task t = {.task = &task, .limb = &limb[k], .best = &room->best};
    task.learn_shape = false;
    task.shape.mean = room->best.shape;
    task.reach_m = SEARCH_REACH_M;
    find_targets(&t);
    struct vec3 bulge[BULGES], base = room->best.build.origin[t.limb->upper];
    int ways = find_bulges(&task, &room->best, k, bulge);
    double upper_m = v3_distance(base, room->best.build.origin[t.limb->lower]);
    double now = body_judge_limb(&task, &room->best.build, t.limb->first, LIMB_SOLIDS, t.point, t.count);
    for (int i = 0; i < KEPT; i++)
        t.kept[i].energy = now + ROUGH;
    for (int i = 0; i < t.targets; i++) {
        for (int b = 0; b < ways; b++)
            keep_place(&t, t.target[i], bulge[b]);
        for (int j = 0; j < t.targets; j++) // or that one is the elbow
            if (i != j && fabs(v3_distance(t.target[j], base) - upper_m) < 0.10)
                keep_place(&t, t.target[i], v3_sub(t.target[j], base));
    }
    if (k < 2) { // or elbow and hand are each taken for the other
        struct vec3 elbow = room->best.build.origin[t.limb->lower], hand = room->best.build.origin[t.limb->end];
        keep_place(&t, elbow, v3_sub(hand, base));
    }
    if (t.kept[0].energy >= now + ROUGH)
        return -1;
    task.iterations = 4;
    task.expected_sigma = 1.5;
    task.expected = room->best.pose;
    struct body_pose pose = room->best.pose;
    body_fit(&task, &pose, &room->trial);
    double least = 1e300, rough = now + ROUGH;
    now = room->trial.energy;
    for (int i = 0; i < KEPT && t.kept[i].energy < rough; i++) {
        task.expected = t.kept[i].pose;
        body_fit(&task, &t.kept[i].pose, &room->trial);
        if (room->trial.energy < least) {
            least = room->trial.energy;
            room->other = room->trial;
        }
    }
    room->trial = room->other;
    return limb_moved_m(k, &room->best.build, &room->trial.build) < APART_M ? -1 : now - least;
}
