#include "tests/world/numbers.h"
#include "tests/world/world_internal.h"

#include <stdlib.h>
#include <string.h>

static const struct {
    const char *name;
    struct world_figure figure;
} figures[] = {
    {"woman", {1.70, 0.35, true, CLOTHES_TROUSERS, 0, 7}},  {"man", {1.82, 0.45, false, CLOTHES_TROUSERS, 1, 23}},
    {"child", {1.25, 0.40, false, CLOTHES_TROUSERS, 2, 4}}, {"heavy", {1.75, 1.00, false, CLOTHES_TROUSERS, 3, 58}},
    {"skirt", {1.65, 0.30, true, CLOTHES_SKIRT, 4, 12}},    {"coat", {1.78, 0.40, true, CLOTHES_COAT, 3, 31}},
    {"tall", {1.95, 0.15, false, CLOTHES_TROUSERS, 4, 90}},
};

bool world_figure_named(const char *name, struct world_figure *out)
{
    for (size_t i = 0; i < COUNT_OF(figures); i++)
        if (!strcmp(figures[i].name, name)) {
            *out = figures[i].figure;
            return true;
        }
    return false;
}

const char *world_figure_names(void) { return "woman man child heavy skirt coat tall"; }

const char *world_motion_names(void) { return "pirouette kata still bend walk hide visit exercise exercise-wrong"; }

struct world_options world_default_options(void)
{
    return (struct world_options){
        .figure = figures[0].figure,
        .motion = "pirouette",
        .seed = 1,
        .threads = 1,
        .tags = (1u << TAG_COUNT) - 1,
        .stand = {{0.1, -3.1, 1.15}, {0.02, 0, 1.0}, 0.004},
        .walk = {2.42, 6.4}, // a little more than once round, so that the ends overlap
    };
}

static bool is_in_room(double x, double y) { return fabs(x) < ROOM_HALF_X && fabs(y) < ROOM_HALF_Y; }

static enum status check_where(const struct world_options *o)
{
    const struct vec3 eye = o->stand.eye, target = o->stand.target;
    if (!is_in_room(o->spot.x, o->spot.y) || !isfinite(o->spot.turned))
        return fail(ERR_INPUT, "the figure would be at (%g, %g), outside the room", o->spot.x, o->spot.y);
    if (!is_in_room(eye.x, eye.y) || !(eye.z > 0 && eye.z < ROOM_HEIGHT) || !isfinite(o->stand.roll))
        return fail(ERR_INPUT, "the sensor would stand at (%g, %g, %g), outside the room", eye.x, eye.y, eye.z);
    if (!(hypot(target.x - eye.x, target.y - eye.y) > 0.01) || !isfinite(target.z))
        return fail(ERR_INPUT, "the sensor would look straight up or down");
    if (!(o->walk.distance_m > 0.3 && o->walk.distance_m < 10) || !(fabs(o->walk.round) < 1000))
        return fail(ERR_INPUT, "the walk would be %g radians round, %g m away", o->walk.round, o->walk.distance_m);
    if (o->boxes < 0 || o->boxes > WORLD_BOXES)
        return fail(ERR_INPUT, "%d boxes; take 0 to %d", o->boxes, WORLD_BOXES);
    for (int i = 0; i < o->boxes; i++) {
        const struct vec3 a = o->box[i].low, b = o->box[i].high;
        if (!is_in_room(a.x, a.y) || !is_in_room(b.x, b.y) || !(a.z >= 0 && b.z < ROOM_HEIGHT) ||
            !(a.x < b.x && a.y < b.y && a.z < b.z))
            return fail(ERR_INPUT, "box %d is outside the room or empty", i);
    }
    return OK;
}

