#include "tests/support/dice_place.h"

#include <string.h>

// Each check looks at one frame in so many.
enum { TRIES = 60, EACH = 3 };

static const double PI = 3.14159265358979323846;

// What the places are checked by.
struct view {
    struct lens lens;
    struct pose camera_from_world;
    struct vec3 eye, ahead, right; // world; ahead and right of unit length and level
};

static struct view view_of(const struct dice_plan *plan)
{
    const struct world_stand *s = &plan->stand;
    struct view v = {.lens = world_calibration(plan->scale).depth, .eye = s->eye};
    v.ahead = v3_unit(v3(s->target.x - s->eye.x, s->target.y - s->eye.y, 0));
    v.right = v3(v.ahead.y, -v.ahead.x, 0);
    v.camera_from_world = pose_inverse(world_stand_pose(s));
    return v;
}

bool dice_in_image(const struct lens *lens, struct vec3 p)
{
    if (!(p.z > 0.1))
        return false;
    const struct pixel px = lens_project(lens, p);
    return px.x > -0.5 && px.y > -0.5 && px.x < lens->width - 0.5 && px.y < lens->height - 0.5;
}

double dice_facing_degrees(const struct skeleton *s)
{
    const struct vec3 *at = s->joint;
    const struct vec3 left = v3_add(v3_sub(at[JOINT_LEFT_SHOULDER], at[JOINT_RIGHT_SHOULDER]),
                                    v3_sub(at[JOINT_LEFT_HIP], at[JOINT_RIGHT_HIP]));
    // The front, left x up, and the way to the camera, both level: y points down.
    const struct vec3 front = v3(left.z, 0, -left.x), way = v3(-at[JOINT_WAIST].x, 0, -at[JOINT_WAIST].z);
    return atan2(way.z * front.x - way.x * front.z, v3_dot(way, front)) * 180 / PI;
}

enum status dice_preview(const struct dice_plan *plan, const struct dice_actor *actor, struct skeleton *out)
{
    const struct world_options options = dice_world_options(plan, actor);
    return world_preview_joints(&options, actor->start_s, DICE_HZ, plan->frames, out);
}

// ---------------------------------------------------------------- moving the joints of a scene

static struct pose room_from_motion(const struct world_spot *spot)
{
    return (struct pose){quat_from_rotation_vector(v3(0, 0, spot->turned)), v3(spot->x, spot->y, 0)};
}

// The share of the joints that are inside the image, placed by `move`.
static double share_in_image(const struct view *v, const struct skeleton *s, struct pose move)
{
    int in = 0;
    const struct pose camera_from_motion = pose_multiply(v->camera_from_world, move);
    for (int j = 0; j < JOINT_COUNT; j++)
        in += dice_in_image(&v->lens, pose_apply(camera_from_motion, s->joint[j]));
    return (double)in / JOINT_COUNT;
}

static bool stays_in_room(const struct skeleton *at, int frames, struct pose move, double most_x)
{
    for (int k = 0; k < frames; k += EACH)
        for (int j = 0; j < JOINT_COUNT; j++) {
            const struct vec3 p = pose_apply(move, at[k].joint[j]);
            // Between the furniture at the walls; the sensor stands at y = -3.1.
            if (!(fabs(p.x) < most_x && p.y > -2.7 && p.y < 2.7))
                return false;
        }
    return true;
}

// The spot that puts the waist of `s` at a level distance and bearing (tangent, to the right) from the sensor, facing
// `facing` radians away from it.
static struct world_spot spot_at(const struct view *v, const struct skeleton *s, double distance_m, double bearing,
                                 double facing)
{
    const struct vec3 *at = s->joint;
    const struct vec3 way = v3_unit(v3_add(v->ahead, v3_scale(v->right, bearing)));
    const struct vec3 to = v3_add(v->eye, v3_scale(way, distance_m));
    const struct vec3 left = v3_add(v3_sub(at[JOINT_LEFT_SHOULDER], at[JOINT_RIGHT_SHOULDER]),
                                    v3_sub(at[JOINT_LEFT_HIP], at[JOINT_RIGHT_HIP]));
    const double front = atan2(-left.x, left.y); // of left x up
    struct world_spot spot = {0, 0, atan2(-way.y, -way.x) + facing - front};
    const struct vec3 waist = pose_apply(room_from_motion(&spot), at[JOINT_WAIST]);
    spot.x = to.x - waist.x;
    spot.y = to.y - waist.y;
    return spot;
}

// The world's options refuse other spots.
static bool is_allowed(const struct world_spot *spot) { return fabs(spot->x) < 3.2 && fabs(spot->y) < 3.5; }

