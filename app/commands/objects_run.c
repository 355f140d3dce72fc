#include "app/commands/objects_run.h"

#include "app/commands/command.h"
#include "base/clock.h"
#include "capture/calibration/stereo_rig.h"
#include "objects/stereo_pairs.h"
#include "objects/thing_recognition.h"
#include "platform/files/file.h"
#include "platform/files/json.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct pair_result {
    struct detection detections[THINGS_MOST];
    struct sighting sightings[THINGS_MOST];
    int detected, seen;
};

struct run {
    struct stereo_rig rig;
    struct thing_list things;
    struct stereo_pair *pairs;
    struct pair_result *results;
    int count;
    struct recognizer *recognizer;
    struct thing_traits traits[THINGS_MOST];
    struct thing_map map;
    int64_t find_ns;
};

static enum status open_views(const struct run *r, const struct stereo_pair *pair, bool features,
                              struct thing_view out[2])
{
    const struct lens *lenses[2] = {&r->rig.left, &r->rig.right};
    const struct pose from_left[2] = {POSE_IDENTITY, pose_inverse(r->rig.left_from_right)};
    memset(out, 0, 2 * sizeof *out);
    for (int i = 0; i < 2; i++) {
        struct image image;
        enum status status = image_read(pair->picture[i], &image);
        if (status == OK && (image.width != lenses[i]->width || image.height != lenses[i]->height))
            status = fail(ERR_INPUT, "%s has %d x %d pixels, the rig's camera %d x %d", pair->picture[i], image.width,
                          image.height, lenses[i]->width, lenses[i]->height);
        if (status == OK)
            status = thing_view_make(lenses[i], &from_left[i], image.rgb, features, &out[i]);
        free(image.rgb);
        if (status != OK) {
            thing_view_free(&out[0]);
            return status;
        }
    }
    return OK;
}

static void close_views(struct thing_view views[2])
{
    thing_view_free(&views[0]);
    thing_view_free(&views[1]);
}

static enum status find_in_pair(struct run *r, int pair)
{
    struct pair_result *p = &r->results[pair];
    struct thing_view views[2];
    const int64_t begin = clock_now_ns();
    enum status status = open_views(r, &r->pairs[pair], true, views);
    if (status != OK)
        return status;
    status = recognizer_find(r->recognizer, views, 2, p->detections, &p->detected);
    close_views(views);
    r->find_ns += clock_now_ns() - begin;
    for (int i = 0; i < p->detected && status == OK; i++)
        thing_traits_add(&r->traits[p->detections[i].thing], r->recognizer, &p->detections[i]);
    return status;
}

static enum status refine_pair(struct run *r, int pair)
{
    struct pair_result *p = &r->results[pair];
    struct thing_view views[2];
    if (!p->detected)
        return OK;
    enum status status = open_views(r, &r->pairs[pair], false, views);
    if (status != OK)
        return status;
    for (int i = 0; i < p->detected && status >= OK; i++) {
        status = recognizer_refine(r->recognizer, &p->detections[i], &r->traits[p->detections[i].thing], views, 2,
                                   &p->sightings[p->seen]);
        if (status == OK)
            sighting_add_rig_error(&p->sightings[p->seen++], &r->rig.error_at_1m);
    }
    close_views(views);
    return status < OK ? status : OK;
}

static void add_covariance(struct json *thing, const char *name, const struct covariance3 *c)
{
    const double values[6] = {c->xx, c->xy, c->xz, c->yy, c->yz, c->zz};
    struct json *list = json_add_array(thing, name);
    for (int i = 0; i < 6; i++)
        json_push_number(list, values[i]);
}

static void add_map(const struct run *r, struct json *root)
{
    struct json *map = json_add_array(root, "map");
    for (int i = 0; i < r->map.count; i++) {
        const struct mapped_thing *t = &r->map.things[i];
        struct json *thing = json_add_object(map, NULL);
        json_add_string(thing, "name", r->things.things[t->thing].name);
        json_add_number(thing, "x_m", t->world_from_thing.translation.x);
        json_add_number(thing, "y_m", t->world_from_thing.translation.y);
        json_add_number(thing, "z_m", t->world_from_thing.translation.z);
        add_covariance(thing, "covariance_m2", &t->covariance);
        json_add_number(thing, "sightings", t->sightings);
        json_add_number(thing, "moves", t->moves);
        json_add_bool(thing, "gone", t->gone);
    }
}

static char *print_result(const struct run *r)
{
    static const char *const shapes[THING_SHAPES] = {"flat", "turned"};
    const double degrees = 180 / 3.14159265358979324;
    struct json *root = json_new_object(), *pairs = json_add_array(root, "pairs");
    for (int i = 0; i < r->count; i++) {
        struct json *pair = json_add_object(pairs, NULL);
        json_add_number(pair, "time", r->pairs[i].time_s);
        struct json *things = json_add_array(pair, "things");
        for (int k = 0; k < r->results[i].seen; k++) {
            const struct sighting *s = &r->results[i].sightings[k];
            struct json *thing = json_add_object(things, NULL);
            json_add_string(thing, "name", r->things.things[s->thing].name);
            json_add_number(thing, "x_m", s->left_from_thing.translation.x);
            json_add_number(thing, "y_m", s->left_from_thing.translation.y);
            json_add_number(thing, "z_m", s->left_from_thing.translation.z);
            json_add_number(thing, "angle_deg", s->angle * degrees);
            json_add_number(thing, "angle_sigma_deg", s->angle_sigma * degrees);
            add_covariance(thing, "covariance_m2", &s->covariance);
            json_add_number(thing, "score", s->score);
            json_add_string(thing, "shape", shapes[s->shape]);
        }
    }
    add_map(r, root);
    char *text = json_print(root);
    json_free(&root);
    return text;
}

