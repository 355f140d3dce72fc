// reenact-capture objects: known things before a stereo rig.
#include "app/commands/capture_objects.h"

#include "app/commands/command.h"
#include "app/commands/commands.h"
#include "app/commands/place_input.h"
#include "base/clock.h"
#include "base/text.h"
#include "capture/calibration/stereo_rig.h"
#include "locate/camera_tracker.h"
#include "objects/stereo_pairs.h"
#include "objects/thing.h"
#include "objects/thing_knowledge.h"
#include "objects/thing_map.h"
#include "objects/thing_recognition.h"
#include "objects/thing_search.h"
#include "platform/files/file.h"
#include "platform/files/jpeg.h"
#include "platform/files/json.h"
#include "platform/files/png.h"
#include "platform/files/text_file.h"
#include "platform/sensors/source.h"
#include "recording/recorded_things.h"
#include "recording/recording.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static enum status objects_into(const struct thing_map *map, const struct thing_list *things,
                                const struct objects_arguments *a);

// ---------------------------------------------------------------- objects run

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

static enum status report_run(const struct run *r, const struct objects_arguments *a)
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

// Recognises in all pairs, learns each thing's shape and size from all of them, aligns once more, writes and reports.
// ERR_… of what it reads and writes.
static enum status objects_run(const struct objects_arguments *a)
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
        status = report_run(r, a);
    recognizer_close(&r->recognizer);
    thing_list_free(&r->things);
    free(r->pairs);
    free(r->results);
    free(r);
    return status;
}

// ---------------------------------------------------------------- objects serve

// reenact-capture objects serve: the folder of a knowledge base.

// The path below the folder that a thing's URL means: no scheme, host, "..", query.
static bool path_of(const struct thing *t, char *out, size_t bytes)
{
    const char *path = strstr(t->url, "://");
    path = path ? strchr(path + 3, '/') : t->url;
    while (path && *path == '/')
        path++;
    if (!path || !*path || strstr(path, "..") || strpbrk(path, "?#\\"))
        return false;
    return (size_t)snprintf(out, bytes, "%s", path) < bytes;
}

static enum status write_new(const char *path, const void *bytes, size_t count, bool force)
{
    const enum status status = file_check_output(path, force);
    return status == OK ? file_write(path, bytes, count) : status;
}

static enum status write_picture(const struct thing *t, const char *path, bool force)
{
    const struct png_layout layout = {PNG_RGB8, t->picture.width, t->picture.height};
    uint8_t *bytes;
    size_t count;
    enum status status = png_encode(&layout, t->picture.rgb, 6, &bytes, &count);
    if (status == OK) {
        status = write_new(path, bytes, count, force);
        free(bytes);
    }
    return status;
}

// The description is what a text file beside the list says of the thing.
static enum status describe(struct thing_knowledge *k, const char *path)
{
    struct text_file file;
    enum status status = text_file_open(&file, path);
    if (status != OK)
        return status;
    snprintf(k->description, sizeof k->description, "%s", file.next);
    text_make_utf8(k->description); // where it is cut, too
    text_file_close(&file);
    return OK;
}

static enum status write_thing(const struct thing *t, const char *objects, const char *folder, bool force)
{
    char path[1024], file[2048], picture[2100], note[2048];
    struct thing_knowledge k = {0};
    if (!path_of(t, path, sizeof path))
        return fail(ERR_INPUT, "'%s': its url '%s' is no path below a folder", t->name, t->url);
    snprintf(file, sizeof file, "%s/%s", folder, path);
    snprintf(picture, sizeof picture, "%s.png", file);
    const char *slash = strrchr(objects, '/');
    snprintf(note, sizeof note, "%.*s%s.txt", slash ? (int)(slash - objects + 1) : 0, objects, t->name);
    snprintf(k.name, sizeof k.name, "%s", t->name);
    snprintf(k.description, sizeof k.description, "%.0f x %.0f mm", 1000 * t->width_m, 1000 * t->height_m);
    enum status status = file_exists(note) ? describe(&k, note) : OK;
    const char *leaf = strrchr(path, '/');
    snprintf(k.image, sizeof k.image, "%.400s.png", leaf ? leaf + 1 : path);
    char parent[2048];
    snprintf(parent, sizeof parent, "%s", file);
    *strrchr(parent, '/') = 0;
    if (status == OK)
        status = folder_make(parent);
    char *json = status == OK ? thing_knowledge_print(&k) : NULL;
    if (status == OK)
        status = json ? write_new(file, json, strlen(json), force) : fail(ERR_MEMORY, "no memory to write %s", file);
    free(json);
    return status == OK ? write_picture(t, picture, force) : status;
}

