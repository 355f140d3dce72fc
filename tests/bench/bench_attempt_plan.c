// Which films of attempts there are, drawn from a seed.
#include "tests/bench/bench_attempts.h"
#include "tests/support/random.h"

#include <stdlib.h>
#include <string.h>

enum { TRIES = 80, PLACES = 60, FRAMES_MOST = 30 * ATTEMPT_HZ };
static const double PI = 3.14159265358979323846;

bool edit_is_posture(enum world_edit_kind kind) { return kind >= EDIT_LEFT_ELBOW; }
bool edit_is_timing(enum world_edit_kind kind) { return kind == EDIT_TEMPO || kind == EDIT_PAUSE || kind == EDIT_LATE; }

// The joints whose line, the parts' names whose direction the edit changes.
static const struct {
    enum joint from, to;
    const char *parts[2];
} changed[EDIT_KINDS] = {
    [EDIT_LEFT_ELBOW] = {JOINT_LEFT_ELBOW, JOINT_LEFT_HAND, {"left_forearm", NULL}},
    [EDIT_RIGHT_ELBOW] = {JOINT_RIGHT_ELBOW, JOINT_RIGHT_HAND, {"right_forearm", NULL}},
    [EDIT_LEFT_ARM] = {JOINT_LEFT_SHOULDER, JOINT_LEFT_ELBOW, {"left_upper_arm", NULL}},
    [EDIT_RIGHT_ARM] = {JOINT_RIGHT_SHOULDER, JOINT_RIGHT_ELBOW, {"right_upper_arm", NULL}},
    [EDIT_LEFT_KNEE] = {JOINT_LEFT_HIP, JOINT_LEFT_KNEE, {"left_shin", "left_thigh"}},
    [EDIT_RIGHT_KNEE] = {JOINT_RIGHT_HIP, JOINT_RIGHT_KNEE, {"right_shin", "right_thigh"}},
    [EDIT_LEAN] = {JOINT_TORSO, JOINT_NECK, {"upper_torso", "lower_torso"}},
};

bool edit_expects_part(enum world_edit_kind kind, const char *part)
{
    for (int k = 0; k < 2; k++)
        if (changed[kind].parts[k] && !strcmp(changed[kind].parts[k], part))
            return true;
    return false;
}

struct world_options attempt_world_options(const struct attempt_plan *plan, int actor)
{
    struct world_options options = world_default_options();
    const bool known = world_figure_named(plan->actor[actor].figure, &options.figure);
    assert(known);
    (void)known;
    options.motion = plan->motion;
    options.spot = plan->actor[actor].spot;
    options.plain = true;
    options.whole = true;
    return options;
}

// ---------------------------------------------------------------- drawing

// Two different ones.
static void draw_figures(struct rng *rng, struct attempt_plan *plan)
{
    const char *name[16];
    int length[16], count = 0;
    for (const char *at = world_figure_names(); *at && count < 16; count++) {
        name[count] = at;
        length[count] = (int)strcspn(at, " ");
        at += length[count] + (at[length[count]] == ' ');
    }
    const int first = rng_pick(rng, count), second = (first + 1 + rng_pick(rng, count - 1)) % count;
    const int of[2] = {first, second};
    for (int k = 0; k < 2; k++) {
        assert(length[of[k]] < (int)sizeof plan->actor[k].figure);
        memset(plan->actor[k].figure, 0, sizeof plan->actor[k].figure);
        memcpy(plan->actor[k].figure, name[of[k]], (size_t)length[of[k]]);
    }
}

static double draw_amount(struct rng *rng, enum world_edit_kind kind)
{
    switch (kind) {
    case EDIT_TEMPO: return rng_between(rng, 1.15, 1.35);
    case EDIT_PAUSE: return rng_between(rng, 0.6, 1.2);
    case EDIT_LATE: return rng_between(rng, 0.25, 0.4);
    case EDIT_EXTRA: return rng_between(rng, 1.5, 2.5);
    case EDIT_RANGE: return rng_between(rng, 0.5, 0.7);
    case EDIT_LEFT_KNEE:
    case EDIT_RIGHT_KNEE: return 36;
    default: return rng_between(rng, 20, 30);
    }
}

