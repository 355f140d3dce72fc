#include "app/commands/objects_search.h"

#include "app/commands/command.h"
#include "app/commands/place_input.h"
#include "app/commands/source_frames.h"
#include "objects/thing_search.h"
#include "recording/recorded_things.h"
#include "locate/camera_tracker.h"
#include "platform/files/jpeg.h"
#include "platform/files/json.h"
#include "platform/sensors/source.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

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

static enum status report(const struct search_run *r)
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

enum status objects_by_camera(const struct objects_arguments *a)
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
        status = report(&r);
    if (status == OK)
        status = source_frames_end(&c.frames);
    camera_tracker_close(&c.tracker);
    source_close(&c.frames.source);
    close_run(&r);
    return status;
}