// Writes a folder that a web server can show as a knowledge base: for each thing of objects.json a file at its URL's
// path, JSON-LD made of its name, size, picture, and of the text NAME.txt beside objects.json, where there is one.
// ERR_EXISTS: a file is there already and `force` is not given.
static enum status objects_serve(const char *objects, const char *folder, bool force)
{
    struct thing_list things;
    enum status status = thing_list_read(objects, &things);
    for (int i = 0; i < things.count && status == OK; i++)
        status = write_thing(&things.things[i], objects, folder, force);
    if (status == OK)
        printf("%s: %d things; any web server can show this folder, for example nginx, with default_type "
               "application/ld+json\n",
               folder, things.count);
    thing_list_free(&things);
    return status;
}

// ---------------------------------------------------------------- objects list

// reenact-capture objects list and note: the things of a recording, and what is written of them by hand.

static enum status read_things(const char *path, struct recorded_thing **things, int *count)
{
    struct recording *r;
    *things = NULL;
    *count = 0;
    enum status status = recording_open(&r, path);
    if (status == OK)
        status = recording_read_things(r, things, count);
    recording_free(&r);
    return status;
}

static void knowledge_of(const struct recorded_thing *t, struct thing_knowledge *k)
{
    if (!t->knowledge || thing_knowledge_parse(t->knowledge, strlen(t->knowledge), t->url, k) != OK)
        *k = (struct thing_knowledge){0};
}

static double sigma_m(const struct recorded_thing *t) { return sqrt(covariance3_trace(&t->covariance)); }

static void print_thing(const struct recorded_thing *t)
{
    const struct vec3 at = t->world_from_thing.translation;
    struct thing_knowledge k;
    knowledge_of(t, &k);
    printf("%s at %.3f %.3f %.3f m", t->name, at.x, at.y, at.z);
    if (sigma_m(t) > 0)
        printf(", to %.1f mm", 1e3 * sigma_m(t));
    printf("%s\n", t->gone ? ", gone" : "");
    const char *const lines[][2] = {{"name", k.name},         {"description", k.description},   {"weight", k.weight},
                                    {"material", k.material}, {"instructions", k.instructions}, {"model", k.model},
                                    {"note", t->note}};
    for (size_t i = 0; i < COUNT_OF(lines); i++)
        if (lines[i][1][0])
            printf("  %s: %s\n", lines[i][0], lines[i][1]);
}

static void add_thing(struct json *list, const struct recorded_thing *t)
{
    struct json *thing = json_add_object(list, NULL), *at = json_add_array(thing, "position_m");
    const struct vec3 p = t->world_from_thing.translation;
    struct thing_knowledge k;
    knowledge_of(t, &k);
    json_push_number(at, p.x);
    json_push_number(at, p.y);
    json_push_number(at, p.z);
    json_add_string(thing, "name", t->name);
    json_add_number(thing, "sigma_m", sigma_m(t));
    json_add_number(thing, "sightings", t->sightings);
    json_add_bool(thing, "gone", t->gone);
    json_add_string(thing, "url", t->url);
    json_add_string(thing, "note", t->note);
    json_add_string(thing, "description", k.description);
    json_add_string(thing, "weight", k.weight);
    json_add_string(thing, "material", k.material);
    json_add_string(thing, "instructions", k.instructions);
    json_add_string(thing, "model", k.model);
}

// Prints the things of a recording and what is known of them.
static enum status objects_list(const char *path, bool as_json)
{
    struct recorded_thing *things;
    int count;
    enum status status = read_things(path, &things, &count);
    if (status == OK && as_json) {
        struct json *root = json_new_object(), *list = json_add_array(root, "things");
        for (int i = 0; i < count; i++)
            add_thing(list, &things[i]);
        status = command_print_json(&root);
    }
    for (int i = 0; i < count && status == OK && !as_json; i++)
        print_thing(&things[i]);
    char shown[TEXT_SHOWN_BYTES];
    if (status == OK && !count && !as_json)
        printf("%s holds no things; reenact-capture objects finds them, and objects note --at adds one\n",
               text_shown(path, shown));
    recorded_things_free(&things, count);
    return status;
}

