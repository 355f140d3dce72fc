#include "app/live/live_keeper.h"

#include "base/queue.h"
#include "base/thread_priority.h"
#include "capture/body_radii.h"
#include "platform/jpeg.h"

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static const int JPEG_QUALITY = 92; // as the recorder's
enum { MOST_NAMES = 1000 };         // attempts beside one recording

enum item_kind { ITEM_BEGIN, ITEM_FRAME, ITEM_END, ITEM_KEEP };

// Owns copies of its images.
struct keeper_item {
    enum item_kind kind;
    int attempt;
    struct calibration calibration;
    struct take_frame frame;
    uint8_t *color, *jpeg, *mask;
    uint16_t *depth;
};

struct live_keeper {
    char *watched, *spool; // paths
    const struct place *place;
    struct queue *queue;
    pthread_t thread;

    // used by the sensor's thread only
    struct calibration calibration;
    int64_t first_ns;
    bool any;

    // used by the writing thread only
    struct recording_writer *writer; // NULL: nothing is being written
    struct calibration writing;
    struct body_radii radii;
    int64_t index;
    bool whole; // the spool is a complete recording that may be kept

    pthread_mutex_t lock; // protects the fields below
    struct live_keeper_state state;
    char failure[200]; // of writing this attempt; "": none
};

static void item_free(struct keeper_item *item)
{
    free(item->color);
    free(item->jpeg);
    free(item->mask);
    free(item->depth);
    free(item);
}

// ---------------------------------------------------------------- writing thread

static void note_failure(struct live_keeper *k)
{
    pthread_mutex_lock(&k->lock);
    snprintf(k->failure, sizeof k->failure, "%.199s", status_message());
    pthread_mutex_unlock(&k->lock);
}

static void discard(struct live_keeper *k)
{
    if (k->writer && recording_close(&k->writer) != OK)
        note_failure(k);
    (void)unlink(k->spool);
    k->whole = false;
}

static void begin(struct live_keeper *k, const struct keeper_item *item)
{
    char name[40];
    discard(k);
    pthread_mutex_lock(&k->lock);
    k->failure[0] = 0;
    k->state.written = k->state.left_out = 0;
    pthread_mutex_unlock(&k->lock);
    k->writing = item->calibration;
    k->index = 0;
    body_radii_start(&k->radii);
    snprintf(name, sizeof name, "attempt %d", item->attempt);
    enum status status = recording_create(&k->writer, k->spool);
    if (status == OK && k->place)
        status = recording_put_place(k->writer, k->place);
    if (status == OK)
        status = recording_begin_take(k->writer, name, &k->writing);
    if (status != OK) {
        note_failure(k);
        discard(k);
    }
}

static enum status encode(struct keeper_item *item, const struct lens *color)
{
    if (item->color && !item->jpeg) {
        enum status status =
            jpeg_encode(item->color, color->width, color->height, JPEG_QUALITY, &item->jpeg, &item->frame.jpeg_bytes);
        if (status != OK)
            return status;
    }
    item->frame.jpeg = item->jpeg;
    return OK;
}

static void write_frame(struct live_keeper *k, struct keeper_item *item)
{
    if (!k->writer)
        return;
    struct take_frame *f = &item->frame;
    enum status status = encode(item, &k->writing.color);
    if (status == OK)
        status = recording_add_frame(k->writer, f);
    if (status == OK && f->has_skeleton && f->depth &&
        body_radii_add_frame(&k->radii, k->index, &k->writing, &f->skeleton, f->depth, f->mask))
        status = recording_put_body(k->writer, &k->radii.body);
    k->index += status == OK;
    pthread_mutex_lock(&k->lock);
    k->state.written = k->index;
    pthread_mutex_unlock(&k->lock);
    if (status != OK && status != ERR_ORDER) {
        note_failure(k);
        discard(k);
    }
}

static void end(struct live_keeper *k)
{
    if (!k->writer)
        return;
    pthread_mutex_lock(&k->lock);
    const int64_t left_out = k->state.left_out;
    pthread_mutex_unlock(&k->lock);
    enum status status = recording_put_dropped(k->writer, left_out);
    if (status == OK)
        status = recording_end_take(k->writer);
    const enum status closed = recording_close(&k->writer);
    k->whole = status == OK && closed == OK && k->index > 0;
    if (!k->whole) {
        if (status != OK || closed != OK)
            note_failure(k);
        discard(k);
    }
}

// Gives the spool a name that no file has: link() never replaces one.
static enum status give_name(struct live_keeper *k, char *path, size_t capacity)
{
    const char *dot = strstr(k->watched, ".reenact");
    const int stem = dot && !dot[8] ? (int)(dot - k->watched) : (int)strlen(k->watched);
    for (int i = 1; i <= MOST_NAMES; i++) {
        snprintf(path, capacity, "%.*s-attempt-%d.reenact", stem, k->watched, i);
        if (link(k->spool, path) == 0)
            return OK;
        if (access(path, F_OK))
            break;
    }
    return fail(ERR_IO, "the attempt cannot be kept beside %s: the folder cannot be written", k->watched);
}

static void keep(struct live_keeper *k)
{
    char path[600] = "";
    end(k);
    enum status status = k->whole ? give_name(k, path, sizeof path) : NOTHING;
    pthread_mutex_lock(&k->lock);
    k->state.kept++;
    k->state.failed = status != OK;
    const char *slash = strrchr(path, '/');
    if (status == OK)
        snprintf(k->state.sentence, sizeof k->state.sentence, "Kept as %.200s", slash ? slash + 1 : path);
    else if (status == NOTHING && *k->failure)
        snprintf(k->state.sentence, sizeof k->state.sentence, "Not kept: %.200s", k->failure);
    else if (status == NOTHING)
        snprintf(k->state.sentence, sizeof k->state.sentence, "There is no attempt to keep");
    else
        snprintf(k->state.sentence, sizeof k->state.sentence, "%.299s", status_message());
    pthread_mutex_unlock(&k->lock);
    if (status == OK)
        discard(k); // it has its name; a second wish finds nothing
}