// A thing of the map that lies well inside both images, near enough, must be found; otherwise that is noted.
static void note_misses(struct run *r, int pair)
{
    const struct pair_result *p = &r->results[pair];
    const struct pose left_from_world = pose_inverse(r->pairs[pair].world_from_left);
    for (int i = 0; i < r->map.count; i++) {
        bool seen = false;
        for (int k = 0; k < p->seen; k++)
            seen = seen || p->sightings[k].thing == r->map.things[i].thing;
        const struct vec3 at = pose_apply(left_from_world, r->map.things[i].world_from_thing.translation);
        const struct thing *t = &r->things.things[r->map.things[i].thing];
        const struct vec3 in_right = pose_apply(pose_inverse(r->rig.left_from_right), at);
        if (seen || !(at.z > 0.3 && at.z < 1.2 && in_right.z > 0.2))
            continue;
        const double margin = r->rig.left.fx * (t->width_m + t->height_m) / 2 / at.z + 20;
        const struct pixel px[2] = {lens_project_clamped(&r->rig.left, lens_max_radius2(&r->rig.left), at),
                                    lens_project_clamped(&r->rig.right, lens_max_radius2(&r->rig.right), in_right)};
        bool inside = true;
        for (int k = 0; k < 2; k++)
            inside = inside && px[k].x > margin && px[k].y > margin && px[k].x < r->rig.left.width - margin &&
                     px[k].y < r->rig.left.height - margin;
        if (inside)
            thing_map_miss(&r->map, r->map.things[i].thing);
    }
}

static void map_all(struct run *r)
{
    for (int i = 0; i < r->count; i++) {
        for (int k = 0; k < r->results[i].seen; k++)
            thing_map_add(&r->map, &r->results[i].sightings[k], &r->pairs[i].world_from_left);
        note_misses(r, i);
    }
}

static enum status recognise_all(struct run *r)
{
    struct progress_bar bar;
    enum status status = OK;
    progress_bar_start(&bar, "recognising", 2 * r->count);
    for (int i = 0; i < r->count && status == OK; i++) {
        status = find_in_pair(r, i);
        progress_bar_step(&bar);
    }
    for (int i = 0; i < r->count && status == OK; i++) {
        status = refine_pair(r, i);
        progress_bar_step(&bar);
    }
    progress_bar_end(&bar);
    return status;
}

static enum status write_out(const struct run *r, const struct objects_arguments *a)
{
    char *text = print_result(r);
    const enum status status =
        text ? file_write(a->out, text, strlen(text)) : fail(ERR_MEMORY, "no memory to write %s", a->out);
    free(text);
    return status;
}

static enum status report(const struct run *r, const struct objects_arguments *a)
{
    int seen = 0;
    for (int i = 0; i < r->count; i++)
        seen += r->results[i].seen;
    if (!a->json) {
        printf("%s: %d things, %d sightings in %d pairs, %.2f s a pair\n", a->out ? a->out : a->into, r->map.count,
               seen, r->count, 1e-9 * (double)r->find_ns / r->count);
        return OK;
    }
    struct json *root = json_new_object();
    json_add_string(root, "file", a->out ? a->out : a->into);
    json_add_number(root, "things", r->map.count);
    json_add_number(root, "pairs", r->count);
    json_add_number(root, "sightings", seen);
    json_add_number(root, "seconds_per_pair", 1e-9 * (double)r->find_ns / r->count);
    return command_print_json(&root);
}

enum status objects_run(const struct objects_arguments *a)
{
    struct run *r = calloc(1, sizeof *r);
    if (!r)
        return fail(ERR_MEMORY, "no memory");
    enum status status = stereo_rig_read(a->rig, &r->rig);
    if (status == OK)
        status = thing_list_read(a->objects, &r->things);
    if (status == OK)
        status = stereo_pairs_read(a->pairs, &r->pairs, &r->count);
    if (status == OK && !(r->results = calloc((size_t)r->count, sizeof *r->results)))
        status = fail(ERR_MEMORY, "no memory for %d pairs", r->count);
    if (status == OK)
        status = recognizer_open(&r->recognizer, &r->things, NULL);
    if (status == OK)
        status = recognise_all(r);
    if (status == OK) {
        map_all(r);
        status = a->into ? objects_into(&r->map, &r->things, a) : write_out(r, a);
    }
    if (status == OK)
        status = report(r, a);
    recognizer_close(&r->recognizer);
    thing_list_free(&r->things);
    free(r->pairs);
    free(r->results);
    free(r);
    return status;
}