// Writes a note to a thing of a recording; `at`, world axes: puts it there, and adds it if there is none of that name.
static enum status objects_note(const char *path, const char *name, const char *text, const struct vec3 *at)
{
    struct recorded_thing *things, *grown;
    int count, i = 0;
    enum status status = read_things(path, &things, &count);
    if (status != OK)
        return status;
    while (i < count && strcmp(things[i].name, name))
        i++;
    if (!text_is_printable(name) || !text_is_printable(text))
        status = fail(ERR_INPUT, "a name or note must be UTF-8 without control characters");
    else if (strlen(name) >= sizeof things->name || strlen(text) >= sizeof things->note)
        status = fail(ERR_INPUT, "a name has at most %zu bytes, a note %zu", sizeof things->name - 1,
                      sizeof things->note - 1);
    else if (i == count && !at)
        status = fail(ERR_MISSING, "%s has no thing '%s'; with --at X,Y,Z it is added", path, name);
    else if (i == count && !(grown = realloc(things, sizeof *grown * ((size_t)count + 1))))
        status = fail(ERR_MEMORY, "no memory for another thing");
    if (status == OK && i == count) {
        things = grown;
        things[count++] = (struct recorded_thing){.world_from_thing = POSE_IDENTITY};
        strcpy(things[i].name, name);
    }
    if (status == OK) {
        strcpy(things[i].note, text);
        if (at)
            things[i].world_from_thing.translation = *at;
        status = recording_write_things(path, things, count);
    }
    recorded_things_free(&things, count);
    return status;
}

// ---------------------------------------------------------------- objects into

// Keeping things in a recording, with what a knowledge base says of them.

static const struct recorded_thing *find(const struct recorded_thing *things, int count, const char *name)
{
    for (int i = 0; i < count; i++)
        if (!strcmp(things[i].name, name))
            return &things[i];
    return NULL;
}

// The thing as the map has it now; what the recording knows of it already goes on.
static enum status make_thing(struct recorded_thing *out, const struct recorded_thing *before,
                              const struct mapped_thing *t, const struct thing *thing)
{
    enum status status = OK;
    *out = (struct recorded_thing){0};
    if (before)
        status = recorded_thing_copy(out, before);
    strcpy(out->name, thing->name);
    out->world_from_thing = t->world_from_thing;
    out->covariance = t->covariance;
    out->width_m = thing->width_m;
    out->height_m = thing->height_m;
    out->sightings = t->sightings + (t->known && before ? before->sightings : 0);
    out->gone = t->gone;
    return status;
}

static void ask_knowledge(const struct objects_arguments *a, const char *reference, struct recorded_thing *out)
{
    struct http_limits limits = http_default_limits();
    struct thing_update update;
    limits.login = a->knowledge;
    thing_update_ask(out, a->knowledge, reference, &limits, &update);
    if (update.trouble[0])
        fprintf(stderr, "warning: nothing new is known of '%s': %s\n", out->name, update.trouble);
    if (update.content_trouble[0])
        fprintf(stderr, "warning: '%s': %s\n", out->name, update.content_trouble);
}

// Fills now[]; *written: how many it holds, also after a failure.
static enum status collect(const struct thing_map *map, const struct thing_list *things,
                           const struct objects_arguments *a, const struct recorded_thing *before, int count,
                           struct recorded_thing *now, int *written)
{
    enum status status = OK;
    for (int i = 0; i < map->count && status == OK; i++) {
        if (!map->things[i].sightings && !map->things[i].gone) // known, and out of sight
            continue;
        const struct thing *thing = &things->things[map->things[i].thing];
        struct recorded_thing *out = &now[(*written)++];
        status = make_thing(out, find(before, count, thing->name), &map->things[i], thing);
        if (status == OK && a->knowledge && thing->url[0])
            ask_knowledge(a, thing->url, out);
    }
    const int mapped = *written;
    for (int i = 0; i < count && status == OK; i++)
        if (!find(now, mapped, before[i].name)) // not seen in this run, or named by hand
            status = recorded_thing_copy(&now[(*written)++], &before[i]);
    return status;
}