static void *write_all(void *context)
{
    struct live_keeper *k = context;
    struct keeper_item *item;
    thread_lower_priority();
    while ((item = queue_take(k->queue))) {
        switch (item->kind) {
        case ITEM_BEGIN: begin(k, item); break;
        case ITEM_FRAME: write_frame(k, item); break;
        case ITEM_END: end(k); break;
        case ITEM_KEEP: keep(k); break;
        }
        item_free(item);
    }
    discard(k);
    return NULL;
}

// ---------------------------------------------------------------- opening

// ".NAME.attempt-PID" beside the recording.
static char *spool_path(const char *watched)
{
    const char *slash = strrchr(watched, '/');
    const int folder = slash ? (int)(slash + 1 - watched) : 0;
    const size_t capacity = strlen(watched) + 40;
    char *path = malloc(capacity);
    if (path)
        snprintf(path, capacity, "%.*s.%s.attempt-%d", folder, watched, watched + folder, (int)getpid());
    return path;
}

enum status live_keeper_open(struct live_keeper **out, const struct live_keeper_options *options)
{
    *out = NULL;
    struct live_keeper *k = calloc(1, sizeof *k);
    if (!k)
        return fail(ERR_MEMORY, "no memory to keep attempts");
    pthread_mutex_init(&k->lock, NULL);
    k->place = options->place;
    k->watched = strdup(options->watched);
    k->spool = spool_path(options->watched);
    enum status status = k->watched && k->spool ? OK : fail(ERR_MEMORY, "no memory to keep attempts");
    if (status == OK)
        status = queue_open(&k->queue, KEEPER_WAITING);
    if (status == OK && pthread_create(&k->thread, NULL, write_all, k)) {
        queue_close(&k->queue);
        status = fail(ERR_MEMORY, "no thread to keep attempts");
    }
    *out = k;
    if (status != OK)
        live_keeper_close(out);
    return status;
}

void live_keeper_close(struct live_keeper **out)
{
    struct live_keeper *k = *out;
    if (!k)
        return;
    if (k->queue) {
        queue_stop(k->queue);
        pthread_join(k->thread, NULL);
        queue_close(&k->queue);
    }
    pthread_mutex_destroy(&k->lock);
    free(k->watched);
    free(k->spool);
    free(k);
    *out = NULL;
}

// ---------------------------------------------------------------- handing over

static void count_left_out(struct live_keeper *k)
{
    pthread_mutex_lock(&k->lock);
    k->state.left_out++;
    pthread_mutex_unlock(&k->lock);
}

static void put_word(struct live_keeper *k, enum item_kind kind, int attempt)
{
    struct keeper_item *item = calloc(1, sizeof *item);
    if (!item)
        return;
    item->kind = kind;
    item->attempt = attempt;
    item->calibration = k->calibration;
    if (!queue_put(k->queue, item))
        item_free(item);
}

void live_keeper_begin(struct live_keeper *k, const struct calibration *calibration, int attempt)
{
    k->calibration = *calibration;
    k->any = false;
    put_word(k, ITEM_BEGIN, attempt);
}

void live_keeper_end(struct live_keeper *k) { put_word(k, ITEM_END, 0); }

void live_keeper_keep(struct live_keeper *k) { put_word(k, ITEM_KEEP, 0); }

static void *copy(const void *bytes, size_t count)
{
    void *to = bytes ? malloc(count) : NULL;
    return to ? memcpy(to, bytes, count) : NULL;
}

void live_keeper_add(struct live_keeper *k, const struct keeper_frame *f)
{
    k->first_ns = k->any ? k->first_ns : f->time_ns;
    k->any = true;
    if (queue_count(k->queue) >= KEEPER_WAITING || f->time_ns - k->first_ns > KEEPER_MOST_S * INT64_C(1000000000)) {
        count_left_out(k);
        return;
    }
    const size_t depth_pixels = lens_pixels(&k->calibration.depth);
    struct keeper_item *item = calloc(1, sizeof *item);
    if (!item)
        return;
    item->kind = ITEM_FRAME;
    item->jpeg = copy(f->jpeg, f->jpeg_bytes);
    item->color = f->jpeg ? NULL : copy(f->color, 3 * lens_pixels(&k->calibration.color));
    item->depth = copy(f->depth, sizeof *f->depth * depth_pixels);
    item->mask = f->skeleton ? copy(f->mask, depth_pixels) : NULL;
    item->frame = (struct take_frame){.time_ns = f->time_ns,
                                      .world_from_camera = f->located ? f->world_from_camera : POSE_IDENTITY,
                                      .located = f->located,
                                      .jpeg_bytes = item->jpeg ? f->jpeg_bytes : 0,
                                      .depth = item->depth,
                                      .mask = item->mask,
                                      .has_skeleton = f->skeleton};
    if (f->skeleton)
        item->frame.skeleton = *f->skeleton;
    if (!queue_try_put(k->queue, item)) {
        item_free(item);
        count_left_out(k);
    }
}

struct live_keeper_state live_keeper_query(struct live_keeper *k)
{
    pthread_mutex_lock(&k->lock);
    const struct live_keeper_state state = k->state;
    pthread_mutex_unlock(&k->lock);
    return state;
}
