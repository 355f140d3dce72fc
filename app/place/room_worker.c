#include "app/place/room_worker.h"

#include "base/thread_priority.h"
#include "base/worker_thread.h"
#include "recording/recording.h"
#include "surround/filmed/filmed_room.h"
#include "surround/picture/surround_mesh.h"

#include <stdlib.h>
#include <string.h>

enum { PICTURES = 3 };
// How many pictures make a view: a few at first, so that it is there soon, then more, because each needs its depth
// once.
static const int steps[] = {2, 4, 8, 16};
static const double SURFACE_M = 0.02; // of the points that give depth: memory, against 1 cm where films are made

struct room_worker {
    char *path;
    void (*notify)(void *self);
    void *notify_self;
    struct worker_thread worker;

    // Under its lock, which is not held during work:
    bool asked, busy;
    struct lens lens;
    struct pose world_from_view;
    int64_t asked_number;
    struct place_mesh mesh;
    bool has_mesh;
    int views;
    struct room_picture pictures[PICTURES];       // shown: the caller's; ready: the newest; the third is drawn into
    int shown, ready;                             // -1: none
    struct surround_picture waiting[ROOM_DEPTHS]; // handed over and not taken yet, by slot
    float gains[ROOM_DEPTHS][3];
    int64_t handed; // grows with each step of handing over

    // the thread's own
    bool hand_over;
    struct surroundings room;
    int64_t made;
    const struct surround_picture *held[ROOM_DEPTHS]; // what the caller holds in each slot, or will; NULL: nothing
};

static bool goes_on(void *self)
{
    struct room_worker *w = self;
    pthread_mutex_lock(&w->worker.lock);
    const bool on = !w->worker.closing;
    pthread_mutex_unlock(&w->worker.lock);
    return on;
}

static void tell(const struct room_worker *w)
{
    if (w->notify)
        w->notify(w->notify_self);
}

// ---------------------------------------------------------------- drawing

struct drawn_size {
    int long_px;
    double margin;
};
static const struct drawn_size coarse = {ROOM_LONG, ROOM_MARGIN}, fine = {ROOM_LONG_FINE, 0};

static struct lens drawn_lens(const struct lens *of, const struct drawn_size *size)
{
    const double whole = 1 + 2 * size->margin;
    const int longer = of->width > of->height ? of->width : of->height;
    const double scale = fmin(1, size->long_px / (whole * longer));
    struct lens l = {.fx = of->fx * scale, .fy = of->fy * scale};
    l.width = (int)(whole * of->width * scale + 0.5);
    l.height = (int)(whole * of->height * scale + 0.5);
    l.width = l.width < 16 ? 16 : l.width;
    l.height = l.height < 16 ? 16 : l.height;
    l.cx = (of->cx + 0.5 + size->margin * of->width) * scale - 0.5;
    l.cy = (of->cy + 0.5 + size->margin * of->height) * scale - 0.5;
    return l;
}

// The buffer that is neither shown nor the newest.
static int spare(const struct room_worker *w)
{
    int i = 0;
    while (i == w->shown || i == w->ready)
        i++;
    return i;
}

static enum status fill(struct room_picture *p, const struct surround_view *view, struct pose pose)
{
    const size_t pixels = (size_t)view->lens.width * (size_t)view->lens.height;
    if (p->lens.width != view->lens.width || p->lens.height != view->lens.height || !p->rgba) {
        free(p->inverse_z);
        free(p->rgba);
        *p = (struct room_picture){.inverse_z = malloc(sizeof *p->inverse_z * pixels), .rgba = malloc(4 * pixels)};
        if (!p->inverse_z || !p->rgba) {
            free(p->inverse_z);
            free(p->rgba);
            *p = (struct room_picture){0};
            return fail(ERR_MEMORY, "no memory for the room behind the actor");
        }
    }
    p->lens = view->lens;
    p->world_from_view = pose;
    for (size_t i = 0; i < pixels; i++) {
        const bool seen = view->source[i] != SOURCE_UNSEEN && view->inverse_z[i] > 0;
        p->inverse_z[i] = seen ? view->inverse_z[i] : -1;
        for (int c = 0; c < 3; c++)
            p->rgba[4 * i + (size_t)c] = seen ? view->rgb[3 * i + (size_t)c] : 0;
        p->rgba[4 * i + 3] = seen ? 255 : 0;
    }
    return OK;
}