// Keeps the things of a map in the recording a->into, in place of those of the same names; what is known of them goes
// on, and a->knowledge is asked for more, with pictures and models: what fails costs a warning. Things that the map
// lacks stay. ERR_… of the recording.
static enum status objects_into(const struct thing_map *map, const struct thing_list *things,
                                const struct objects_arguments *a)
{
    struct recording *recording;
    struct recorded_thing *before = NULL, *now = NULL;
    int count = 0, written = 0;
    enum status status = recording_open(&recording, a->into);
    if (status == OK)
        status = recording_read_things(recording, &before, &count);
    recording_free(&recording);
    if (status == OK && !(now = calloc((size_t)(map->count + count) + 1, sizeof *now)))
        status = fail(ERR_MEMORY, "no memory for the things of %s", a->into);
    if (status == OK)
        status = collect(map, things, a, before, count, now, &written);
    if (status == OK)
        status = recording_write_things(a->into, now, written);
    recorded_things_free(&now, written);
    recorded_things_free(&before, count);
    return status;
}

// ---------------------------------------------------------------- objects search

// Of a camera's images those are searched that were taken so far from the last one that was, metres or radians, and at
// most so many: chosen by hand.
#define APART_M   0.15
#define APART_RAD 0.26
enum { MOST_IMAGES = 40 };
// Of a sweep: bounds the time, about half a second a picture with eight things.
enum { MOST_PICTURES = 96 };

struct search_run {
    const struct objects_arguments *arguments;
    struct thing_list things;
    struct place place;
    struct thing_search *search;
    struct thing_map map;
    const struct thing_map *earlier; // what is only known from an earlier sweep's views; NULL: nothing
    int images, searched, sightings, contradicted;
};

static enum status open_run(struct search_run *r, const struct objects_arguments *a)
{
    *r = (struct search_run){.arguments = a};
    enum status status = thing_list_read(a->objects, &r->things);
    if (status == OK)
        status = place_input_read(a->into, &r->place);
    if (status == NOTHING)
        status = fail(ERR_INPUT, "%s holds no place; film one with map --out", a->into);
    return status == OK ? thing_search_open(&r->search, &r->things) : status;
}

static void close_run(struct search_run *r)
{
    thing_search_close(&r->search);
    place_free(&r->place);
    thing_list_free(&r->things);
}

// What was not seen again stays as the earlier sweep's views showed it.
static void take_earlier(struct search_run *r)
{
    for (int i = 0; r->earlier && i < r->earlier->count; i++)
        for (int k = 0; k < r->map.count; k++)
            if (r->map.things[k].thing == r->earlier->things[i].thing && !r->map.things[k].sightings) {
                const bool gone = r->map.things[k].gone;
                r->map.things[k] = r->earlier->things[i];
                r->map.things[k].gone = gone;
            }
}

static enum status finish(struct search_run *r)
{
    enum status status = thing_search_finish(r->search, &r->map, &r->sightings, &r->contradicted);
    take_earlier(r);
    if (status == OK)
        status = objects_into(&r->map, &r->things, r->arguments);
    if (status == OK && r->contradicted)
        fprintf(stderr,
                "warning: %d sightings were left out, because depth says another distance than the size: are pictures "
                "of the things on a wall, or sizes wrong in %s?\n",
                r->contradicted, r->arguments->objects);
    return status;
}

// ---------------------------------------------------------------- a sweep

static enum status search_picture(struct thing_search *search, const struct calibration *c, const struct place_view *v,
                                  const struct lens *depth_lens)
{
    const struct depth_view depth = {v->depth, *depth_lens, pose_inverse(c->color_from_depth)};
    uint8_t *rgb = malloc((size_t)c->color.width * (size_t)c->color.height * 3);
    enum status status = rgb ? jpeg_decode(v->jpeg, v->jpeg_bytes, rgb, c->color.width, c->color.height)
                             : fail(ERR_MEMORY, "no memory for a picture of the place");
    if (status == OK)
        status = thing_search_add(search, &c->color, v->world_from_camera, rgb,
                                  v->depth && depth_lens->width ? &depth : NULL);
    free(rgb);
    return status;
}

static int index_of(const struct thing_list *things, const char *name)
{
    for (int i = 0; i < things->count; i++)
        if (!strcmp(things->things[i].name, name))
            return i;
    return -1;
}

