#include "capture/objects/thing_search.h"

#include "capture/objects/thing_recognition.h"

#include <stdlib.h>
#include <string.h>

// Standard deviation of a picture's position in its place, metres; chosen by hand, above what keyframes of a mapped
// place have.
#define POSE_SIGMA_M 0.002
// How far away a thing may be: the length of a room.
#define FARTHEST_M 8

struct searched {
    struct lens lens;
    struct pose world_from_camera;
    uint8_t *rgb;
    uint16_t *depth; // NULL: none
    struct depth_view depth_view;
    struct detection *detections;
    int count;
};

struct thing_search {
    const struct thing_list *things;
    struct recognizer *recognizer;
    struct thing_traits traits[THINGS_MOST];
    struct searched *pictures;
    int count;
};

enum status thing_search_open(struct thing_search **out, const struct thing_list *things)
{
    struct thing_search *s = *out = calloc(1, sizeof *s);
    if (!s)
        return fail(ERR_MEMORY, "no memory to look for things");
    s->things = things;
    struct recognition_options how = recognition_default_options();
    how.farthest_m = FARTHEST_M;
    const enum status status = recognizer_open(&s->recognizer, things, &how);
    if (status != OK)
        thing_search_close(out);
    return status;
}

static void free_picture(struct searched *p)
{
    free(p->rgb);
    free(p->depth);
    free(p->detections);
}

void thing_search_close(struct thing_search **s)
{
    if (!*s)
        return;
    for (int i = 0; i < (*s)->count; i++)
        free_picture(&(*s)->pictures[i]);
    free((*s)->pictures);
    recognizer_close(&(*s)->recognizer);
    free(*s);
    *s = NULL;
}

// Copies what the second look needs.
static enum status keep(struct thing_search *s, struct searched *p, const uint8_t *rgb, const struct depth_view *depth)
{
    const size_t pixels = (size_t)p->lens.width * (size_t)p->lens.height;
    struct searched *grown = realloc(s->pictures, sizeof *grown * ((size_t)s->count + 1));
    if (grown)
        s->pictures = grown;
    p->rgb = malloc(3 * pixels);
    bool good = grown && p->rgb;
    if (good)
        memcpy(p->rgb, rgb, 3 * pixels);
    if (good && depth) {
        const size_t samples = (size_t)depth->lens.width * (size_t)depth->lens.height;
        p->depth = malloc(sizeof *p->depth * samples);
        good = p->depth != NULL;
        if (good)
            memcpy(p->depth, depth->depth, sizeof *p->depth * samples);
        p->depth_view = *depth;
        p->depth_view.depth = p->depth;
    }
    if (!good)
        return fail(ERR_MEMORY, "no memory for a picture with things");
    s->pictures[s->count++] = *p;
    return OK;
}

enum status thing_search_add(struct thing_search *s, const struct lens *lens, struct pose world_from_camera,
                             const uint8_t *rgb, const struct depth_view *depth)
{
    struct searched p = {.lens = *lens,
                         .world_from_camera = world_from_camera,
                         .detections = calloc((size_t)s->things->count + 1, sizeof *p.detections)};
    const struct pose here = POSE_IDENTITY;
    struct thing_view view;
    if (!p.detections)
        return fail(ERR_MEMORY, "no memory to look for things");
    enum status status = thing_view_make(lens, &here, rgb, true, &view);
    if (status == OK) {
        status = recognizer_find(s->recognizer, &view, 1, p.detections, &p.count);
        thing_view_free(&view);
    }
    for (int i = 0; i < p.count && status == OK; i++)
        thing_traits_add(&s->traits[p.detections[i].thing], s->recognizer, &p.detections[i]);
    if (status == OK && p.count)
        status = keep(s, &p, rgb, depth);
    if (status != OK || !p.count)
        free_picture(&p);
    return status;
}

static enum status refine(struct thing_search *s, const struct searched *p, struct thing_map *out, int *sightings,
                          int *contradicted)
{
    const struct pose here = POSE_IDENTITY;
    struct thing_view view;
    enum status status = thing_view_make(&p->lens, &here, p->rgb, false, &view);
    if (status != OK)
        return status;
    for (int i = 0; i < p->count && status >= OK; i++) {
        struct sighting found;
        const int thing = p->detections[i].thing;
        status = recognizer_refine(s->recognizer, &p->detections[i], &s->traits[thing], &view, 1, &found);
        if (status != OK)
            continue;
        if (p->depth && sighting_by_depth(&found, &s->things->things[thing], &p->depth_view) == AMBIGUOUS) {
            ++*contradicted;
            continue;
        }
        const struct covariance3 pose = covariance3_isotropic(POSE_SIGMA_M * POSE_SIGMA_M);
        found.covariance = covariance3_add(&found.covariance, &pose);
        thing_map_add(out, &found, &p->world_from_camera);
        ++*sightings;
    }
    thing_view_free(&view);
    return status < OK ? status : OK;
}

enum status thing_search_finish(struct thing_search *s, struct thing_map *out, int *sightings, int *contradicted)
{
    enum status status = OK;
    *out = (struct thing_map){0};
    *sightings = *contradicted = 0;
    for (int i = 0; i < s->count && status == OK; i++)
        status = refine(s, &s->pictures[i], out, sightings, contradicted);
    return status;
}