static enum status draw_step(struct room_worker *w, const struct lens *wanted, struct pose pose, int most,
                             const struct drawn_size *size)
{
    const struct lens lens = drawn_lens(wanted, size);
    enum status status = OK;
    if (!lens_equal(&lens, &w->room.view.lens) || !w->room.view.rgb)
        status = filmed_room_set_lens(&w->room, &lens);
    w->room.how.most_pictures = most;
    if (status == OK)
        status = surroundings_draw(&w->room, pose);
    if (status == OK)
        status = filmed_room_trim(&w->room, pose, ROOM_DEPTHS);
    if (status != OK)
        return status;
    pthread_mutex_lock(&w->worker.lock);
    const int into = spare(w);
    pthread_mutex_unlock(&w->worker.lock);
    struct room_picture *p = &w->pictures[into]; // untouched by the others
    status = fill(p, &w->room.view, pose);
    if (status != OK)
        return status;
    p->number = ++w->made;
    p->final = size == &fine;
    pthread_mutex_lock(&w->worker.lock);
    w->ready = into;
    pthread_mutex_unlock(&w->worker.lock);
    tell(w);
    return OK;
}

// ---------------------------------------------------------------- handing over

static bool is_held(const struct room_worker *w, const struct surround_picture *p)
{
    for (int i = 0; i < ROOM_DEPTHS; i++)
        if (w->held[i] == p)
            return true;
    return false;
}

// A slot that is free, or holds a picture that is not in the list, which is shorter than there are slots.
static int slot_for(const struct room_worker *w, const struct surround_picture *const *list, int count)
{
    int slot = 0;
    for (; slot < ROOM_DEPTHS; slot++) {
        bool listed = false;
        for (int i = 0; i < count && w->held[slot]; i++)
            listed |= list[i] == w->held[slot];
        if (!listed)
            break;
    }
    assert(slot < ROOM_DEPTHS);
    return slot;
}

static enum status hand_one(struct room_worker *w, const struct surround_picture *p, int slot)
{
    const size_t pixels = (size_t)p->width * (size_t)p->height;
    struct surround_picture copy = *p, former;
    copy.mesh = NULL;
    enum status status = surround_picture_make_mesh(&copy);
    copy.ray_table = NULL;
    copy.joined = malloc(pixels);
    copy.inverse = malloc(pixels * sizeof *copy.inverse);
    if (status == OK && (!copy.joined || !copy.inverse))
        status = fail(ERR_MEMORY, "no memory for the room behind the actor");
    if (status != OK) {
        room_worker_free_picture(&copy);
        return status;
    }
    memcpy(copy.joined, p->joined, pixels);
    memcpy(copy.inverse, p->inverse, pixels * sizeof *copy.inverse);
    pthread_mutex_lock(&w->worker.lock);
    former = w->waiting[slot];
    w->waiting[slot] = copy;
    pthread_mutex_unlock(&w->worker.lock);
    room_worker_free_picture(&former);
    w->held[slot] = p;
    return OK;
}