// What the recording knows of the list's things; *unknown: how many it does not.
static enum status expect_recorded(struct search_run *r, bool known[THINGS_MOST], int *unknown)
{
    struct recording *recording;
    struct recorded_thing *things = NULL;
    int count = 0;
    enum status status = recording_open(&recording, r->arguments->into);
    *unknown = r->things.count;
    if (status != OK)
        return status;
    status = recording_read_things(recording, &things, &count);
    recording_free(&recording);
    for (int i = 0; i < count && status == OK; i++) {
        const int thing = index_of(&r->things, things[i].name);
        if (thing < 0)
            continue;
        thing_search_expect(r->search, thing, &things[i].world_from_thing, &things[i].covariance);
        known[thing] = true;
        --*unknown;
    }
    recorded_things_free(&things, count);
    return status;
}

// Things that were not looked for yet, in the views of the place as it was before the sweep.
static enum status search_before(struct search_run *r, const struct place *before, struct thing_map *out)
{
    struct thing_search *search;
    int sightings, contradicted;
    enum status status = thing_search_open(&search, &r->things);
    for (int i = 0; i < before->view_count && status == OK && !command_stopped(); i++)
        if (before->views[i].jpeg && before->calibration.color.width)
            status = search_picture(search, &before->calibration, &before->views[i], &before->calibration.depth);
    if (status == OK)
        status = thing_search_finish(search, out, &sightings, &contradicted);
    thing_search_close(&search);
    return status;
}

static enum status expect(struct search_run *r, const struct place *before, struct thing_map *earlier)
{
    bool known[THINGS_MOST] = {false};
    int unknown;
    enum status status = expect_recorded(r, known, &unknown);
    if (status == OK && unknown && before->view_count)
        status = search_before(r, before, earlier);
    int count = 0;
    for (int i = 0; i < earlier->count && status == OK; i++) {
        const struct mapped_thing *t = &earlier->things[i];
        if (known[t->thing])
            continue; // what the recording says is newer
        thing_search_expect(r->search, t->thing, &t->world_from_thing, &t->covariance);
        earlier->things[count++] = *t;
    }
    earlier->count = count;
    return status;
}

// The sharp pictures with a pose; of more than MOST_PICTURES the sharpest of each of so many equal parts. Returns their
// number.
static int choose_pictures(const struct objects_sweep *sweep, struct place_view out[SWEEP_PICTURES_MOST])
{
    const struct sweep_pictures *s = sweep->pictures;
    double sharpness[SWEEP_PICTURES_MOST];
    int usable = 0, count = 0, last = -1;
    for (int i = 0; i < s->count; i++) {
        const struct sweep_picture *p = &s->pictures[i];
        out[usable] = (struct place_view){.jpeg = p->jpeg, .jpeg_bytes = p->jpeg_bytes, .depth = p->depth};
        sharpness[usable] = p->sharpness;
        usable +=
            sweep_picture_is_sharp(s, i) && mapper_pose(sweep->mapper, p->time_ns, &out[usable].world_from_camera);
    }
    for (int i = 0; i < usable; i++) {
        const int part = usable <= MOST_PICTURES ? i : i * MOST_PICTURES / usable;
        if (part != last)
            count++;
        else if (sharpness[i] <= sharpness[count - 1])
            continue;
        last = part;
        out[count - 1] = out[i];
        sharpness[count - 1] = sharpness[i];
    }
    return count;
}

static enum status search_sweep(struct search_run *r, const struct objects_sweep *sweep)
{
    struct place_view pictures[SWEEP_PICTURES_MOST];
    struct progress_bar bar;
    enum status status = OK;
    const int count = choose_pictures(sweep, pictures);
    progress_bar_start(&bar, "looking for things", count);
    for (int i = 0; i < count && status == OK && !command_stopped(); i++) {
        status = search_picture(r->search, &sweep->pictures->calibration, &pictures[i], &sweep->pictures->depth_lens);
        r->searched++;
        progress_bar_step(&bar);
    }
    progress_bar_end(&bar);
    return status;
}