static enum status draw_edit(struct rng *rng, const struct attempt_wish *wish, struct attempt_plan *plan)
{
    struct world_edit *e = &plan->edit;
    struct world_options options = attempt_world_options(plan, 0);
    double seconds = 0;
    const enum status status = world_preview_seconds(&options, &seconds);
    const double length = fmin(fmin(seconds, wish->seconds), 20);
    const double piece =
        fmin(rng_between(rng, e->kind == EDIT_MISSING ? 0.8 : 1.6, e->kind == EDIT_MISSING ? 1.5 : 2.4), 0.5 * length);
    e->start_s = rng_between(rng, 0, seconds - length);
    e->seconds = length;
    e->from_s = rng_between(rng, 0.15 * length, 0.85 * length - piece);
    e->to_s = e->from_s + piece;
    e->amount = draw_amount(rng, e->kind);
    return status;
}

// ---------------------------------------------------------------- what shows

static struct vec3 about_waist(const struct skeleton *s, int j) { return v3_sub(s->joint[j], s->joint[JOINT_WAIST]); }

// Mean over frames first .. end - 1 of the fastest joint's speed beside the waist, m/s; of the right hand alone.
static double mean_speed(const struct skeleton *s, int first, int end, bool right_hand)
{
    double sum = 0;
    for (int k = first + 1; k < end; k++) {
        double fastest = 0;
        for (int j = right_hand ? JOINT_RIGHT_HAND : 0; j < (right_hand ? JOINT_RIGHT_HAND + 1 : JOINT_COUNT); j++)
            fastest = fmax(fastest, ATTEMPT_HZ * v3_distance(about_waist(&s[k], j), about_waist(&s[k - 1], j)));
        sum += fastest;
    }
    return sum / fmax(1, end - first - 1);
}

static double degrees_between(const struct skeleton *a, const struct skeleton *b, enum joint from, enum joint to)
{
    const struct vec3 x = v3_sub(a->joint[to], a->joint[from]), y = v3_sub(b->joint[to], b->joint[from]);
    return atan2(v3_length(v3_cross(x, y)), v3_dot(x, y)) * 180 / PI;
}

// joints: of the stretch, unedited and edited, by the same figure at the same place.
static bool shows(const struct world_edit *e, const struct skeleton *joints, const struct skeleton *edited, int count)
{
    const int first = (int)(e->from_s * ATTEMPT_HZ), end = (int)(e->to_s * ATTEMPT_HZ);
    const double least_mps = 0.3; // as compare's own measure of what moves
    if (mean_speed(joints, 0, count, e->kind == EDIT_LATE) < least_mps || mean_speed(joints, first, end, false) < 0.2)
        return false;
    if (!edit_is_posture(e->kind))
        return true;
    double sum = 0;
    const int inner = (int)(0.3 * ATTEMPT_HZ);
    for (int k = first + inner; k < end - inner; k++)
        sum += degrees_between(&joints[k], &edited[k], changed[e->kind].from, changed[e->kind].to);
    return sum / (end - first - 2 * inner) >=
           (e->kind < EDIT_LEFT_KNEE || e->kind == EDIT_LEAN ? 0.7 : 0.35) * e->amount;
}

// Facing so many radians away from the sensor when the stretch begins, its middle at a distance.
static struct world_spot spot_of(const struct skeleton *s, int count, double distance_m, double aside_m, double facing)
{
    const struct vec3 left = v3_sub(s[0].joint[JOINT_LEFT_HIP], s[0].joint[JOINT_RIGHT_HIP]);
    const struct vec3 eye = world_default_options().stand.eye;
    struct world_spot spot = {.turned = facing - atan2(left.y, left.x)}; // unturned, left is +x
    struct vec3 middle = {0, 0, 0};
    for (int k = 0; k < count; k++)
        middle = v3_add(middle, v3_scale(s[k].joint[JOINT_WAIST], 1.0 / count));
    middle = quat_rotate(quat_from_rotation_vector(v3(0, 0, spot.turned)), middle);
    spot.x = eye.x + aside_m - middle.x;
    spot.y = eye.y + distance_m - middle.y;
    return spot;
}

