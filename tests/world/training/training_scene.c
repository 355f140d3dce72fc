#include "tests/world/training/training_scene.h"

#include "tests/world/training/training_figure.h"

#include <glob.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define OTHERS_SHARE 0.67 // of images that show a body of the folder of bodies

static const double PI = 3.14159265358979323846;

// ---------------------------------------------------------------- people

static bool is_held_out(const char *path, const char *const *held_out)
{
    const char *slash = strrchr(path, '/'), *name = slash ? slash + 1 : path;
    for (; held_out && *held_out; held_out++)
        if (!strcmp(name, *held_out))
            return true;
    return false;
}

// Files of that ending, sorted by name; ERR_MISSING: none. Free with globfree.
static enum status files_of(const char *folder, const char *ending, const char *kind, glob_t *out)
{
    char pattern[4096];
    snprintf(pattern, sizeof pattern, "%s/*.%s", folder, ending);
    if (glob(pattern, 0, NULL, out) || !out->gl_pathc)
        return fail(ERR_MISSING, "%s: no %s is there", folder, kind);
    return OK;
}

static enum status open_motions(struct training_people *people, const struct training_people_wish *wish)
{
    glob_t files;
    const struct physique *physique = &people->figures[0].physique;
    enum status status = files_of(wish->folder, "bvh", "BVH file", &files);
    if (status != OK)
        return status;
    people->motions = calloc(files.gl_pathc, sizeof(struct figure_motion *));
    if (!people->motions)
        status = fail(ERR_MEMORY, "no memory for motions");
    for (size_t i = 0; i < files.gl_pathc && status == OK; i++) {
        if (is_held_out(files.gl_pathv[i], wish->held_out))
            continue;
        status = world_motion_open(&people->motions[people->motion_count], files.gl_pathv[i], physique, true);
        people->motion_count += status == OK;
    }
    globfree(&files);
    return status;
}

static enum status read_bodies(struct training_people *people, const char *folder)
{
    glob_t files;
    enum status status = files_of(folder, "figure", "figure", &files);
    if (status != OK)
        return status;
    const size_t count = (size_t)people->figure_count + files.gl_pathc;
    struct figure *all = realloc(people->figures, count * sizeof *all);
    if (all)
        people->figures = all;
    else
        status = fail(ERR_MEMORY, "no memory for figures");
    for (size_t i = 0; i < files.gl_pathc && status == OK; i++) {
        status = training_figure_read(&people->figures[people->figure_count], files.gl_pathv[i]);
        people->figure_count += status == OK;
    }
    globfree(&files);
    return status;
}

static struct world_figure draw_figure(struct rng *rng)
{
    struct world_figure figure = {.number = rng_pick(rng, 100), .palette = rng_pick(rng, 5)};
    const bool child = rng_uniform(rng) < 0.2;
    figure.height_m = child ? rng_between(rng, 1.0, 1.5) : rng_between(rng, 1.5, 2.0);
    figure.build = rng_uniform(rng);
    figure.woman = rng_uniform(rng) < 0.5;
    const double dressed = rng_uniform(rng);
    figure.clothes = CLOTHES_COAT;
    if (dressed < 0.8)
        figure.clothes = dressed < 0.6 ? CLOTHES_TROUSERS : CLOTHES_SKIRT;
    return figure;
}

enum status training_people_open(struct training_people *out, const struct training_people_wish *wish)
{
    *out = (struct training_people){.figures = calloc((size_t)wish->figures, sizeof(struct figure))};
    struct rng rng = rng_of(wish->seed, -2);
    enum status status = out->figures ? OK : fail(ERR_MEMORY, "no memory for figures");
    for (int i = 0; i < wish->figures && status == OK; i++) {
        const struct world_figure figure = draw_figure(&rng);
        const struct physique physique = physique_of(&figure);
        status = figure_build(&out->figures[i], &physique, true);
        out->figure_count += status == OK;
    }
    out->own_count = out->figure_count;
    if (status == OK && wish->bodies)
        status = read_bodies(out, wish->bodies);
    if (status == OK && wish->folder)
        status = open_motions(out, wish);
    if (status != OK)
        training_people_close(out);
    return status;
}

void training_people_close(struct training_people *people)
{
    for (int i = 0; i < people->figure_count; i++)
        figure_free(&people->figures[i]);
    for (int i = 0; i < people->motion_count; i++)
        world_motion_close(&people->motions[i]);
    free(people->figures);
    free(people->motions);
    *people = (struct training_people){0};
}