enum status objects_in_sweep(const struct objects_arguments *a, const struct objects_sweep *sweep,
                             struct objects_found *found)
{
    struct search_run r;
    struct thing_map earlier = {.count = 0};
    *found = (struct objects_found){0};
    enum status status = open_run(&r, a);
    if (status == OK)
        status = expect(&r, sweep->before, &earlier);
    if (status == OK)
        status = search_sweep(&r, sweep);
    r.earlier = &earlier;
    if (status == OK)
        status = finish(&r);
    for (int i = 0; i < r.map.count; i++) {
        found->things += r.map.things[i].sightings > 0;
        found->gone += r.map.things[i].gone;
    }
    found->searched = r.searched;
    close_run(&r);
    return status;
}

// ---------------------------------------------------------------- a camera

struct camera_run {
    struct source_frames frames;
    struct camera_tracker *tracker;
    struct pose last;
    int64_t first_ns;
};

static enum status search_image(struct search_run *r, struct camera_run *c, const struct frame *frame)
{
    struct location at;
    struct camera_motion motion;
    r->images++;
    const enum status located = camera_tracker_process(c->tracker, frame->color, NULL, frame->time_ns, &at, &motion);
    if (located != OK)
        return located < 0 && located != ERR_ORDER ? located : OK;
    const struct pose pose = at.world_from_camera;
    if (r->searched && v3_distance(pose.translation, c->last.translation) < APART_M &&
        pose_angle(pose, c->last) < APART_RAD)
        return OK;
    c->last = pose;
    r->searched++;
    return thing_search_add(r->search, camera_tracker_lens(c->tracker), pose, frame->color, NULL);
}

static enum status search_images(struct search_run *r, struct camera_run *c)
{
    struct progress_bar bar;
    struct frame frame;
    enum status status = OK;
    progress_bar_start(&bar, "looking for things", source_remaining(c->frames.source));
    while (status == OK && r->searched < MOST_IMAGES && (status = source_frames_next(&c->frames, &frame)) == OK) {
        if (c->frames.count == 1)
            c->first_ns = frame.time_ns;
        if (r->arguments->seconds > 0 && (double)(frame.time_ns - c->first_ns) * 1e-9 > r->arguments->seconds)
            break;
        if (frame.color)
            status = search_image(r, c, &frame);
        progress_bar_step(&bar);
    }
    progress_bar_end(&bar);
    return status == NOTHING ? OK : status;
}

static enum status report_search(const struct search_run *r)
{
    if (!r->arguments->json) {
        printf("%s: %d things, %d sightings in %d of %d images\n", r->arguments->into, r->map.count, r->sightings,
               r->searched, r->images);
        return OK;
    }
    struct json *root = json_new_object();
    json_add_string(root, "file", r->arguments->into);
    json_add_number(root, "things", r->map.count);
    json_add_number(root, "images", r->images);
    json_add_number(root, "searched", r->searched);
    json_add_number(root, "sightings", r->sightings);
    return command_print_json(&root);
}

// Looks in the images of a->camera, for a->seconds (0: until its end, or Ctrl-C).
static enum status objects_by_camera(const struct objects_arguments *a)
{
    struct search_run r;
    struct camera_run c = {.tracker = NULL};
    const struct locator_options how = locator_default_options();
    enum status status = open_run(&r, a);
    if (status == OK)
        status = source_open(&c.frames.source, a->camera, SOURCE_CAMERA);
    if (status == OK)
        status = camera_tracker_open(&c.tracker, &r.place, &source_calibration(c.frames.source)->color, &how);
    if (status == OK) {
        command_catch_signals();
        status = search_images(&r, &c);
    }
    if (status == OK && !r.searched)
        status = fail(ERR_INPUT, "no image of %s could be localised in the place of %s", a->camera, a->into);
    if (status == OK)
        status = finish(&r);
    if (status == OK)
        status = report_search(&r);
    if (status == OK)
        status = source_frames_end(&c.frames);
    camera_tracker_close(&c.tracker);
    source_close(&c.frames.source);
    close_run(&r);
    return status;
}

// ---------------------------------------------------------------- capture objects

enum {
    KEY_STEREO = COMMAND_KEY,
    KEY_RIG,
    KEY_OBJECTS,
    KEY_OUT,
    KEY_INTO,
    KEY_KNOWLEDGE,
    KEY_FORCE,
    KEY_JSON,
    KEY_CAMERA,
    KEY_SECONDS
};

