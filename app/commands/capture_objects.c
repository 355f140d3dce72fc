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
                                const struct objects_arguments *arguments);

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

static enum status open_views(const struct run *run, const struct stereo_pair *pair, bool features,
                              struct thing_view out[2])
{
    const struct lens *lenses[2] = {&run->rig.left, &run->rig.right};
    const struct pose from_left[2] = {POSE_IDENTITY, pose_inverse(run->rig.left_from_right)};
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

static enum status find_in_pair(struct run *run, int pair)
{
    struct pair_result *p = &run->results[pair];
    struct thing_view views[2];
    const int64_t begin = clock_now_ns();
    enum status status = open_views(run, &run->pairs[pair], true, views);
    if (status != OK)
        return status;
    status = recognizer_find(run->recognizer, views, 2, p->detections, &p->detected);
    close_views(views);
    run->find_ns += clock_now_ns() - begin;
    for (int i = 0; i < p->detected && status == OK; i++)
        thing_traits_add(&run->traits[p->detections[i].thing], run->recognizer, &p->detections[i]);
    return status;
}

static enum status refine_pair(struct run *run, int pair)
{
    struct pair_result *p = &run->results[pair];
    struct thing_view views[2];
    if (!p->detected)
        return OK;
    enum status status = open_views(run, &run->pairs[pair], false, views);
    if (status != OK)
        return status;
    for (int i = 0; i < p->detected && status >= OK; i++) {
        status = recognizer_refine(run->recognizer, &p->detections[i], &run->traits[p->detections[i].thing], views, 2,
                                   &p->sightings[p->seen]);
        if (status == OK)
            sighting_add_rig_error(&p->sightings[p->seen++], &run->rig.error_at_1m);
    }
    close_views(views);
    return status < OK ? status : OK;
}

static void add_covariance(struct json *thing, const char *name, const struct covariance3 *covariance3)
{
    const double values[6] = {covariance3->xx, covariance3->xy, covariance3->xz,
                              covariance3->yy, covariance3->yz, covariance3->zz};
    struct json *list = json_add_array(thing, name);
    for (int i = 0; i < 6; i++)
        json_push_number(list, values[i]);
}

static void add_map(const struct run *run, struct json *root)
{
    struct json *map = json_add_array(root, "map");
    for (int i = 0; i < run->map.count; i++) {
        const struct mapped_thing *t = &run->map.things[i];
        struct json *thing = json_add_object(map, NULL);
        json_add_string(thing, "name", run->things.things[t->thing].name);
        json_add_number(thing, "x_m", t->world_from_thing.translation.x);
        json_add_number(thing, "y_m", t->world_from_thing.translation.y);
        json_add_number(thing, "z_m", t->world_from_thing.translation.z);
        add_covariance(thing, "covariance_m2", &t->covariance);
        json_add_number(thing, "sightings", t->sightings);
        json_add_number(thing, "moves", t->moves);
        json_add_bool(thing, "gone", t->gone);
    }
}

static char *print_result(const struct run *run)
{
    static const char *const shapes[THING_SHAPES] = {"flat", "turned"};
    const double degrees = 180 / 3.14159265358979324;
    struct json *root = json_new_object(), *pairs = json_add_array(root, "pairs");
    for (int i = 0; i < run->count; i++) {
        struct json *pair = json_add_object(pairs, NULL);
        json_add_number(pair, "time", run->pairs[i].time_s);
        struct json *things = json_add_array(pair, "things");
        for (int k = 0; k < run->results[i].seen; k++) {
            const struct sighting *s = &run->results[i].sightings[k];
            struct json *thing = json_add_object(things, NULL);
            json_add_string(thing, "name", run->things.things[s->thing].name);
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
    add_map(run, root);
    char *text = json_print(root);
    json_free(&root);
    return text;
}

// A thing of the map that lies well inside both images, near enough, must be found; otherwise that is noted.
static void note_misses(struct run *run, int pair)
{
    const struct pair_result *p = &run->results[pair];
    const struct pose left_from_world = pose_inverse(run->pairs[pair].world_from_left);
    for (int i = 0; i < run->map.count; i++) {
        bool seen = false;
        for (int k = 0; k < p->seen; k++)
            seen = seen || p->sightings[k].thing == run->map.things[i].thing;
        const struct vec3 at = pose_apply(left_from_world, run->map.things[i].world_from_thing.translation);
        const struct thing *t = &run->things.things[run->map.things[i].thing];
        const struct vec3 in_right = pose_apply(pose_inverse(run->rig.left_from_right), at);
        if (seen || !(at.z > 0.3 && at.z < 1.2 && in_right.z > 0.2))
            continue;
        const double margin = run->rig.left.fx * (t->width_m + t->height_m) / 2 / at.z + 20;
        const struct pixel px[2] = {lens_project_clamped(&run->rig.left, lens_max_radius2(&run->rig.left), at),
                                    lens_project_clamped(&run->rig.right, lens_max_radius2(&run->rig.right), in_right)};
        bool inside = true;
        for (int k = 0; k < 2; k++)
            inside = inside && px[k].x > margin && px[k].y > margin && px[k].x < run->rig.left.width - margin &&
                     px[k].y < run->rig.left.height - margin;
        if (inside)
            thing_map_miss(&run->map, run->map.things[i].thing);
    }
}

static void map_all(struct run *run)
{
    for (int i = 0; i < run->count; i++) {
        for (int k = 0; k < run->results[i].seen; k++)
            thing_map_add(&run->map, &run->results[i].sightings[k], &run->pairs[i].world_from_left);
        note_misses(run, i);
    }
}

static enum status recognise_all(struct run *run)
{
    struct progress_bar bar;
    enum status status = OK;
    progress_bar_start(&bar, "recognising", 2 * run->count);
    for (int i = 0; i < run->count && status == OK; i++) {
        status = find_in_pair(run, i);
        progress_bar_step(&bar);
    }
    for (int i = 0; i < run->count && status == OK; i++) {
        status = refine_pair(run, i);
        progress_bar_step(&bar);
    }
    progress_bar_end(&bar);
    return status;
}

static enum status write_out(const struct run *run, const struct objects_arguments *arguments)
{
    char *text = print_result(run);
    const enum status status = text ? file_write(arguments->out, text, strlen(text))
                                    : fail(ERR_MEMORY, "no memory to write %s", arguments->out);
    free(text);
    return status;
}

static enum status report_run(const struct run *run, const struct objects_arguments *arguments)
{
    int seen = 0;
    for (int i = 0; i < run->count; i++)
        seen += run->results[i].seen;
    if (!arguments->json) {
        printf("%s: %d things, %d sightings in %d pairs, %.2f s a pair\n",
               arguments->out ? arguments->out : arguments->into, run->map.count, seen, run->count,
               1e-9 * (double)run->find_ns / run->count);
        return OK;
    }
    struct json *root = json_new_object();
    json_add_string(root, "file", arguments->out ? arguments->out : arguments->into);
    json_add_number(root, "things", run->map.count);
    json_add_number(root, "pairs", run->count);
    json_add_number(root, "sightings", seen);
    json_add_number(root, "seconds_per_pair", 1e-9 * (double)run->find_ns / run->count);
    return command_print_json(&root);
}

// Recognises in all pairs, learns each thing's shape and size from all of them, aligns once more, writes and reports.
// ERR_… of what it reads and writes.
static enum status objects_run(const struct objects_arguments *arguments)
{
    struct run *r = calloc(1, sizeof *r);
    if (!r)
        return fail(ERR_MEMORY, "no memory");
    enum status status = stereo_rig_read(arguments->rig, &r->rig);
    if (status == OK)
        status = thing_list_read(arguments->objects, &r->things);
    if (status == OK)
        status = stereo_pairs_read(arguments->pairs, &r->pairs, &r->count);
    if (status == OK && !(r->results = calloc((size_t)r->count, sizeof *r->results)))
        status = fail(ERR_MEMORY, "no memory for %d pairs", r->count);
    if (status == OK)
        status = recognizer_open(&r->recognizer, &r->things, NULL);
    if (status == OK)
        status = recognise_all(r);
    if (status == OK) {
        map_all(r);
        status = arguments->into ? objects_into(&r->map, &r->things, arguments) : write_out(r, arguments);
    }
    if (status == OK)
        status = report_run(r, arguments);
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
static bool path_of(const struct thing *thing, char *out, size_t bytes)
{
    const char *path = strstr(thing->url, "://");
    path = path ? strchr(path + 3, '/') : thing->url;
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

static enum status write_picture(const struct thing *thing, const char *path, bool force)
{
    const struct png_layout layout = {PNG_RGB8, thing->picture.width, thing->picture.height};
    uint8_t *bytes;
    size_t count;
    enum status status = png_encode(&layout, thing->picture.rgb, 6, &bytes, &count);
    if (status == OK) {
        status = write_new(path, bytes, count, force);
        free(bytes);
    }
    return status;
}

// The description is what a text file beside the list says of the thing.
static enum status read_description(struct thing_knowledge *knowledge, const char *path)
{
    struct text_file file;
    enum status status = text_file_open(&file, path);
    if (status != OK)
        return status;
    snprintf(knowledge->description, sizeof knowledge->description, "%s", file.next);
    text_make_utf8(knowledge->description); // where it is cut, too
    text_file_close(&file);
    return OK;
}

static enum status write_thing(const struct thing *thing, const char *objects, const char *folder, bool force)
{
    char path[1024], file[2048], picture[2100], run_note[2048];
    struct thing_knowledge k = {0};
    if (!path_of(thing, path, sizeof path))
        return fail(ERR_INPUT, "'%s': its url '%s' is no path below a folder", thing->name, thing->url);
    snprintf(file, sizeof file, "%s/%s", folder, path);
    snprintf(picture, sizeof picture, "%s.png", file);
    const char *slash = strrchr(objects, '/');
    snprintf(run_note, sizeof run_note, "%.*s%s.txt", slash ? (int)(slash - objects + 1) : 0, objects, thing->name);
    snprintf(k.name, sizeof k.name, "%s", thing->name);
    snprintf(k.description, sizeof k.description, "%.0f x %.0f mm", 1000 * thing->width_m, 1000 * thing->height_m);
    enum status status = file_exists(run_note) ? read_description(&k, run_note) : OK;
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
    return status == OK ? write_picture(thing, picture, force) : status;
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

static void knowledge_of(const struct recorded_thing *thing, struct thing_knowledge *knowledge)
{
    if (!thing->knowledge ||
        thing_knowledge_parse(thing->knowledge, strlen(thing->knowledge), thing->url, knowledge) != OK)
        *knowledge = (struct thing_knowledge){0};
}

static double sigma_m(const struct recorded_thing *thing) { return sqrt(covariance3_trace(&thing->covariance)); }

static void print_thing(const struct recorded_thing *thing)
{
    const struct vec3 at = thing->world_from_thing.translation;
    struct thing_knowledge k;
    knowledge_of(thing, &k);
    printf("%s at %.3f %.3f %.3f m", thing->name, at.x, at.y, at.z);
    if (sigma_m(thing) > 0)
        printf(", to %.1f mm", 1e3 * sigma_m(thing));
    printf("%s\n", thing->gone ? ", gone" : "");
    const char *const lines[][2] = {{"name", k.name},         {"description", k.description},   {"weight", k.weight},
                                    {"material", k.material}, {"instructions", k.instructions}, {"model", k.model},
                                    {"note", thing->note}};
    for (size_t i = 0; i < COUNT_OF(lines); i++)
        if (lines[i][1][0])
            printf("  %s: %s\n", lines[i][0], lines[i][1]);
}

static void add_thing(struct json *list, const struct recorded_thing *recorded_thing)
{
    struct json *thing = json_add_object(list, NULL), *at = json_add_array(thing, "position_m");
    const struct vec3 p = recorded_thing->world_from_thing.translation;
    struct thing_knowledge k;
    knowledge_of(recorded_thing, &k);
    json_push_number(at, p.x);
    json_push_number(at, p.y);
    json_push_number(at, p.z);
    json_add_string(thing, "name", recorded_thing->name);
    json_add_number(thing, "sigma_m", sigma_m(recorded_thing));
    json_add_number(thing, "sightings", recorded_thing->sightings);
    json_add_bool(thing, "gone", recorded_thing->gone);
    json_add_string(thing, "url", recorded_thing->url);
    json_add_string(thing, "note", recorded_thing->note);
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

static const struct recorded_thing *find_thing(const struct recorded_thing *things, int count, const char *name)
{
    for (int i = 0; i < count; i++)
        if (!strcmp(things[i].name, name))
            return &things[i];
    return NULL;
}

// The thing as the map has it now; what the recording knows of it already goes on.
static enum status make_thing(struct recorded_thing *out, const struct recorded_thing *before,
                              const struct mapped_thing *mapped_thing, const struct thing *thing)
{
    enum status status = OK;
    *out = (struct recorded_thing){0};
    if (before)
        status = recorded_thing_copy(out, before);
    strcpy(out->name, thing->name);
    out->world_from_thing = mapped_thing->world_from_thing;
    out->covariance = mapped_thing->covariance;
    out->width_m = thing->width_m;
    out->height_m = thing->height_m;
    out->sightings = mapped_thing->sightings + (mapped_thing->known && before ? before->sightings : 0);
    out->gone = mapped_thing->gone;
    return status;
}

static void ask_knowledge(const struct objects_arguments *arguments, const char *reference, struct recorded_thing *out)
{
    struct http_limits limits = http_default_limits();
    struct thing_update update;
    limits.login = arguments->knowledge;
    thing_update_ask(out, arguments->knowledge, reference, &limits, &update);
    if (update.trouble[0])
        fprintf(stderr, "warning: nothing new is known of '%s': %s\n", out->name, update.trouble);
    if (update.content_trouble[0])
        fprintf(stderr, "warning: '%s': %s\n", out->name, update.content_trouble);
}

// Fills now[]; *written: how many it holds, also after a failure.
static enum status collect_things(const struct thing_map *map, const struct thing_list *things,
                                  const struct objects_arguments *arguments, const struct recorded_thing *before,
                                  int count, struct recorded_thing *now, int *written)
{
    enum status status = OK;
    for (int i = 0; i < map->count && status == OK; i++) {
        if (!map->things[i].sightings && !map->things[i].gone) // known, and out of sight
            continue;
        const struct thing *thing = &things->things[map->things[i].thing];
        struct recorded_thing *out = &now[(*written)++];
        status = make_thing(out, find_thing(before, count, thing->name), &map->things[i], thing);
        if (status == OK && arguments->knowledge && thing->url[0])
            ask_knowledge(arguments, thing->url, out);
    }
    const int mapped = *written;
    for (int i = 0; i < count && status == OK; i++)
        if (!find_thing(now, mapped, before[i].name)) // not seen in this run, or named by hand
            status = recorded_thing_copy(&now[(*written)++], &before[i]);
    return status;
}

// Keeps the things of a map in the recording arguments->into, in place of those of the same names; what is known of
// them goes on, and arguments->knowledge is asked for more, with pictures and models: what fails costs a warning.
// Things that the map lacks stay. ERR_… of the recording.
static enum status objects_into(const struct thing_map *map, const struct thing_list *things,
                                const struct objects_arguments *arguments)
{
    struct recording *recording;
    struct recorded_thing *before = NULL, *now = NULL;
    int count = 0, written = 0;
    enum status status = recording_open(&recording, arguments->into);
    if (status == OK)
        status = recording_read_things(recording, &before, &count);
    recording_free(&recording);
    if (status == OK && !(now = calloc((size_t)(map->count + count) + 1, sizeof *now)))
        status = fail(ERR_MEMORY, "no memory for the things of %s", arguments->into);
    if (status == OK)
        status = collect_things(map, things, arguments, before, count, now, &written);
    if (status == OK)
        status = recording_write_things(arguments->into, now, written);
    recorded_things_free(&now, written);
    recorded_things_free(&before, count);
    return status;
}

// ---------------------------------------------------------------- objects search

// Of a camera's images those are searched that were taken so far from the last one that was, metres or radians, and at
// most so many: chosen by hand.
#define APART_M   0.15
#define APART_RAD 0.26
enum { MAX_IMAGES = 40 };
// Of a sweep: bounds the time, about half a second a picture with eight things.
enum { MAX_PICTURES = 96 };

struct search_run {
    const struct objects_arguments *arguments;
    struct thing_list things;
    struct place place;
    struct thing_search *search;
    struct thing_map map;
    const struct thing_map *earlier; // what is only known from an earlier sweep's views; NULL: nothing
    int images, searched, sightings, contradicted;
};

static enum status open_run(struct search_run *run, const struct objects_arguments *arguments)
{
    *run = (struct search_run){.arguments = arguments};
    enum status status = thing_list_read(arguments->objects, &run->things);
    if (status == OK)
        status = place_input_read(arguments->into, &run->place);
    if (status == NOTHING)
        status = fail(ERR_INPUT, "%s holds no place; film one with map --out", arguments->into);
    return status == OK ? thing_search_open(&run->search, &run->things) : status;
}

static void close_run(struct search_run *run)
{
    thing_search_close(&run->search);
    place_free(&run->place);
    thing_list_free(&run->things);
}

// What was not seen again stays as the earlier sweep's views showed it.
static void take_earlier(struct search_run *run)
{
    for (int i = 0; run->earlier && i < run->earlier->count; i++)
        for (int k = 0; k < run->map.count; k++)
            if (run->map.things[k].thing == run->earlier->things[i].thing && !run->map.things[k].sightings) {
                const bool gone = run->map.things[k].gone;
                run->map.things[k] = run->earlier->things[i];
                run->map.things[k].gone = gone;
            }
}

static enum status finish_search(struct search_run *run)
{
    enum status status = thing_search_finish(run->search, &run->map, &run->sightings, &run->contradicted);
    take_earlier(run);
    if (status == OK)
        status = objects_into(&run->map, &run->things, run->arguments);
    if (status == OK && run->contradicted)
        fprintf(stderr,
                "warning: %d sightings were left out, because depth says another distance than the size: are pictures "
                "of the things on a wall, or sizes wrong in %s?\n",
                run->contradicted, run->arguments->objects);
    return status;
}

// ---------------------------------------------------------------- a sweep

static enum status search_picture(struct thing_search *search, const struct calibration *calibration,
                                  const struct place_view *view, const struct lens *depth_lens)
{
    const struct depth_view depth = {view->depth, *depth_lens, pose_inverse(calibration->color_from_depth)};
    uint8_t *rgb = malloc((size_t)calibration->color.width * (size_t)calibration->color.height * 3);
    enum status status =
        rgb ? jpeg_decode(view->jpeg, view->jpeg_bytes, rgb, calibration->color.width, calibration->color.height)
            : fail(ERR_MEMORY, "no memory for a picture of the place");
    if (status == OK)
        status = thing_search_add(search, &calibration->color, view->world_from_camera, rgb,
                                  view->depth && depth_lens->width ? &depth : NULL);
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
static enum status expect_recorded(struct search_run *run, bool known[THINGS_MOST], int *unknown)
{
    struct recording *recording;
    struct recorded_thing *things = NULL;
    int count = 0;
    enum status status = recording_open(&recording, run->arguments->into);
    *unknown = run->things.count;
    if (status != OK)
        return status;
    status = recording_read_things(recording, &things, &count);
    recording_free(&recording);
    for (int i = 0; i < count && status == OK; i++) {
        const int thing = index_of(&run->things, things[i].name);
        if (thing < 0)
            continue;
        thing_search_expect(run->search, thing, &things[i].world_from_thing, &things[i].covariance);
        known[thing] = true;
        --*unknown;
    }
    recorded_things_free(&things, count);
    return status;
}

// Things that were not looked for yet, in the views of the place as it was before the sweep.
static enum status search_before(struct search_run *run, const struct place *before, struct thing_map *out)
{
    struct thing_search *search;
    int sightings, contradicted;
    enum status status = thing_search_open(&search, &run->things);
    for (int i = 0; i < before->view_count && status == OK && !command_stopped(); i++)
        if (before->views[i].jpeg && before->calibration.color.width)
            status = search_picture(search, &before->calibration, &before->views[i], &before->calibration.depth);
    if (status == OK)
        status = thing_search_finish(search, out, &sightings, &contradicted);
    thing_search_close(&search);
    return status;
}

static enum status expect_things(struct search_run *run, const struct place *before, struct thing_map *earlier)
{
    bool known[THINGS_MOST] = {false};
    int unknown;
    enum status status = expect_recorded(run, known, &unknown);
    if (status == OK && unknown && before->view_count)
        status = search_before(run, before, earlier);
    int count = 0;
    for (int i = 0; i < earlier->count && status == OK; i++) {
        const struct mapped_thing *t = &earlier->things[i];
        if (known[t->thing])
            continue; // what the recording says is newer
        thing_search_expect(run->search, t->thing, &t->world_from_thing, &t->covariance);
        earlier->things[count++] = *t;
    }
    earlier->count = count;
    return status;
}

// The sharp pictures with a pose; of more than MAX_PICTURES the sharpest of each of so many equal parts. Returns their
// number.
static int choose_pictures(const struct objects_sweep *sweep, struct place_view out[SWEEP_PICTURES_MAX])
{
    const struct sweep_pictures *s = sweep->pictures;
    double sharpness[SWEEP_PICTURES_MAX];
    int usable = 0, count = 0, last = -1;
    for (int i = 0; i < s->count; i++) {
        const struct sweep_picture *p = &s->pictures[i];
        out[usable] = (struct place_view){.jpeg = p->jpeg, .jpeg_bytes = p->jpeg_bytes, .depth = p->depth};
        sharpness[usable] = p->sharpness;
        usable +=
            sweep_picture_is_sharp(s, i) && mapper_pose(sweep->mapper, p->time_ns, &out[usable].world_from_camera);
    }
    for (int i = 0; i < usable; i++) {
        const int part = usable <= MAX_PICTURES ? i : i * MAX_PICTURES / usable;
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

static enum status search_sweep(struct search_run *run, const struct objects_sweep *sweep)
{
    struct place_view pictures[SWEEP_PICTURES_MAX];
    struct progress_bar bar;
    enum status status = OK;
    const int count = choose_pictures(sweep, pictures);
    progress_bar_start(&bar, "looking for things", count);
    for (int i = 0; i < count && status == OK && !command_stopped(); i++) {
        status = search_picture(run->search, &sweep->pictures->calibration, &pictures[i], &sweep->pictures->depth_lens);
        run->searched++;
        progress_bar_step(&bar);
    }
    progress_bar_end(&bar);
    return status;
}

enum status objects_in_sweep(const struct objects_arguments *arguments, const struct objects_sweep *sweep,
                             struct objects_found *found)
{
    struct search_run r;
    struct thing_map earlier = {.count = 0};
    *found = (struct objects_found){0};
    enum status status = open_run(&r, arguments);
    if (status == OK)
        status = expect_things(&r, sweep->before, &earlier);
    if (status == OK)
        status = search_sweep(&r, sweep);
    r.earlier = &earlier;
    if (status == OK)
        status = finish_search(&r);
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

static enum status search_image(struct search_run *run, struct camera_run *camera_run, const struct frame *frame)
{
    struct location at;
    struct camera_motion motion;
    run->images++;
    const enum status located =
        camera_tracker_process(camera_run->tracker, frame->color, NULL, frame->time_ns, &at, &motion);
    if (located != OK)
        return located < 0 && located != ERR_ORDER ? located : OK;
    const struct pose pose = at.world_from_camera;
    if (run->searched && v3_distance(pose.translation, camera_run->last.translation) < APART_M &&
        pose_angle(pose, camera_run->last) < APART_RAD)
        return OK;
    camera_run->last = pose;
    run->searched++;
    return thing_search_add(run->search, camera_tracker_lens(camera_run->tracker), pose, frame->color, NULL);
}

static enum status search_images(struct search_run *run, struct camera_run *camera_run)
{
    struct progress_bar bar;
    struct frame frame;
    enum status status = OK;
    progress_bar_start(&bar, "looking for things", source_remaining(camera_run->frames.source));
    while (status == OK && run->searched < MAX_IMAGES &&
           (status = source_frames_next(&camera_run->frames, &frame)) == OK) {
        if (camera_run->frames.count == 1)
            camera_run->first_ns = frame.time_ns;
        if (run->arguments->seconds > 0 &&
            (double)(frame.time_ns - camera_run->first_ns) * 1e-9 > run->arguments->seconds)
            break;
        if (frame.color)
            status = search_image(run, camera_run, &frame);
        progress_bar_step(&bar);
    }
    progress_bar_end(&bar);
    return status == NOTHING ? OK : status;
}

static enum status report_search(const struct search_run *run)
{
    if (!run->arguments->json) {
        printf("%s: %d things, %d sightings in %d of %d images\n", run->arguments->into, run->map.count, run->sightings,
               run->searched, run->images);
        return OK;
    }
    struct json *root = json_new_object();
    json_add_string(root, "file", run->arguments->into);
    json_add_number(root, "things", run->map.count);
    json_add_number(root, "images", run->images);
    json_add_number(root, "searched", run->searched);
    json_add_number(root, "sightings", run->sightings);
    return command_print_json(&root);
}

// Looks in the images of arguments->camera, for arguments->seconds (0: until its end, or Ctrl-C).
static enum status objects_by_camera(const struct objects_arguments *arguments)
{
    struct search_run r;
    struct camera_run c = {.tracker = NULL};
    const struct locator_options how = locator_default_options();
    enum status status = open_run(&r, arguments);
    if (status == OK)
        status = source_open(&c.frames.source, arguments->camera, SOURCE_CAMERA);
    if (status == OK)
        status = camera_tracker_open(&c.tracker, &r.place, &source_calibration(c.frames.source)->color, &how);
    if (status == OK) {
        command_catch_signals();
        status = search_images(&r, &c);
    }
    if (status == OK && !r.searched)
        status =
            fail(ERR_INPUT, "no image of %s could be localised in the place of %s", arguments->camera, arguments->into);
    if (status == OK)
        status = finish_search(&r);
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

static error_t parse_option(int key, char *value, struct argp_state *state)
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

static int run_serve(int argc, char **argv)
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
    enum { MAX_M = 100000 };
    char text[128], *rest = text;
    double at[3] = {0, 0, 0};
    bool good = snprintf(text, sizeof text, "%s", value) < (int)sizeof text;
    for (int k = 0; k < 3 && good; k++) {
        char *comma = strchr(rest, ',');
        good = (k < 2) == (comma != NULL);
        if (comma)
            *comma = 0;
        good = good && text_number(rest, &at[k]) && fabs(at[k]) <= MAX_M;
        rest = comma ? comma + 1 : rest;
    }
    if (!good)
        argp_error(state, "--at takes X,Y,Z in metres, at most %d, not '%s'", MAX_M, value);
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

static int run_list(int argc, char **argv)
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

static int run_note(int argc, char **argv)
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
    } actions[] = {{"list", run_list}, {"note", run_note}, {"serve", run_serve}};
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
        parse_option,
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