static void move_joints(struct skeleton *at, int frames, struct pose move)
{
    for (int k = 0; k < frames; k++)
        at[k] = skeleton_transform(move, &at[k]);
}

// ---------------------------------------------------------------- the actor

static bool comes_true(const struct view *v, const struct dice_plan *plan, const struct skeleton *at, struct pose move)
{
    const int last = plan->frames - 1;
    double sum = 0, least = 1;
    int count = 0;
    for (int k = 0; k <= last; k += EACH, count++) {
        const double in = share_in_image(v, &at[k], move);
        sum += in;
        least = fmin(least, in);
    }
    const double mean = sum / count, first_in = share_in_image(v, &at[0], move),
                 last_in = share_in_image(v, &at[last], move);
    switch (plan->situation) {
    case DICE_ENTERS: return first_in < 0.2 && last_in > 0.9;
    case DICE_LEAVES: return first_in > 0.9 && last_in < 0.2;
    case DICE_CUT_SIDE: return mean > 0.5 && mean < 0.8;
    case DICE_CUT_BELOW: return mean > 0.5 && mean < 0.85;
    default: return mean > 0.98 && least > 0.8;
    }
}

enum status dice_place_actor(struct rng *rng, struct dice_plan *plan, struct dice_scene *scene)
{
    const struct view v = view_of(plan);
    const bool walks = plan->situation == DICE_ENTERS || plan->situation == DICE_LEAVES;
    const int anchor = plan->situation == DICE_ENTERS   ? plan->frames - 1
                       : plan->situation == DICE_LEAVES ? 0
                                                        : plan->frames / 2;
    const double edge = 0.5 * v.lens.width / v.lens.fx; // the bearing of the image's edge
    for (int i = 0; i < TRIES; i++) {
        double far_m = plan->situation == DICE_CUT_BELOW ? 2 : 4.5, side = rng_uniform(rng) < 0.5 ? -1 : 1;
        double distance_m = rng_between(rng, 1.2, far_m), bearing = rng_between(rng, 0, 0.95) * side * edge;
        double facing = rng_between(rng, -PI, PI);
        if (plan->situation == DICE_CUT_SIDE)
            bearing = rng_between(rng, 0.85, 1.15) * side * edge;
        const struct world_spot spot = spot_at(&v, &scene->actor[anchor], distance_m, bearing, facing);
        const struct pose move = room_from_motion(&spot);
        if (is_allowed(&spot) && stays_in_room(scene->actor, plan->frames, move, walks ? 3.1 : 2.5) &&
            comes_true(&v, plan, scene->actor, move)) {
            plan->actor.spot = spot;
            move_joints(scene->actor, plan->frames, move);
            return OK;
        }
    }
    return NOTHING;
}

// ---------------------------------------------------------------- furniture

static void add_box(struct dice_plan *plan, struct vec3 low, struct vec3 high)
{
    assert(plan->boxes < WORLD_BOXES);
    plan->box[plan->boxes++] = (struct world_box){low, high};
}

static void add_table(struct dice_plan *plan, struct vec3 low, struct vec3 high)
{
    const double leg = 0.05, plate = 0.04;
    add_box(plan, v3(low.x, low.y, high.z - plate), high);
    for (int i = 0; i < 4; i++) {
        const struct vec3 foot = v3(i & 1 ? high.x - leg : low.x, i & 2 ? high.y - leg : low.y, 0);
        add_box(plan, foot, v3(foot.x + leg, foot.y + leg, high.z - plate));
    }
}

// Whether a box stands between two points (slabs).
static bool stands_between(const struct world_box *b, struct vec3 from, struct vec3 to)
{
    const double o[3] = {from.x, from.y, from.z}, d[3] = {to.x - from.x, to.y - from.y, to.z - from.z};
    const double low[3] = {b->low.x, b->low.y, b->low.z}, high[3] = {b->high.x, b->high.y, b->high.z};
    double enter = 0, leave = 1;
    for (int i = 0; i < 3; i++) {
        if (fabs(d[i]) < 1e-9) {
            if (o[i] < low[i] || o[i] > high[i])
                return false;
            continue;
        }
        const double a = (low[i] - o[i]) / d[i], c = (high[i] - o[i]) / d[i];
        enter = fmax(enter, fmin(a, c));
        leave = fmin(leave, fmax(a, c));
    }
    return enter < leave;
}

static double share_hidden(const struct dice_plan *plan, const struct skeleton *at)
{
    int hidden = 0, all = 0;
    for (int k = 0; k < plan->frames; k += EACH)
        for (int j = 0; j < JOINT_COUNT; j++, all++)
            for (int b = 0; b < plan->boxes; b++)
                if (stands_between(&plan->box[b], plan->stand.eye, at[k].joint[j])) {
                    hidden++;
                    break;
                }
    return (double)hidden / all;
}