static bool stays_in_image(const struct skeleton *s, int count, const struct world_spot *spot)
{
    const struct world_options options = world_default_options();
    const struct pose camera_from_world = pose_inverse(world_stand_pose(&options.stand));
    const struct pose room_from_motion = {quat_from_rotation_vector(v3(0, 0, spot->turned)), v3(spot->x, spot->y, 0)};
    const struct lens lens = world_calibration(0.5).depth;
    for (int k = 0; k < count; k += 3) {
        for (int j = 0; j < JOINT_COUNT; j++) {
            const struct vec3 p = pose_apply(room_from_motion, s[k].joint[j]);
            if (!dice_in_image(&lens, pose_apply(camera_from_world, p)) || fabs(p.x) > 2.6 || p.y > 2.8)
                return false;
        }
    }
    return true;
}

static bool draw_place(struct rng *rng, const struct skeleton *s, int count, double facing, struct world_spot *out)
{
    for (int i = 0; i < PLACES; i++) {
        const double distance_m = rng_between(rng, 2.2, 3.6), aside_m = rng_between(rng, -0.4, 0.4);
        *out = spot_of(s, count, distance_m, aside_m, facing);
        if (fabs(out->x) < 3.2 && fabs(out->y) < 3.5 && stays_in_image(s, count, out))
            return true;
    }
    return false;
}

struct preview {
    struct skeleton unedited[FRAMES_MOST], edited[FRAMES_MOST];
    int frames, edited_frames;
};

static enum status preview(struct attempt_plan *plan, int actor, struct preview *p)
{
    plan->actor[actor].spot = (struct world_spot){0};
    struct world_options options = attempt_world_options(plan, actor);
    struct world_edit none = plan->edit;
    none.kind = EDIT_NONE;
    options.edit = &none;
    p->frames = (int)fmin(FRAMES_MOST, world_edit_seconds(&none) * ATTEMPT_HZ);
    enum status status = world_preview_joints(&options, 0, ATTEMPT_HZ, p->frames, p->unedited);
    options.edit = &plan->edit;
    p->edited_frames = (int)fmin(FRAMES_MOST, world_edit_seconds(&plan->edit) * ATTEMPT_HZ);
    if (status == OK)
        status = world_preview_joints(&options, 0, ATTEMPT_HZ, p->edited_frames, p->edited);
    return status;
}

static enum status draw_film(struct rng *rng, const struct attempt_wish *wish, struct attempt_plan *plan,
                             struct preview *p)
{
    plan->motion = wish->motions->name[rng_pick(rng, wish->motions->count)];
    enum status status = draw_edit(rng, wish, plan);
    if (status == OK && plan->edit.seconds < 2.5)
        return NOTHING;
    if (status == OK)
        status = preview(plan, 0, p);
    if (status != OK)
        return status;
    if (!shows(&plan->edit, p->unedited, p->edited, p->frames < p->edited_frames ? p->frames : p->edited_frames))
        return NOTHING;
    const double facing = rng_between(rng, -PI / 6, PI / 6), side = rng_uniform(rng) < 0.5 ? -1 : 1;
    struct world_spot spot[2];
    if (!draw_place(rng, p->unedited, p->frames, facing, &spot[0]))
        return NOTHING;
    status = preview(plan, 1, p);
    const double other = facing + side * rng_between(rng, PI / 12, PI / 6);
    if (status == OK && !draw_place(rng, p->edited, p->edited_frames, other, &spot[1]))
        return NOTHING;
    for (int k = 0; k < 2; k++)
        plan->actor[k].spot = spot[k];
    return status;
}

enum status attempt_plan_draw(struct attempt_plan *out, const struct attempt_wish *wish, int index)
{
    struct rng rng = rng_of(wish->seed, index);
    struct preview *p = calloc(1, sizeof *p);
    enum status status = p ? NOTHING : fail(ERR_MEMORY, "no memory for a film's plan");
    for (int i = 0; i < TRIES && status == NOTHING; i++) {
        *out = (struct attempt_plan){.seed = wish->seed, .index = index};
        out->edit.kind = (enum world_edit_kind)(index % EDIT_KINDS);
        draw_figures(&rng, out);
        status = draw_film(&rng, wish, out, p);
    }
    free(p);
    return status;
}