static const struct argp_option options[] = {
    {"stereo", KEY_STEREO, "PAIRS.txt", 0, "pairs of pictures with the left camera's pose in the world", 0},
    {"rig", KEY_RIG, "RIG.json", 0, "the two cameras, as reenact-capture calibrate --stereo writes them", 0},
    {"camera", KEY_CAMERA, "URI", 0,
     "instead of pairs: libcamera, libcamera:N or folder:DIR, localised in the place of --into FILE; distances come "
     "from "
     "the things' sizes",
     0},
    {"seconds", KEY_SECONDS, "S", 0, "with --camera: look for S seconds; without it until it ends or Ctrl-C", 0},
    {"objects", KEY_OBJECTS, "OBJECTS.json", 0, "what to look for: names, reference pictures, sizes, URLs", 0},
    {"out", KEY_OUT, "FILE.json", 0, "where to write what was found", 0},
    {"into", KEY_INTO, "FILE", 0, "instead: keep the things in this recording's place, in whose axes the poses are", 0},
    {"knowledge", KEY_KNOWLEDGE, "URL", 0,
     "with --into: ask this knowledge base what is known of each thing; what was known stays if it does not answer", 0},
    {"force", KEY_FORCE, NULL, 0, "write over FILE.json", 0},
    COMMAND_OPTION_JSON(KEY_JSON),
    {0},
};

