#include "app/place/room_views.h"

#include "surround/gpu/surround_renderer.h"
#include "surround/surroundings.h"

#include <stdlib.h>
#include <string.h>

struct room_views {
    struct surround_renderer *renderer;
    struct view_options how;
    struct surround_picture pictures[ROOM_DEPTHS]; // taken from the worker; without inverse: none
    int64_t number;                                // of the worker's gains
    const struct gpu_texture *texture;             // the last image; NULL: none
    struct lens lens;
    struct pose pose;
};

enum status room_views_open(struct room_views **out, struct gpu *gpu)
{
    struct room_views *v = *out = calloc(1, sizeof *v);
    if (!v)
        return fail(ERR_MEMORY, "out of memory");
    v->how = surroundings_default_options(SURROUNDINGS_FILMED).view;
    const enum status status = surround_renderer_open(&v->renderer, gpu);
    if (status != OK)
        room_views_close(out);
    return status;
}

void room_views_close(struct room_views **out)
{
    struct room_views *v = *out;
    if (!v)
        return;
    surround_renderer_close(&v->renderer);
    for (int i = 0; i < ROOM_DEPTHS; i++)
        room_worker_free_picture(&v->pictures[i]);
    free(v);
    *out = NULL;
}

// Whether anything was new.
static bool take(struct room_views *v, struct room_worker *worker)
{
    float gains[ROOM_DEPTHS][3];
    struct surround_picture picture;
    int slot;
    while (room_worker_take_picture(worker, &slot, &picture)) {
        room_worker_free_picture(&v->pictures[slot]);
        v->pictures[slot] = picture;
    }
    const int64_t number = room_worker_gains(worker, gains);
    const bool fresh = number != v->number;
    v->number = number;
    for (int i = 0; i < ROOM_DEPTHS && fresh; i++)
        if (v->pictures[i].inverse)
            memcpy(v->pictures[i].gain, gains[i], sizeof gains[i]);
    return fresh;
}

static bool same_pose(const struct pose *a, const struct pose *b)
{
    return pose_angle(*a, *b) < 1e-9 && v3_distance(a->translation, b->translation) < 1e-9;
}

enum status room_views_draw(struct room_views *v, struct room_worker *worker, const struct lens *lens,
                            struct pose world_from_camera, const struct gpu_texture **out)
{
    const struct surround_picture *list[ROOM_DEPTHS];
    const struct surround_image image = {*lens, world_from_camera, v->how, false, 1};
    int count = 0;
    const bool fresh = take(v, worker);
    *out = v->texture;
    if (v->texture && !fresh && !room_views_more(v) && lens_equal(lens, &v->lens) &&
        same_pose(&world_from_camera, &v->pose))
        return OK;
    for (int i = 0; i < ROOM_DEPTHS; i++)
        if (v->pictures[i].inverse)
            list[count++] = &v->pictures[i];
    if (!count)
        return OK;
    enum status status = surround_view_rank(world_from_camera, list, count);
    if (status == OK)
        status = surround_renderer_draw(v->renderer, &image, list, count, out);
    v->texture = status == OK ? *out : NULL;
    v->lens = *lens;
    v->pose = world_from_camera;
    return status;
}

bool room_views_more(const struct room_views *v) { return surround_renderer_missing(v->renderer) > 0; }