static enum status check(const struct world_options *o)
{
    const struct world_figure *f = &o->figure;
    if (!(f->height_m >= 1.2 && f->height_m <= 1.95))
        return fail(ERR_INPUT, "the figure is %g m tall; take 1.2 to 1.95", f->height_m);
    if (!(f->build >= 0 && f->build <= 1))
        return fail(ERR_INPUT, "the figure's build is %g; take 0 (thin) to 1 (heavy)", f->build);
    if (f->palette < 0 || f->palette > 4 || f->number < 0 || f->number > 99 || (int)f->clothes < CLOTHES_TROUSERS ||
        f->clothes > CLOTHES_COAT)
        return fail(ERR_INPUT, "the figure's clothes %d, palette %d or number %d are not ones there are",
                    (int)f->clothes, f->palette, f->number);
    if (!o->motion)
        return fail(ERR_INPUT, "the figure has no motion; take \"still\" to have it stand");
    if (o->threads < 1 || o->threads > 16)
        return fail(ERR_INPUT, "%d threads; take 1 to 16", o->threads);
    return check_where(o);
}

static enum status check_edit(const struct world_edit *e, const struct figure_motion *motion)
{
    if (!e)
        return OK;
    const double seconds = motion_seconds(motion);
    if (!(e->start_s >= 0 && e->seconds > 0 && e->start_s + e->seconds <= seconds + 1e-9))
        return fail(ERR_INPUT, "%g s from %g s on are not within the motion's %g s", e->seconds, e->start_s, seconds);
    if (!isfinite(e->amount) || !(e->from_s >= 0 && e->from_s <= e->to_s && e->to_s <= e->seconds))
        return fail(ERR_INPUT, "what is performed otherwise from %g s to %g s is not within the %g s of the stretch",
                    e->from_s, e->to_s, e->seconds);
    return OK;
}

enum status world_open(struct world **out, const struct world_options *options)
{
    *out = NULL;
    enum status status = check(options);
    if (status)
        return status;
    struct world *w = calloc(1, sizeof *w);
    if (!w)
        return fail(ERR_MEMORY, "out of memory for a world");
    w->options = *options;
    w->options.motion = NULL; // the caller's
    w->options.edit = NULL;
    w->edited = options->edit;
    w->edit = options->edit ? *options->edit : w->edit;
    w->physique = physique_of(&options->figure);
    status = world_motion_open(&w->motion, options->motion, &w->physique, options->whole);
    if (!status)
        status = check_edit(options->edit, w->motion);
    if (!status)
        status = scene_build(&w->scene, options);
    if (!status)
        status = figure_build(&w->figure, &w->physique, options->plain);
    if (!status && !(w->views = still_views_open()))
        status = fail(ERR_MEMORY, "out of memory for a world");
    if (status)
        world_close(&w);
    *out = w;
    return status;
}

void world_close(struct world **w)
{
    if (*w) {
        world_motion_close(&(*w)->motion);
        scene_free(&(*w)->scene);
        figure_free(&(*w)->figure);
        still_views_close((*w)->views);
        free(*w);
        *w = NULL;
    }
}

static double performed_seconds(const struct world_edit *e, const struct figure_motion *motion)
{
    return e ? world_edit_seconds(e) : motion_seconds(motion);
}

double world_seconds(const struct world *w) { return performed_seconds(w->edited ? &w->edit : NULL, w->motion); }

// Moved to the spot, and rotated there.
static struct stance positioned(struct stance s, const struct world_spot *spot)
{
    const struct quat rotation = quat_from_rotation_vector(v3(0, 0, spot->turned));
    const struct pose room_from_motion = {rotation, v3(spot->x, spot->y, 0)};
    s.waist = pose_apply(room_from_motion, s.waist);
    s.pelvis = quat_multiply(rotation, s.pelvis);
    s.chest = quat_multiply(rotation, s.chest);
    s.head = quat_multiply(rotation, s.head);
    for (int side = LEFT; side <= RIGHT; side++) {
        s.upper_arm[side] = quat_rotate(rotation, s.upper_arm[side]);
        s.forearm[side] = quat_rotate(rotation, s.forearm[side]);
        s.ankle[side] = pose_apply(room_from_motion, s.ankle[side]);
        s.foot[side] = quat_multiply(rotation, s.foot[side]);
        s.knee[side] = quat_rotate(rotation, s.knee[side]);
    }
    return s;
}