static enum status hand_step(struct room_worker *w, struct pose pose, int most)
{
    const struct surround_picture *const *list;
    int count;
    w->room.how.most_pictures = most;
    enum status status = surroundings_prepare(&w->room, pose, &list, &count);
    for (int i = 0; i < count && status == OK; i++)
        if (!is_held(w, list[i]))
            status = hand_one(w, list[i], slot_for(w, list, count));
    if (status == OK)
        status = filmed_room_trim(&w->room, pose, ROOM_DEPTHS);
    if (status != OK)
        return status;
    pthread_mutex_lock(&w->worker.lock);
    for (int i = 0; i < ROOM_DEPTHS; i++)
        if (w->held[i])
            memcpy(w->gains[i], w->held[i]->gain, sizeof w->gains[i]);
    w->handed++;
    pthread_mutex_unlock(&w->worker.lock);
    tell(w);
    return OK;
}

bool room_worker_take_picture(struct room_worker *w, int *slot, struct surround_picture *out)
{
    pthread_mutex_lock(&w->worker.lock);
    for (*slot = 0; *slot < ROOM_DEPTHS && !w->waiting[*slot].inverse;)
        ++*slot;
    const bool any = *slot < ROOM_DEPTHS;
    if (any) {
        *out = w->waiting[*slot];
        w->waiting[*slot] = (struct surround_picture){0};
    }
    pthread_mutex_unlock(&w->worker.lock);
    return any;
}

void room_worker_free_picture(struct surround_picture *p)
{
    p->rgb = NULL; // borrowed
    surround_picture_free(p);
}

int64_t room_worker_gains(struct room_worker *w, float gains[ROOM_DEPTHS][3])
{
    pthread_mutex_lock(&w->worker.lock);
    memcpy(gains, w->gains, sizeof w->gains);
    const int64_t handed = w->handed;
    pthread_mutex_unlock(&w->worker.lock);
    return handed;
}

// ---------------------------------------------------------------- step by step

// Whether something newer was asked for meanwhile, or the thread is to end.
static bool overtaken(struct room_worker *w, int64_t number)
{
    pthread_mutex_lock(&w->worker.lock);
    const bool is = w->worker.closing || w->asked_number != number;
    pthread_mutex_unlock(&w->worker.lock);
    return is;
}

// From few pictures to all. Depth that is there already costs nothing, so the first step takes as many pictures as have
// it.
static enum status draw(struct room_worker *w, const struct lens *lens, struct pose pose, int64_t number)
{
    int with_depth = 0;
    enum status status = OK;
    for (int i = 0; i < w->room.taken; i++)
        with_depth += !w->room.stale[i];
    size_t first = 0;
    while (first + 1 < COUNT_OF(steps) && steps[first] < with_depth)
        first++;
    for (size_t i = first; i < COUNT_OF(steps) && status == OK; i++) {
        const bool last = i + 1 == COUNT_OF(steps) || steps[i] >= w->room.taken;
        if (i > first && overtaken(w, number))
            break;
        status = w->hand_over ? hand_step(w, pose, steps[i]) : draw_step(w, lens, pose, steps[i], &coarse);
        if (last)
            break;
    }
    if (status == OK && !w->hand_over && !overtaken(w, number))
        status = draw_step(w, lens, pose, steps[COUNT_OF(steps) - 1], &fine);
    return status;
}

// ---------------------------------------------------------------- the thread

static enum status prepare(struct room_worker *w)
{
    struct surroundings_options how = surroundings_default_options(SURROUNDINGS_FILMED);
    const struct lens small = {.width = 16, .height = 16, .fx = 16, .fy = 16, .cx = 7.5, .cy = 7.5};
    struct recording *recording = NULL;
    struct place place = {0};
    struct place_mesh mesh = {0};
    enum status status = recording_open(&recording, w->path);
    if (status == OK)
        status = recording_read_place(recording, &place);
    recording_free(&recording);
    const bool has_mesh = status == OK && place_mesh_make(&mesh, &place, goes_on, w) == OK;
    pthread_mutex_lock(&w->worker.lock);
    w->mesh = mesh;
    w->has_mesh = has_mesh;
    pthread_mutex_unlock(&w->worker.lock);
    tell(w);
    how.surface_m = SURFACE_M;
    how.threads = 1;
    int views = status == OK ? filmed_room_views(&place) : 0;
    if (views && goes_on(w) && filmed_room_open(&w->room, &place, &small, &how) != OK)
        views = 0;
    place_free(&place);
    pthread_mutex_lock(&w->worker.lock);
    w->views = views;
    pthread_mutex_unlock(&w->worker.lock);
    return views ? OK : NOTHING;
}

