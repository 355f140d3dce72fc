#include "app/live/live_keeper.h"

#include "base/threads.h"
#include "capture/body_radii.h"
#include "platform/files/file.h"
#include "platform/files/jpeg.h"

#include <dirent.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>

static const int JPEG_QUALITY = 92; // as the recorder's
enum { MAX_NAMES = 1000 };          // attempts beside one recording
enum { WAITING_COMMANDS = 8 };      // room in the queue beside the frames: asking must not wait for a slow disk

// Where the spools of one recording are: FOLDER/PREFIX and eight random hexadecimal digits.
struct spools {
    char folder[FILE_PATH_BYTES], prefix[FILE_PATH_BYTES];
};

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
    struct worker_thread worker;

    // used by the sensor's thread only
    struct calibration calibration;
    int64_t first_ns;
    bool any;

    // used by the writing thread only
    struct recording_writer *writer; // NULL: nothing is being written
    struct calibration writing;
    struct body_radii radii;
    int64_t index;
    bool whole; // the spool's take is complete and may be kept

    // Under the worker's lock:
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

static void note_failure(struct live_keeper *keeper)
{
    pthread_mutex_lock(&keeper->worker.lock);
    snprintf(keeper->failure, sizeof keeper->failure, "%.199s", status_message());
    pthread_mutex_unlock(&keeper->worker.lock);
}

static void discard(struct live_keeper *keeper)
{
    if (keeper->writer && recording_close(&keeper->writer) != OK)
        note_failure(keeper);
    recording_discard(keeper->spool);
    keeper->whole = false;
}

