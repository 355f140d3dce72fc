#include "tests/world/still_view.h"

#include <pthread.h>
#include <stdlib.h>
#include <string.h>

enum { REMEMBERED = 4 }; // cameras: the sensor's, when others film in turn with it

struct still_views {
    pthread_mutex_t lock;
    struct still_view *view; // NULL: none yet
    struct still_camera {
        struct lens lens;
        struct pose world_from_camera;
    } seen[REMEMBERED];
    int next, count;
};

struct still_view *still_view_make(const struct lens *lens, struct pose world_from_camera, int list_rows)
{
    const size_t w = (size_t)lens->width, h = (size_t)lens->height;
    struct still_view *v = calloc(1, sizeof *v);
    if (!v)
        return NULL;
    v->lens = *lens;
    v->world_from_camera = world_from_camera;
    v->list_rows = list_rows;
    v->list_count = (lens->height + list_rows - 1) / list_rows;
    v->corners = malloc((size_t)v->list_count * (size_t)(list_rows + 1) * (w + 1) * sizeof *v->corners);
    v->depth = malloc(w * h * sizeof *v->depth);
    v->color = malloc(w * h * sizeof *v->color);
    v->first = malloc(w * h * sizeof *v->first);
    v->sample_count = malloc(w * h);
    v->lists = calloc((size_t)v->list_count, sizeof *v->lists);
    if (!v->corners || !v->depth || !v->color || !v->first || !v->sample_count || !v->lists) {
        still_view_free(v);
        return NULL;
    }
    return v;
}

void still_view_free(struct still_view *v)
{
    if (!v)
        return;
    for (int i = 0; v->lists && i < v->list_count; i++)
        free(v->lists[i].samples);
    free(v->lists);
    free(v->corners);
    free(v->depth);
    free(v->color);
    free(v->first);
    free(v->sample_count);
    free(v);
}

void still_view_add(struct still_view *v, int list, size_t at, const struct room_sample *samples, int count)
{
    struct sample_list *l = &v->lists[list];
    if (l->count + (size_t)count > l->capacity) {
        const size_t capacity = 2 * l->capacity + 4096;
        struct room_sample *grown = realloc(l->samples, capacity * sizeof *grown);
        if (!grown) {
            v->failed = true;
            return;
        }
        l->samples = grown;
        l->capacity = capacity;
    }
    memcpy(l->samples + l->count, samples, (size_t)count * sizeof *samples);
    v->first[at] = (uint32_t)l->count;
    v->sample_count[at] = (uint8_t)count;
    l->count += (size_t)count;
}

struct still_views *still_views_open(void)
{
    struct still_views *s = calloc(1, sizeof *s);
    if (s)
        pthread_mutex_init(&s->lock, NULL);
    return s;
}

void still_views_close(struct still_views *s)
{
    if (!s)
        return;
    still_view_free(s->view);
    pthread_mutex_destroy(&s->lock);
    free(s);
}

// (An image of a rolling shutter is rendered row by row, without views.)
static bool same_camera(const struct lens *a, const struct lens *b, const struct pose *p, const struct pose *q)
{
    return lens_equal(a, b) && !memcmp(p, q, sizeof *p);
}

struct still_view *still_views_find(struct still_views *s, const struct lens *lens, struct pose world_from_camera,
                                    bool *known)
{
    struct still_view *found = NULL;
    *known = false;
    pthread_mutex_lock(&s->lock);
    if (s->view && same_camera(&s->view->lens, lens, &s->view->world_from_camera, &world_from_camera)) {
        found = s->view;
        found->users++;
    }
    for (int i = 0; i < s->count && !found; i++)
        *known = *known || same_camera(&s->seen[i].lens, lens, &s->seen[i].world_from_camera, &world_from_camera);
    if (!found && !*known) {
        s->seen[s->next] = (struct still_camera){*lens, world_from_camera};
        s->next = (s->next + 1) % REMEMBERED;
        s->count = s->count < REMEMBERED ? s->count + 1 : REMEMBERED;
    }
    pthread_mutex_unlock(&s->lock);
    return found;
}

void still_views_leave(struct still_views *s, struct still_view *view)
{
    if (!view)
        return;
    pthread_mutex_lock(&s->lock);
    view->users--;
    const bool unused = view->users == 0 && view != s->view;
    pthread_mutex_unlock(&s->lock);
    if (unused)
        still_view_free(view);
}

void still_views_keep(struct still_views *s, struct still_view *view)
{
    pthread_mutex_lock(&s->lock);
    struct still_view *old = s->view;
    s->view = view;
    view->users++;
    const bool unused = old && old->users == 0;
    pthread_mutex_unlock(&s->lock);
    if (unused)
        still_view_free(old);
}