static void *run(void *self)
{
    struct room_worker *w = self;
    thread_lower_priority();
    enum status status = prepare(w);
    pthread_mutex_lock(&w->worker.lock);
    while (!w->worker.closing) {
        if (!w->asked || status != OK) {
            w->busy = false;
            tell(w);
            pthread_cond_wait(&w->worker.changed, &w->worker.lock);
            continue;
        }
        const struct lens lens = w->lens;
        const struct pose pose = w->world_from_view;
        const int64_t number = w->asked_number;
        w->asked = false;
        w->busy = true;
        pthread_mutex_unlock(&w->worker.lock);
        status = draw(w, &lens, pose, number); // without memory there is no room behind the actor, and no more is tried
        pthread_mutex_lock(&w->worker.lock);
    }
    pthread_mutex_unlock(&w->worker.lock);
    surroundings_close(&w->room);
    return NULL;
}

enum status room_worker_start(struct room_worker **out, const struct room_worker_options *options)
{
    struct room_worker *w = *out = calloc(1, sizeof *w);
    if (!w || !(w->path = strdup(options->path))) {
        free(w);
        *out = NULL;
        return fail(ERR_MEMORY, "out of memory");
    }
    w->notify = options->notify;
    w->notify_self = options->notify_self;
    w->hand_over = options->hand_over;
    w->shown = w->ready = -1;
    w->busy = true;
    worker_thread_open(&w->worker);
    enum status status = worker_thread_start(&w->worker, run, w, "for the room behind the actor");
    if (status != OK)
        room_worker_close(out);
    return status;
}

void room_worker_close(struct room_worker **out)
{
    struct room_worker *w = *out;
    if (!w)
        return;
    worker_thread_close(&w->worker);
    for (int i = 0; i < PICTURES; i++) {
        free(w->pictures[i].inverse_z);
        free(w->pictures[i].rgba);
    }
    for (int i = 0; i < ROOM_DEPTHS; i++)
        room_worker_free_picture(&w->waiting[i]);
    place_mesh_free(&w->mesh);
    free(w->path);
    free(w);
    *out = NULL;
}

void room_worker_ask(struct room_worker *w, const struct lens *lens, struct pose world_from_view)
{
    pthread_mutex_lock(&w->worker.lock);
    w->lens = *lens;
    w->world_from_view = world_from_view;
    w->asked = true;
    w->asked_number++;
    w->busy = true;
    pthread_cond_signal(&w->worker.changed);
    pthread_mutex_unlock(&w->worker.lock);
}

const struct room_picture *room_worker_latest(struct room_worker *w)
{
    pthread_mutex_lock(&w->worker.lock);
    if (w->ready >= 0)
        w->shown = w->ready;
    const int shown = w->shown;
    pthread_mutex_unlock(&w->worker.lock);
    return shown >= 0 ? &w->pictures[shown] : NULL;
}

bool room_worker_take_mesh(struct room_worker *w, struct place_mesh *out)
{
    pthread_mutex_lock(&w->worker.lock);
    const bool has = w->has_mesh;
    if (has) {
        *out = w->mesh;
        w->mesh = (struct place_mesh){0};
        w->has_mesh = false;
    }
    pthread_mutex_unlock(&w->worker.lock);
    return has;
}

bool room_worker_idle(struct room_worker *w, int *views)
{
    pthread_mutex_lock(&w->worker.lock);
    const bool idle = !w->busy;
    *views = w->views;
    pthread_mutex_unlock(&w->worker.lock);
    return idle;
}