// ---------------------------------------------------------------- poses

static struct quat about_z(double rad) { return quat_from_rotation_vector(v3(0, 0, rad)); }

static void take_arm(struct stance *to, int side, const struct stance *from, int from_side)
{
    const struct quat back = quat_conjugate(from->chest);
    struct vec3 upper = quat_rotate(back, from->upper_arm[from_side]),
                fore = quat_rotate(back, from->forearm[from_side]);
    if (side != from_side) {
        upper.x = -upper.x;
        fore.x = -fore.x;
    }
    to->upper_arm[side] = quat_rotate(to->chest, upper);
    to->forearm[side] = quat_rotate(to->chest, fore);
}

// At any instant of any motion, of which the lengths are those of the figure that it was opened for.
static struct stance captured_stance(const struct training_people *people, const struct physique *physique,
                                     struct rng *rng)
{
    const struct figure_motion *motion = people->motions[rng_pick(rng, people->motion_count)];
    const struct physique *opened_for = &people->figures[0].physique;
    struct stance s = world_motion_at(motion, physique, rng_between(rng, 0, motion_seconds(motion)));
    const double scale = (physique->thigh_m + physique->shin_m) / (opened_for->thigh_m + opened_for->shin_m);
    const struct vec3 off = v3(-s.waist.x * scale, -s.waist.y * scale, 0);
    s.waist = v3_add(v3_scale(s.waist, scale), off);
    for (int side = 0; side < 2; side++)
        s.ankle[side] = v3_add(v3_scale(s.ankle[side], scale), off);
    return s;
}

// One of figure.h's own for every two others.
static const struct figure *draw_body(const struct training_people *people, struct rng *rng)
{
    const int others = people->figure_count - people->own_count;
    if (others && rng_uniform(rng) < OTHERS_SHARE)
        return &people->figures[people->own_count + rng_pick(rng, others)];
    return &people->figures[rng_pick(rng, people->own_count)];
}

static struct stance draw_stance(const struct training_people *people, const struct physique *physique, struct rng *rng,
                                 int *posture)
{
    *posture = POSTURES;
    struct stance stance;
    if (people->motion_count && rng_uniform(rng) < 0.2) {
        stance = captured_stance(people, physique, rng);
        for (int side = 0; side < 2; side++) {
            const struct stance other = captured_stance(people, physique, rng);
            const int from = rng_pick(rng, 2);
            if (rng_uniform(rng) < 0.5)
                take_arm(&stance, side, &other, from);
        }
        return stance;
    }
    // Upright ones are a third of the sixteen kinds' images and half of all.
    *posture = rng_uniform(rng) < 0.3 ? rng_pick(rng, POSTURE_SITTING) : rng_pick(rng, POSTURES);
    const bool swapped = rng_uniform(rng) < 0.5;
    const struct posture_pose pose = posture_draw((enum posture) * posture, swapped, rng);
    return posture_stance((enum posture) * posture, &pose, physique);
}

static struct stance placed(const struct stance *stance, double heading_rad, struct vec3 at)
{
    struct stance s = *stance;
    const struct quat turn = about_z(heading_rad);
    s.waist = v3_add(at, quat_rotate(turn, s.waist));
    s.pelvis = quat_multiply(turn, s.pelvis);
    s.chest = quat_multiply(turn, s.chest);
    s.head = quat_multiply(turn, s.head);
    for (int side = 0; side < 2; side++) {
        s.upper_arm[side] = quat_rotate(turn, s.upper_arm[side]);
        s.forearm[side] = quat_rotate(turn, s.forearm[side]);
        s.knee[side] = quat_rotate(turn, s.knee[side]);
        s.foot[side] = quat_multiply(turn, s.foot[side]);
        s.ankle[side] = v3_add(at, quat_rotate(turn, s.ankle[side]));
    }
    return s;
}

// ---------------------------------------------------------------- room

static void add_solid(struct training_scene *scene, struct training_solid solid)
{
    if (scene->solid_count < TRAINING_SOLIDS)
        scene->solid[scene->solid_count++] = solid;
}

static void add_seat(struct training_scene *scene, const struct stance *stance, const struct training_person *person)
{
    struct posture_box box[POSTURE_BOXES];
    const int count = posture_furniture((enum posture)person->posture, stance, &person->figure->physique, box);
    for (int i = 0; i < count; i++) {
        const struct vec3 middle = v3_mix(box[i].low, box[i].high, 0.5);
        add_solid(scene, (struct training_solid){.kind = SOLID_BOX,
                                                 .at = quat_rotate(about_z(person->heading_rad), middle),
                                                 .half = v3_scale(v3_sub(box[i].high, box[i].low), 0.5),
                                                 .turned = person->heading_rad});
    }
}