static error_t parse(int key, char *value, struct argp_state *state)
{
    struct objects_arguments *a = state->input;
    switch (key) {
    case KEY_STEREO: a->pairs = value; return 0;
    case KEY_RIG: a->rig = value; return 0;
    case KEY_CAMERA: a->camera = value; return 0;
    case KEY_SECONDS: a->seconds = command_parse_number(state, "--seconds", value, 0.1, 1e6); return 0;
    case KEY_OBJECTS: a->objects = value; return 0;
    case KEY_OUT: a->out = value; return 0;
    case KEY_INTO: a->into = value; return 0;
    case KEY_KNOWLEDGE: a->knowledge = value; return 0;
    case KEY_FORCE: a->force = true; return 0;
    case KEY_JSON: a->json = true; return 0;
    case ARGP_KEY_ARG:
        exit(command_unknown(state->name, "action", value, (const char *const[]){"list", "note", "serve"}, 3));
    case ARGP_KEY_END:
        command_require(state, a->objects, "--objects OBJECTS.json");
        if (a->camera) {
            command_require(state, a->into, "--into FILE");
            if (a->out || a->pairs || a->rig)
                argp_error(state, "--camera goes with --into FILE, not with --out, --stereo or --rig");
            return 0;
        }
        command_require(state, a->pairs, "--stereo PAIRS.txt");
        command_require(state, a->rig, "--rig RIG.json");
        if (!a->into == !a->out)
            argp_error(state, "either --out FILE.json, or --into FILE, an existing recording");
        return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static error_t parse_serve(int key, char *value, struct argp_state *state)
{
    struct objects_arguments *a = state->input;
    switch (key) {
    case KEY_OBJECTS: a->objects = value; return 0;
    case KEY_FORCE: a->force = true; return 0;
    case ARGP_KEY_ARG: command_take_file(state, &a->out, value); return 0;
    case ARGP_KEY_END:
        command_require(state, a->out, "DIR");
        command_require(state, a->objects, "--objects OBJECTS.json");
        return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static int serve(int argc, char **argv)
{
    static const struct argp_option serve_options[] = {
        {"objects", KEY_OBJECTS, "OBJECTS.json", 0, "the things; NAME.txt beside it describes the thing NAME", 0},
        {"force", KEY_FORCE, NULL, 0, "write over files in DIR", 0},
        {0},
    };
    struct objects_arguments a = {0};
    const struct argp argp = {serve_options,
                              parse_serve,
                              "DIR --objects OBJECTS.json",
                              "Write a folder of JSON-LD and pictures that a web server shows as a knowledge base.",
                              NULL,
                              NULL,
                              NULL};
    command_parse(&argp, argc, argv, &a);
    return objects_serve(a.objects, a.out, a.force) == OK ? 0 : command_failed(argv[0]);
}

struct note_arguments {
    const char *path, *thing, *text;
    struct vec3 at;
    bool has_place, json;
};

enum { KEY_THING = COMMAND_KEY + 20, KEY_TEXT, KEY_AT };

// "1.5,0,-2": decimal metres, at most 100 km off.
static struct vec3 parse_point(const struct argp_state *state, const char *value)
{
    enum { MOST_M = 100000 };
    char text[128], *rest = text;
    double at[3] = {0, 0, 0};
    bool good = snprintf(text, sizeof text, "%s", value) < (int)sizeof text;
    for (int k = 0; k < 3 && good; k++) {
        char *comma = strchr(rest, ',');
        good = (k < 2) == (comma != NULL);
        if (comma)
            *comma = 0;
        good = good && text_number(rest, &at[k]) && fabs(at[k]) <= MOST_M;
        rest = comma ? comma + 1 : rest;
    }
    if (!good)
        argp_error(state, "--at takes X,Y,Z in metres, at most %d, not '%s'", MOST_M, value);
    return v3(at[0], at[1], at[2]);
}

static error_t parse_note(int key, char *value, struct argp_state *state)
{
    struct note_arguments *a = state->input;
    switch (key) {
    case KEY_JSON: a->json = true; return 0;
    case KEY_THING: a->thing = value; return 0;
    case KEY_TEXT: a->text = value; return 0;
    case KEY_AT:
        a->at = parse_point(state, value);
        a->has_place = true;
        return 0;
    case ARGP_KEY_ARG: command_take_file(state, &a->path, value); return 0;
    case ARGP_KEY_END: command_require(state, a->path, "FILE"); return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static int list(int argc, char **argv)
{
    static const struct argp_option list_options[] = {COMMAND_OPTION_JSON(KEY_JSON), {0}};
    struct note_arguments a = {0};
    const struct argp argp = {.options = list_options,
                              .parser = parse_note,
                              .args_doc = "FILE",
                              .doc = "List the things of a recording and what is known of them."};
    command_parse(&argp, argc, argv, &a);
    return objects_list(a.path, a.json) == OK ? 0 : command_failed(argv[0]);
}

static int note(int argc, char **argv)
{
    static const struct argp_option note_options[] = {
        {"thing", KEY_THING, "NAME", 0, "which thing", 0},
        {"text", KEY_TEXT, "TEXT", 0, "what to write of it; empty: the note goes", 0},
        {"at", KEY_AT, "X,Y,Z", 0, "where it stands, in the place's axes, metres; a new name is added", 0},
        {0},
    };
    struct note_arguments a = {0};
    const struct argp argp = {.options = note_options,
                              .parser = parse_note,
                              .args_doc = "FILE --thing NAME --text TEXT [--at X,Y,Z]",
                              .doc = "Write a note to a thing of a recording, or name a new one by hand."};
    command_parse(&argp, argc, argv, &a);
    if (!a.thing || !a.text) {
        fprintf(stderr, "%s: --thing NAME and --text TEXT are needed\n", argv[0]);
        return 2;
    }
    return objects_note(a.path, a.thing, a.text, a.has_place ? &a.at : NULL) == OK ? 0 : command_failed(argv[0]);
}

int capture_objects(int argc, char **argv)
{
    static const struct {
        const char *name;
        int (*run)(int argc, char **argv);
    } actions[] = {{"list", list}, {"note", note}, {"serve", serve}};
    for (size_t i = 0; i < COUNT_OF(actions) && argc > 1; i++) {
        char name[160]; // as its sentences begin
        if (strcmp(argv[1], actions[i].name))
            continue;
        snprintf(name, sizeof name, "%s %s", argv[0], argv[1]);
        argv[1] = name;
        return actions[i].run(argc - 1, argv + 1);
    }
    struct objects_arguments a = {0};
    const struct argp argp = {
        options,
        parse,
        "--stereo PAIRS.txt --rig RIG.json --objects OBJECTS.json (--out FILE.json | --into FILE)\n"
        "--camera URI --objects OBJECTS.json --into FILE\n"
        "serve DIR --objects OBJECTS.json\n"
        "list FILE\n"
        "note FILE --thing NAME --text TEXT [--at X,Y,Z]",
        "Find known things before a stereo rig, or a camera in a known place, and say where they stand.",
        NULL,
        NULL,
        NULL};
    command_parse(&argp, argc, argv, &a);
    enum status status = a.out ? file_check_output(a.out, a.force) : recording_check_change(a.into);
    if (status == OK)
        status = a.camera ? objects_by_camera(&a) : objects_run(&a);
    return status == OK ? 0 : command_failed(argv[0]);
}
