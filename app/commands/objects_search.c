#include "app/commands/objects_search.h"

#include "app/commands/command.h"
#include "app/commands/place_input.h"
#include "capture/objects/thing_search.h"
#include "locate/camera_tracker.h"
#include "platform/jpeg.h"
#include "platform/json.h"
#include "platform/source.h"

#include <stdio.h>
#include <stdlib.h>

// Of a camera's images those are searched that were taken so far from the last one that was, metres or radians, and at
// most so many: chosen by hand.
#define APART_M   0.15
#define APART_RAD 0.26
enum { MOST_IMAGES = 40 };

struct search_run {
    const struct objects_arguments *arguments;
    struct thing_list things;
    struct place place;
    struct thing_search *search;
    struct thing_map map;
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

static enum status finish(struct search_run *r)
{
    enum status status = thing_search_finish(r->search, &r->map, &r->sightings, &r->contradicted);
    if (status == OK)
        status = objects_into(&r->map, &r->things, r->arguments);
    if (status == OK && r->contradicted)
        fprintf(stderr,
                "warning: %d sightings were left out, because depth says another distance than the size: are pictures "
                "of the things on a wall, or sizes wrong in %s?\n",
                r->contradicted, r->arguments->objects);
    return status;
}

// ---------------------------------------------------------------- the place's views

static enum status search_view(struct search_run *r, const struct place_view *view)
{
    const struct calibration *c = &r->place.calibration;
    const struct depth_view depth = {view->depth, c->depth, pose_inverse(c->color_from_depth)};
    uint8_t *rgb = malloc((size_t)c->color.width * (size_t)c->color.height * 3);
    enum status status = rgb ? jpeg_decode(view->jpeg, view->jpeg_bytes, rgb, c->color.width, c->color.height)
                             : fail(ERR_MEMORY, "no memory for a view of the place");
    if (status == OK)
        status = thing_search_add(r->search, &c->color, view->world_from_camera, rgb,
                                  view->depth && c->depth.width ? &depth : NULL);
    free(rgb);
    return status;
}

enum status objects_in_place(const struct objects_arguments *a, int *found)
{
    struct search_run r;
    struct progress_bar bar;
    enum status status = open_run(&r, a);
    if (status == OK)
        progress_bar_start(&bar, "looking for things", r.place.view_count);
    for (int i = 0; i < r.place.view_count && status == OK && r.search; i++) {
        if (r.place.views[i].jpeg && r.place.calibration.color.width)
            status = search_view(&r, &r.place.views[i]);
        progress_bar_step(&bar);
        if (command_stopped())
            break;
    }
    if (r.search)
        progress_bar_end(&bar);
    if (status == OK)
        status = finish(&r);
    *found = r.map.count;
    close_run(&r);
    return status;
}

// ---------------------------------------------------------------- a camera

struct camera_run {
    struct source *source;
    struct camera_tracker *tracker;
    struct pose last;
    int64_t first_ns;
    bool any;
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
    progress_bar_start(&bar, "looking for things", source_remaining(c->source));
    while (status == OK && r->searched < MOST_IMAGES && !command_stopped()) {
        status = source_next(c->source, &frame);
        if (status == NOTHING)
            break;
        if (status == ERR_INPUT) { // one damaged image
            status = OK;
            continue;
        }
        if (status != OK)
            break;
        c->first_ns = c->any ? c->first_ns : frame.time_ns;
        c->any = true;
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
    struct camera_run c = {.source = NULL};
    const struct locator_options how = locator_default_options();
    enum status status = open_run(&r, a);
    if (status == OK)
        status = source_open(&c.source, a->camera, SOURCE_CAMERA);
    if (status == OK)
        status = camera_tracker_open(&c.tracker, &r.place, &source_calibration(c.source)->color, &how);
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
    camera_tracker_close(&c.tracker);
    source_close(&c.source);
    close_run(&r);
    return status;
}