// A table above who is bent or kneels.
static void add_table(struct training_scene *scene, const struct training_person *person, struct rng *rng)
{
    const double head_m = person->posed.joints.joint[JOINT_HEAD].z, top_m = rng_between(rng, 0.6, 0.9);
    const struct vec3 ahead = quat_rotate(about_z(person->heading_rad), v3(0, -rng_between(rng, 0.3, 0.8), 0));
    if (head_m > top_m - 0.15)
        return;
    add_solid(scene, (struct training_solid){.kind = SOLID_BOX,
                                             .at = v3(ahead.x, ahead.y, top_m),
                                             .half = v3(rng_between(rng, 0.4, 0.9), rng_between(rng, 0.3, 0.5), 0.02),
                                             .turned = person->heading_rad});
}

// A stick, a ball or a bag in a hand, or a board under the feet.
static void add_things(struct training_scene *scene, const struct training_person *person, struct rng *rng)
{
    const struct vec3 hand = person->posed.joints.joint[rng_pick(rng, 2) ? JOINT_LEFT_HAND : JOINT_RIGHT_HAND];
    const double what = rng_uniform(rng);
    const struct vec3 way = v3_unit(rng_normal3(rng, 1));
    const double length_m = rng_between(rng, 0.3, 1.3), radius_m = rng_between(rng, 0.08, 0.3);
    if (what < 0.1)
        add_solid(scene, (struct training_solid){.kind = SOLID_ROD,
                                                 .at = v3_add(hand, v3_scale(way, -0.3 * length_m)),
                                                 .to = v3_add(hand, v3_scale(way, 0.7 * length_m)),
                                                 .radius_m = rng_between(rng, 0.012, 0.025)});
    else if (what < 0.17)
        add_solid(scene, (struct training_solid){.kind = SOLID_ROD,
                                                 .at = v3_add(hand, v3_scale(way, radius_m)),
                                                 .to = v3_add(hand, v3_scale(way, radius_m)),
                                                 .radius_m = radius_m});
    else if (what < 0.24)
        add_solid(scene, (struct training_solid){.kind = SOLID_BOX,
                                                 .at = v3_add(hand, v3(0, 0, -0.25)),
                                                 .half = v3(0.18, 0.07, 0.16),
                                                 .turned = rng_between(rng, 0, 3)});
}

static void add_furniture(struct training_scene *scene, struct rng *rng)
{
    const int count = rng_pick(rng, 6);
    for (int i = 0; i < count; i++) {
        const double away_m = rng_between(rng, 0.45, 2.2), bearing = rng_between(rng, -PI, PI);
        const double x = rng_between(rng, 0.1, 0.6), y = rng_between(rng, 0.1, 0.6), top = rng_between(rng, 0.3, 1.4);
        const bool slab = rng_uniform(rng) < 0.2; // a table's top
        const double half_z = slab ? 0.03 : top / 2;
        add_solid(scene, (struct training_solid){.kind = SOLID_BOX,
                                                 .at = v3((away_m + 0.5 * x) * cos(bearing),
                                                          (away_m + 0.5 * x) * sin(bearing), top - half_z),
                                                 .half = v3(x, y, half_z),
                                                 .turned = rng_between(rng, 0, PI / 2)});
    }
}

// Behind the person as the sensor sees it, and to a side.
static void add_walls(struct training_scene *scene, struct rng *rng)
{
    const struct vec3 eye = scene->world_from_camera.translation, away = v3_unit(v3(-eye.x, -eye.y, 0));
    scene->wall_count = rng_pick(rng, TRAINING_WALLS + 1);
    for (int i = 0; i < scene->wall_count; i++) {
        const double side = i == 1 ? 1 : -1, turn = i ? side * rng_between(rng, 1, 1.6) : rng_between(rng, -0.6, 0.6),
                     away_m = rng_between(rng, 0.35, i ? 2.5 : 3.5);
        const struct vec3 to = quat_rotate(about_z(turn), away);
        scene->wall[i] = (struct training_wall){v3_scale(to, away_m), v3_scale(to, -1)};
    }
}

// ---------------------------------------------------------------- sensor