enum status dice_place_furniture(struct rng *rng, struct dice_plan *plan, struct dice_scene *scene)
{
    enum { TABLE, CHEST, POST, KINDS };
    static const struct {
        struct vec3 least, most; // its sides: across, towards the sensor, up
    } size[KINDS] = {
        [TABLE] = {{1.0, 0.6, 0.68}, {1.7, 0.8, 0.80}},
        [CHEST] = {{0.6, 0.35, 0.40}, {1.6, 0.5, 1.00}},
        [POST] = {{0.15, 0.1, 1.50}, {0.45, 0.3, 2.30}},
    };
    const struct vec3 eye = plan->stand.eye;
    double front_y = 1e9; // of the joints, nearest to the sensor
    for (int k = 0; k < plan->frames; k++)
        for (int j = 0; j < JOINT_COUNT; j++)
            front_y = fmin(front_y, scene->actor[k].joint[j].y);
    for (int i = 0; i < TRIES; i++) {
        const int kind = (int)(rng_uniform(rng) * KINDS);
        const double x = rng_between(rng, size[kind].least.x, size[kind].most.x);
        const double y = rng_between(rng, size[kind].least.y, size[kind].most.y);
        const double z = rng_between(rng, size[kind].least.z, size[kind].most.z);
        const double gap_m = rng_between(rng, 0.25, 0.6), aside_m = rng_between(rng, -0.35, 0.35);
        const struct vec3 waist = scene->actor[(int)(rng_uniform(rng) * plan->frames)].joint[JOINT_WAIST];
        const double high_y = front_y - gap_m, low_y = high_y - y;
        const double middle_x = eye.x + (waist.x - eye.x) * (high_y - y / 2 - eye.y) / (waist.y - eye.y) + aside_m;
        const struct vec3 low = v3(middle_x - x / 2, low_y, 0), high = v3(middle_x + x / 2, high_y, z);
        if (low_y < eye.y + 0.6 || fabs(low.x) > 3.2 || fabs(high.x) > 3.2)
            continue;
        plan->boxes = 0;
        if (kind == TABLE)
            add_table(plan, low, high);
        else
            add_box(plan, low, high);
        const double hidden = share_hidden(plan, scene->actor);
        if (hidden > 0.05 && hidden < 0.6)
            return OK;
    }
    plan->boxes = 0;
    return NOTHING;
}

// ---------------------------------------------------------------- a second person

// Whether the passer-by crosses the line of sight to the actor, in front of or behind, and keeps off from both.
static bool crosses(const struct view *v, const struct dice_plan *plan, const struct dice_scene *scene,
                    struct pose move, bool front)
{
    double closest_px = 1e9;
    bool right_side = false;
    for (int k = 0; k < plan->frames; k += EACH) {
        const struct vec3 other = pose_apply(move, scene->passerby[k].joint[JOINT_WAIST]);
        const struct vec3 own = scene->actor[k].joint[JOINT_WAIST];
        if (hypot(other.x - own.x, other.y - own.y) < 0.65 || hypot(other.x - v->eye.x, other.y - v->eye.y) < 1.2)
            return false;
        const struct vec3 a = pose_apply(v->camera_from_world, own), b = pose_apply(v->camera_from_world, other);
        if (!dice_in_image(&v->lens, a) || !dice_in_image(&v->lens, b))
            continue;
        const double apart_px = fabs(lens_project(&v->lens, a).x - lens_project(&v->lens, b).x);
        if (apart_px < closest_px) {
            closest_px = apart_px;
            right_side = (b.z < a.z) == front;
        }
    }
    return right_side && closest_px < 0.1 * v->lens.width;
}

enum status dice_place_passerby(struct rng *rng, struct dice_plan *plan, struct dice_scene *scene)
{
    const struct view v = view_of(plan);
    const double edge = 0.5 * v.lens.width / v.lens.fx;
    const bool front = rng_uniform(rng) < 0.5;
    for (int i = 0; i < TRIES; i++) {
        const double distance_m = rng_between(rng, 1.2, 5), bearing = rng_between(rng, -1, 1) * edge;
        const double facing = rng_between(rng, -PI, PI);
        const struct world_spot spot = spot_at(&v, &scene->passerby[plan->frames / 2], distance_m, bearing, facing);
        const struct pose move = room_from_motion(&spot);
        if (is_allowed(&spot) && stays_in_room(scene->passerby, plan->frames, move, 3.1) &&
            share_in_image(&v, &scene->passerby[0], move) < 0.2 && crosses(&v, plan, scene, move, front)) {
            plan->passerby.spot = spot;
            move_joints(scene->passerby, plan->frames, move);
            return OK;
        }
    }
    return NOTHING;
}