static struct stance performed(const struct world_edit *e, const struct figure_motion *motion, const struct physique *p,
                               double time_s)
{
    return e ? world_edit_at(e, motion, p, time_s) : world_motion_at(motion, p, time_s);
}

struct stance world_stance(const struct world *w, double time_s)
{
    return positioned(performed(w->edited ? &w->edit : NULL, w->motion, &w->physique, time_s), &w->options.spot);
}

enum status world_preview_seconds(const struct world_options *options, double *seconds)
{
    *seconds = 0;
    enum status status = check(options);
    struct figure_motion *motion = NULL;
    const struct physique physique = physique_of(&options->figure);
    if (status == OK)
        status = world_motion_open(&motion, options->motion, &physique, options->whole);
    if (status == OK)
        status = check_edit(options->edit, motion);
    if (status == OK)
        *seconds = performed_seconds(options->edit, motion);
    world_motion_close(&motion);
    return status;
}

enum status world_preview_joints(const struct world_options *options, double start_s, double rate_hz, int count,
                                 struct skeleton *out)
{
    enum status status = check(options);
    struct figure_motion *motion = NULL;
    const struct physique physique = physique_of(&options->figure);
    if (status == OK)
        status = world_motion_open(&motion, options->motion, &physique, options->whole);
    if (status == OK)
        status = check_edit(options->edit, motion);
    for (int k = 0; k < count && status == OK; k++) {
        const struct stance stance =
            positioned(performed(options->edit, motion, &physique, start_s + k / rate_hz), &options->spot);
        struct posed posed;
        physique_pose(&physique, &stance, &posed);
        out[k] = posed.joints;
    }
    world_motion_close(&motion);
    return status;
}

struct skeleton world_joints(const struct world *w, double time_s)
{
    struct stance stance = world_stance(w, time_s);
    struct posed posed;
    physique_pose(&w->physique, &stance, &posed);
    return posed.joints;
}

struct skeleton world_joints_in_camera(const struct world *w, double time_s, struct pose world_from_camera)
{
    struct skeleton s = world_joints(w, time_s);
    return skeleton_transform(pose_inverse(world_from_camera), &s);
}

double world_joint_radius(const struct world *w, enum joint j)
{
    assert((int)j >= 0 && j < JOINT_COUNT);
    return w->figure.joint_radius[j];
}

const struct place_tag *world_tags(const struct world *w, int32_t *count)
{
    *count = w->scene.tag_count;
    return w->scene.tags;
}

// ---------------------------------------------------------------- cameras

static struct lens lens_scaled(struct lens l, double s)
{
    struct lens out = l;
    out.width = (int)lround(l.width * s);
    out.height = (int)lround(l.height * s);
    double sx = (double)out.width / l.width, sy = (double)out.height / l.height;
    out.fx *= sx;
    out.fy *= sy;
    out.cx = (l.cx + 0.5) * sx - 0.5; // pixel centres are whole numbers
    out.cy = (l.cy + 0.5) * sy - 0.5;
    return out;
}

struct calibration world_calibration(double scale)
{
    struct lens l = lens_scaled((struct lens){640, 480, 525, 525, 319.5, 239.5, 0, 0, 0, 0, 0, 0, 0}, scale);
    return (struct calibration){l, l, true, POSE_IDENTITY};
}

struct calibration world_viewer_calibration(double scale)
{
    struct lens l =
        lens_scaled((struct lens){640, 480, 545, 545.5, 322.5, 238, -0.05, 0.015, 0.0005, -0.0004, 0, 0, 0}, scale);
    return (struct calibration){.color = l, .color_from_depth = POSE_IDENTITY};
}