static struct lens draw_lens(enum training_sensor sensor, struct rng *rng)
{
    static const struct {
        int width, height;
        double focal_px;
    } lenses[TRAINING_SENSORS] = {{320, 240, 262.5}, {160, 120, 131.25}, {256, 212, 183}, {256, 192, 213}};
    const double f = lenses[sensor].focal_px * rng_between(rng, 0.93, 1.1);
    const int w = lenses[sensor].width, h = lenses[sensor].height;
    return (struct lens){.width = w, .height = h, .fx = f, .fy = f, .cx = 0.5 * (w - 1), .cy = 0.5 * (h - 1)};
}

static struct vec3 body_middle(const struct skeleton *skeleton)
{
    struct vec3 low = skeleton->joint[0], high = low;
    for (int j = 1; j < JOINT_COUNT; j++) {
        const struct vec3 p = skeleton->joint[j];
        low = v3(fmin(low.x, p.x), fmin(low.y, p.y), fmin(low.z, p.z));
        high = v3(fmax(high.x, p.x), fmax(high.y, p.y), fmax(high.z, p.z));
    }
    return v3_mix(low, high, 0.5);
}

static void aim(struct training_scene *scene, struct vec3 middle, struct rng *rng)
{
    const double away_m = rng_between(rng, 0.8, 5), bearing = rng_between(rng, -PI, PI),
                 high_m = rng_between(rng, 0.3, 2.6), loose_m = rng_uniform(rng) < 0.35 ? 0.45 : 0.12;
    const struct vec3 eye = v3(away_m * cos(bearing), away_m * sin(bearing), high_m);
    struct vec3 z = v3_unit(v3_sub(v3_add(middle, rng_normal3(rng, loose_m)), eye));
    const double steepest = 0.643, flat = hypot(z.x, z.y); // 40 degrees
    if (fabs(z.z) > steepest) {
        const double k = sqrt(1 - steepest * steepest) / flat;
        z = v3(z.x * k, z.y * k, copysign(steepest, z.z));
    }
    const struct vec3 x = v3_unit(v3_cross(z, v3(0, 0, 1))), y = v3_cross(z, x);
    double m[3][3] = {{x.x, y.x, z.x}, {x.y, y.y, z.y}, {x.z, y.z, z.z}};
    const double quarter = rng_uniform(rng) < 0.1 ? (rng_pick(rng, 2) ? 1 : -1) * PI / 2 : 0,
                 roll = quarter + rng_between(rng, -0.1, 0.1);
    scene->world_from_camera = (struct pose){quat_multiply(quat_from_matrix(m), about_z(roll)), eye};
}

// ---------------------------------------------------------------- drawing

static struct stance add_person(struct training_scene *scene, const struct training_people *people, struct vec3 at,
                                struct rng *rng)
{
    struct training_person *person = &scene->person[scene->person_count++];
    person->figure = draw_body(people, rng);
    const struct stance stance = draw_stance(people, &person->figure->physique, rng, &person->posture);
    person->heading_rad = rng_between(rng, -PI, PI);
    const struct stance there = placed(&stance, person->heading_rad, at);
    physique_pose(&person->figure->physique, &there, &person->posed);
    return stance;
}

void training_scene_draw(const struct training_people *people, uint64_t seed, int index, struct training_scene *out)
{
    struct rng rng = rng_of(seed, index);
    *out = (struct training_scene){.sensor = (enum training_sensor)rng_pick(&rng, TRAINING_SENSORS)};
    out->lens = draw_lens(out->sensor, &rng);
    out->noise_seed = rng.state;
    const bool empty = rng_uniform(&rng) < 0.08, second = rng_uniform(&rng) < 0.15;
    struct vec3 middle = v3(0, 0, 0.8);
    if (!empty) {
        const struct stance stance = add_person(out, people, v3(0, 0, 0), &rng);
        middle = body_middle(&out->person[0].posed.joints);
        add_seat(out, &stance, &out->person[0]);
        if (rng_uniform(&rng) < 0.3)
            add_table(out, &out->person[0], &rng);
        add_things(out, &out->person[0], &rng);
    }
    aim(out, middle, &rng);
    if (!empty && second) {
        const double away_m = rng_between(&rng, 0.6, 1.6), bearing = rng_between(&rng, -PI, PI);
        (void)add_person(out, people, v3(away_m * cos(bearing), away_m * sin(bearing), 0), &rng);
    }
    add_walls(out, &rng);
    add_furniture(out, &rng);
}