static void begin(struct live_keeper *keeper, const struct keeper_item *item)
{
    char name[40];
    discard(keeper);
    pthread_mutex_lock(&keeper->worker.lock);
    keeper->failure[0] = 0;
    keeper->state.written = keeper->state.left_out = 0;
    pthread_mutex_unlock(&keeper->worker.lock);
    keeper->writing = item->calibration;
    keeper->index = 0;
    body_radii_start(&keeper->radii);
    snprintf(name, sizeof name, "attempt %d", item->attempt);
    enum status status = recording_create(&keeper->writer, keeper->spool);
    if (status == OK && keeper->place)
        status = recording_put_place(keeper->writer, keeper->place);
    if (status == OK)
        status = recording_begin_take(keeper->writer, name, &keeper->writing);
    if (status != OK) {
        note_failure(keeper);
        discard(keeper);
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

static void write_frame(struct live_keeper *keeper, struct keeper_item *item)
{
    if (!keeper->writer || keeper->whole)
        return;
    struct take_frame *f = &item->frame;
    enum status status = encode(item, &keeper->writing.color);
    if (status == OK)
        status = recording_add_frame(keeper->writer, f);
    if (status == OK && f->has_skeleton && f->depth &&
        body_radii_add_frame(&keeper->radii, keeper->index, &keeper->writing, &f->skeleton, f->depth, f->mask))
        status = recording_put_body(keeper->writer, &keeper->radii.body);
    keeper->index += status == OK;
    pthread_mutex_lock(&keeper->worker.lock);
    keeper->state.written = keeper->index;
    pthread_mutex_unlock(&keeper->worker.lock);
    if (status != OK && status != ERR_ORDER) {
        note_failure(keeper);
        discard(keeper);
    }
}

// The writer stays open, and with it the lock by which others see that the spool is in use.
static void end(struct live_keeper *keeper)
{
    if (!keeper->writer || keeper->whole)
        return;
    pthread_mutex_lock(&keeper->worker.lock);
    const int64_t left_out = keeper->state.left_out;
    pthread_mutex_unlock(&keeper->worker.lock);
    enum status status = recording_put_dropped(keeper->writer, left_out);
    if (status == OK)
        status = recording_end_take(keeper->writer);
    keeper->whole = status == OK && keeper->index > 0;
    if (status != OK)
        note_failure(keeper);
    if (!keeper->whole)
        discard(keeper);
}

// Gives the spool the first name that no file has.
static enum status give_name(struct live_keeper *keeper, char *path, size_t capacity)
{
    const size_t length = strlen(keeper->watched), ending = strlen(".reenact");
    const bool ends_so = length > ending && !strcmp(keeper->watched + length - ending, ".reenact");
    const int stem = (int)(ends_so ? length - ending : length);
    enum status status = ERR_EXISTS;
    for (int i = 1; i <= MAX_NAMES && status == ERR_EXISTS; i++) {
        snprintf(path, capacity, "%.*s-attempt-%d.reenact", stem, keeper->watched, i);
        status = file_name_new(keeper->spool, path);
    }
    return status;
}

static void keep(struct live_keeper *keeper)
{
    char path[FILE_PATH_BYTES] = "";
    end(keeper);
    if (keeper->writer && recording_close(&keeper->writer) != OK) {
        note_failure(keeper);
        discard(keeper);
    }
    enum status status = keeper->whole ? give_name(keeper, path, sizeof path) : NOTHING;
    pthread_mutex_lock(&keeper->worker.lock);
    keeper->state.kept++;
    keeper->state.failed = status != OK;
    const char *slash = strrchr(path, '/');
    if (status == OK)
        snprintf(keeper->state.sentence, sizeof keeper->state.sentence, "Kept as %.200s", slash ? slash + 1 : path);
    else if (status == NOTHING && *keeper->failure)
        snprintf(keeper->state.sentence, sizeof keeper->state.sentence, "Not kept: %.200s", keeper->failure);
    else if (status == NOTHING)
        snprintf(keeper->state.sentence, sizeof keeper->state.sentence, "There is no attempt to keep");
    else
        snprintf(keeper->state.sentence, sizeof keeper->state.sentence, "Not kept: %.200s", status_message());
    pthread_mutex_unlock(&keeper->worker.lock);
    if (status == OK)
        discard(keeper); // it has its name; a second wish finds nothing
}

// Hidden files beside the recording: FOLDER/.NAME.attempt-XXXXXXXX.
static struct spools spools_of(const char *watched)
{
    struct spools out;
    const char *slash = strrchr(watched, '/');
    snprintf(out.folder, sizeof out.folder, "%.*s", slash ? (int)(slash + 1 - watched) : 1, slash ? watched : ".");
    snprintf(out.prefix, sizeof out.prefix, ".%s.attempt-", slash ? slash + 1 : watched);
    return out;
}

// Spools that a killed process left behind: no writer holds their lock.
static void remove_abandoned(const char *watched)
{
    const struct spools spools = spools_of(watched);
    const size_t prefix = strlen(spools.prefix);
    DIR *folder = opendir(spools.folder);
    for (struct dirent *entry; folder && (entry = readdir(folder));) {
        char path[FILE_PATH_BYTES];
        struct recording_writer *w = NULL;
        const char *number = entry->d_name + prefix;
        if (strncmp(entry->d_name, spools.prefix, prefix) != 0 || strlen(number) != 8 ||
            strspn(number, "0123456789abcdef") != 8 ||
            snprintf(path, sizeof path, "%s/%s", spools.folder, entry->d_name) >= (int)sizeof path)
            continue;
        if (recording_append(&w, path) == OK && recording_close(&w) == OK)
            recording_discard(path);
    }
    if (folder)
        closedir(folder);
}

static void *write_all(void *context)
{
    struct live_keeper *k = context;
    struct keeper_item *item;
    thread_lower_priority();
    remove_abandoned(k->watched);
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

static enum status new_spool(struct live_keeper *keeper)
{
    const struct spools spools = spools_of(keeper->watched);
    const size_t capacity = strlen(spools.folder) + strlen(spools.prefix) + 10;
    uint32_t number;
    keeper->spool = malloc(capacity);
    if (!keeper->spool)
        return fail(ERR_MEMORY, "no memory to keep attempts");
    if (getrandom(&number, sizeof number, 0) != (ssize_t)sizeof number)
        return fail(ERR_IO, "no random name to keep attempts under: %s", strerror(errno));
    snprintf(keeper->spool, capacity, "%s/%s%08x", spools.folder, spools.prefix, (unsigned)number);
    return OK;
}

enum status live_keeper_open(struct live_keeper **out, const struct live_keeper_options *options)
{
    *out = NULL;
    struct live_keeper *k = calloc(1, sizeof *k);
    if (!k)
        return fail(ERR_MEMORY, "no memory to keep attempts");
    worker_thread_open(&k->worker);
    k->place = options->place;
    k->watched = strdup(options->watched);
    enum status status = k->watched ? new_spool(k) : fail(ERR_MEMORY, "no memory to keep attempts");
    if (status == OK)
        status = queue_open(&k->queue, KEEPER_WAITING + WAITING_COMMANDS);
    if (status == OK)
        status = worker_thread_start(&k->worker, write_all, k, "to keep attempts");
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
    if (k->queue)
        queue_stop(k->queue);
    worker_thread_close(&k->worker);
    queue_close(&k->queue);
    free(k->watched);
    free(k->spool);
    free(k);
    *out = NULL;
}

// ---------------------------------------------------------------- handing over

static void count_left_out(struct live_keeper *keeper)
{
    pthread_mutex_lock(&keeper->worker.lock);
    keeper->state.left_out++;
    pthread_mutex_unlock(&keeper->worker.lock);
}

static void put_command(struct live_keeper *keeper, const struct keeper_item *command)
{
    struct keeper_item *item = malloc(sizeof *item);
    if (!item)
        return;
    *item = *command;
    if (!queue_put(keeper->queue, item))
        item_free(item);
}

void live_keeper_begin(struct live_keeper *keeper, const struct calibration *calibration, int attempt)
{
    keeper->calibration = *calibration;
    keeper->any = false;
    put_command(keeper, &(struct keeper_item){.kind = ITEM_BEGIN, .attempt = attempt, .calibration = *calibration});
}

void live_keeper_end(struct live_keeper *keeper) { put_command(keeper, &(struct keeper_item){.kind = ITEM_END}); }

void live_keeper_keep(struct live_keeper *keeper) { put_command(keeper, &(struct keeper_item){.kind = ITEM_KEEP}); }

static void *copy(const void *bytes, size_t count)
{
    void *to = bytes ? malloc(count) : NULL;
    return to ? memcpy(to, bytes, count) : NULL;
}

void live_keeper_add(struct live_keeper *keeper, const struct keeper_frame *frame)
{
    keeper->first_ns = keeper->any ? keeper->first_ns : frame->time_ns;
    keeper->any = true;
    if (queue_count(keeper->queue) >= KEEPER_WAITING ||
        frame->time_ns - keeper->first_ns > KEEPER_MAX_S * INT64_C(1000000000)) {
        count_left_out(keeper);
        return;
    }
    const size_t depth_pixels = lens_pixels(&keeper->calibration.depth);
    struct keeper_item *item = calloc(1, sizeof *item);
    if (!item)
        return;
    item->kind = ITEM_FRAME;
    item->jpeg = copy(frame->jpeg, frame->jpeg_bytes);
    item->color = frame->jpeg ? NULL : copy(frame->color, 3 * lens_pixels(&keeper->calibration.color));
    item->depth = copy(frame->depth, sizeof *frame->depth * depth_pixels);
    item->mask = frame->skeleton ? copy(frame->mask, depth_pixels) : NULL;
    item->frame = (struct take_frame){.time_ns = frame->time_ns,
                                      .world_from_camera = frame->located ? frame->world_from_camera : POSE_IDENTITY,
                                      .located = frame->located,
                                      .jpeg_bytes = item->jpeg ? frame->jpeg_bytes : 0,
                                      .depth = item->depth,
                                      .mask = item->mask,
                                      .has_skeleton = frame->skeleton};
    if (frame->skeleton)
        item->frame.skeleton = *frame->skeleton;
    if (!queue_try_put(keeper->queue, item)) {
        item_free(item);
        count_left_out(keeper);
    }
}

struct live_keeper_state live_keeper_query(struct live_keeper *keeper)
{
    pthread_mutex_lock(&keeper->worker.lock);
    const struct live_keeper_state state = keeper->state;
    pthread_mutex_unlock(&keeper->worker.lock);
    return state;
}