// From `eye`, towards `target`, upright but for `roll`.
static struct pose look_at(struct vec3 eye, struct vec3 target, double roll)
{
    struct vec3 z = v3_unit(v3_sub(target, eye)), x = v3_unit(v3_cross(z, v3(0, 0, 1))), y = v3_cross(z, x);
    double m[3][3] = {{x.x, y.x, z.x}, {x.y, y.y, z.y}, {x.z, y.z, z.z}};
    struct quat q = quat_multiply(quat_from_matrix(m), quat_from_rotation_vector(v3(0, 0, roll)));
    return (struct pose){q, eye};
}

// The slow shake of a hand-held camera: about -1..1, smooth.
static double camera_shake(double t, uint32_t seed)
{
    return (double)(fractal2((float)(t * 1.3), 0.5f, 3, seed) - 0.5f) * 2;
}

static uint32_t seed_of(const struct world *w, uint32_t what)
{
    return hash_of((uint32_t)w->options.seed, (uint32_t)(w->options.seed >> 32), what);
}

struct pose world_stand_pose(const struct world_stand *s) { return look_at(s->eye, s->target, s->roll); }

struct pose world_sensor_pose(const struct world *w) { return world_stand_pose(&w->options.stand); }

struct pose world_sweep_pose(const struct world *w, double time_s)
{
    double t = least(most(time_s, 0), WORLD_SWEEP_S), a = t / WORLD_SWEEP_S * 1.12 * 6.283185307179586;
    uint32_t seed = seed_of(w, 301);
    // Round the middle at arm's length, facing outwards, alternately up and down at the floor.
    struct vec3 out = v3(sin(a), cos(a), 0);
    struct vec3 eye = v3_add(v3(0, 0.1, 1.42 + 0.12 * sin(2.1 * a)), v3_scale(out, -0.95 + 0.25 * sin(3 * a)));
    eye = v3_add(eye,
                 v3(0.03 * camera_shake(t, seed), 0.03 * camera_shake(t, seed + 1), 0.02 * camera_shake(t, seed + 2)));
    double down = 0.30 + 0.28 * sin(5.0 * a + 0.6) + 0.03 * camera_shake(t, seed + 3);
    struct vec3 target = v3_add(eye, v3_add(out, v3(0.10 * camera_shake(t, seed + 4), 0, -down)));
    return look_at(eye, target, 0.05 * camera_shake(t, seed + 5));
}

struct pose world_viewer_pose(const struct world *w, double time_s)
{
    double length = world_seconds(w), t = least(most(time_s, 0), length);
    uint32_t seed = seed_of(w, 302);
    // The actor's position, smoothed over the past: the camera does not anticipate.
    struct vec3 actor = v3(0, 0, 0);
    for (int i = -4; i <= 4; i++)
        actor = v3_add(actor, v3_scale(world_joints(w, t + 0.2 * i).joint[JOINT_WAIST], 1.0 / 9));
    const struct world_walk *walk = &w->options.walk;
    const struct world_spot *spot = &w->options.spot;
    double a = -0.35 + walk->round * t / most(length, 0.1);
    double r = walk->distance_m + 0.12 * sin(2 * a + 1);
    struct vec3 eye = v3(spot->x + 0.6 * (actor.x - spot->x) - r * sin(a),
                         spot->y + 0.35 * (actor.y - spot->y) - 0.1 - r * cos(a), 1.52);
    eye.x = least(most(eye.x, -2.5), 2.5);
    eye.y = least(most(eye.y, -3.2), 2.7);
    eye = v3_add(eye,
                 v3(0.03 * camera_shake(t, seed), 0.03 * camera_shake(t, seed + 1), 0.03 * camera_shake(t, seed + 2)));
    struct vec3 target = v3_add(actor, v3(0.06 * camera_shake(t, seed + 3), 0.06 * camera_shake(t, seed + 4), -0.06));
    return look_at(eye, target, 0.04 * camera_shake(t, seed + 5));
}
