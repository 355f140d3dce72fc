#include "platform/sensors/source.h"

#include "base/clock.h"
#include "platform/files/file.h"
#include "platform/sensors/source_internal.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

// ---------------------------------------------------------------- source

struct source {
    const struct source_kind *kind;
    void *self;
    struct source_facts facts;
};

// A URI scheme and the kind of source that it opens.
struct scheme {
    const char *name;
    bool sensor, camera; // what it can be opened as
    enum { NEEDS_ARGUMENT, OPTIONAL_ARGUMENT } argument;
    const char *example;
    source_opener *open;
    const struct source_kind *kind;
};

static const struct scheme schemes[] = {
    {"openni", true, false, OPTIONAL_ARGUMENT, "openni:0", openni_open, &openni_kind},
    {"oni", true, false, NEEDS_ARGUMENT, "oni:FILE", oni_open, &oni_kind},
    {"mkv", true, false, NEEDS_ARGUMENT, "mkv:FILE", mkv_open, &mkv_kind},
    {"r3d", true, false, NEEDS_ARGUMENT, "r3d:FILE", record3d_open, &record3d_kind},
    {"stray", true, false, NEEDS_ARGUMENT, "stray:DIR", stray_open, &stray_kind},
    {"v4l2", true, false, OPTIONAL_ARGUMENT, "v4l2:0", v4l2_open, &v4l2_kind},
    {"libcamera", false, true, OPTIONAL_ARGUMENT, "libcamera:0", libcamera_open, &libcamera_kind},
    {"folder", true, true, NEEDS_ARGUMENT, "folder:DIR", folder_open, &folder_kind},
};

// The part of `uri` after "NAME:", "" where the URI is NAME alone; NULL: another scheme.
static const char *uri_argument(const char *uri, const char *name)
{
    size_t length = strlen(name);
    if (strncmp(uri, name, length))
        return NULL;
    if (uri[length] == ':')
        return uri + length + 1;
    return uri[length] ? NULL : uri + length;
}

bool source_uri_is_sensor(const char *uri)
{
    for (size_t i = 0; i < COUNT_OF(schemes); i++)
        if (uri_argument(uri, schemes[i].name))
            return !schemes[i].camera;
    return false;
}

// The scheme that is missing before the path of a file or folder that is there; NULL: it is none that could be opened.
static const char *missing_scheme(const char *path, enum source_wanted wanted)
{
    struct stat about;
    const char *kind = file_kind(path);
    if (!stat(path, &about) && S_ISDIR(about.st_mode)) {
        char odometry[FILE_PATH_BYTES];
        snprintf(odometry, sizeof odometry, "%s/odometry.csv", path);
        return wanted == SOURCE_SENSOR && file_exists(odometry) ? "stray" : "folder";
    }
    if (!kind || wanted != SOURCE_SENSOR)
        return NULL;
    if (strstr(kind, "oni:FILE"))
        return "oni";
    if (strstr(kind, "r3d:FILE"))
        return "r3d";
    return strstr(kind, "mkv:FILE") ? "mkv" : NULL;
}

enum status source_open(struct source **out, const char *uri, enum source_wanted wanted)
{
    assert(out && uri);
    *out = NULL;
    const char *what = wanted == SOURCE_SENSOR ? "sensor" : "camera";
    const char *choice = wanted == SOURCE_SENSOR ? SOURCE_SENSOR_URIS : "libcamera, libcamera:N or folder:DIR";
    for (size_t i = 0; i < COUNT_OF(schemes); i++) {
        const struct scheme *scheme = &schemes[i];
        const char *argument = uri_argument(uri, scheme->name);
        if (!argument)
            continue;
        if (!(wanted == SOURCE_SENSOR ? scheme->sensor : scheme->camera))
            return fail(ERR_INPUT, "'%s' is no %s; a %s is %s", uri, what, what, choice);
        if (scheme->argument == NEEDS_ARGUMENT && !*argument)
            return fail(ERR_INPUT, "'%s' names nothing to open; write %s", uri, scheme->example);
        struct source *s = calloc(1, sizeof *s);
        if (!s)
            return fail(ERR_MEMORY, "no memory to open %s", uri);
        s->kind = scheme->kind;
        s->facts.remaining = -1;
        enum status status = scheme->open(&s->self, argument, wanted, &s->facts);
        if (status != OK) {
            free(s);
            return status;
        }
        *out = s;
        return OK;
    }
    const char *scheme = missing_scheme(uri, wanted);
    if (scheme)
        return fail(ERR_INPUT, "'%s' does not say what it is: write %s:%s", uri, scheme, uri);
    return fail(ERR_INPUT, "'%s' names no %s; a %s is %s", uri, what, what, choice);
}

const struct calibration *source_calibration(const struct source *source) { return &source->facts.calibration; }

bool source_is_live(const struct source *source) { return source->facts.live; }

int64_t source_remaining(const struct source *source) { return source->facts.remaining; }

int64_t source_dropped(const struct source *source) { return source->facts.dropped; }

const char *source_clocks(const struct source *source, char out[STREAM_CLOCKS_TEXT_BYTES])
{
    const struct clock_finding found =
        stream_clocks_judge(&source->facts.color_times, &source->facts.depth_times, source->facts.pairs);
    return stream_clocks_text(&found, source->facts.listed, out);
}

enum status source_save_lens(const struct source *source, const struct lens *lens)
{
    struct lens kept = source->facts.calibration.color;
    if (!*source->facts.camera_id || kept.width != lens->width || kept.height != lens->height ||
        lens->focal_sigma >= kept.focal_sigma)
        return NOTHING;
    kept.fx = lens->fx;
    kept.fy = lens->fy;
    kept.focal_sigma = lens->focal_sigma;
    return camera_lens_save(source->facts.camera_id, &kept);
}

enum status source_save_calibration(const struct source *source, const struct calibration *calibration)
{
    return *source->facts.camera_id ? device_calibration_save(source->facts.camera_id, calibration) : NOTHING;
}

void source_enable_dmabuf(struct source *source) { source->facts.dmabuf_enabled = true; }

enum status source_next(struct source *source, struct frame *out)
{
    *out = (struct frame){0};
    enum status status = source->kind->next(source->self, out);
    if (status != OK)
        *out = (struct frame){0}; // no partly filled frame
    return status;
}

void source_close(struct source **source)
{
    if (!*source)
        return;
    (*source)->kind->close((*source)->self);
    free(*source);
    *source = NULL;
}

// A kind that cannot enumerate (no driver, no camera stack) counts as having no devices.
enum status source_devices(struct source_device *out, int capacity, int *count)
{
    enum status (*const kinds[])(struct source_device *, int, int *) = {openni_devices, v4l2_devices,
                                                                        libcamera_devices};
    *count = 0;
    for (size_t i = 0; i < COUNT_OF(kinds); i++) {
        int found;
        const int filled = *count < capacity ? *count : capacity;
        if (kinds[i](out + filled, capacity - filled, &found) == OK)
            *count += found;
    }
    return OK;
}

// ---------------------------------------------------------------- source player

static const int64_t RETRY_NS = 1000000000;

enum status source_player_open(struct source_player *player, const char *uri, enum source_wanted wanted)
{
    *player = (struct source_player){.wanted = wanted};
    worker_thread_open(&player->worker);
    player->uri = strdup(uri);
    return player->uri ? OK : fail(ERR_MEMORY, "no memory for the source's name");
}

void source_player_close(struct source_player *player)
{
    worker_thread_close(&player->worker);
    source_close(&player->source);
    free(player->uri);
    player->uri = NULL;
}

void source_player_suspend(struct source_player *player, bool suspend)
{
    pthread_mutex_lock(&player->worker.lock);
    player->suspended = suspend;
    pthread_cond_broadcast(&player->worker.changed);
    pthread_mutex_unlock(&player->worker.lock);
}

// ---------------------------------------------------------------- waiting

bool source_player_wait_to_play(struct source_player *player)
{
    pthread_mutex_lock(&player->worker.lock);
    while (player->suspended && !player->worker.closing)
        pthread_cond_wait(&player->worker.changed, &player->worker.lock);
    const bool closing = player->worker.closing;
    pthread_mutex_unlock(&player->worker.lock);
    return !closing;
}

bool source_player_must_stop(struct source_player *player)
{
    pthread_mutex_lock(&player->worker.lock);
    const bool stop = player->worker.closing || player->suspended;
    pthread_mutex_unlock(&player->worker.lock);
    return stop;
}

void source_player_wait_until_ns(struct source_player *player, int64_t when_ns)
{
    pthread_mutex_lock(&player->worker.lock);
    while (!player->worker.closing && !player->suspended &&
           condition_wait_until_ns(&player->worker.changed, &player->worker.lock, when_ns))
        continue;
    pthread_mutex_unlock(&player->worker.lock);
}

void source_player_wait_for_frame(struct source_player *player)
{
    if (player->film)
        source_player_wait_until_ns(player, player->due_ns);
}

void source_player_wait_to_retry(struct source_player *player)
{
    source_player_wait_until_ns(player, clock_now_ns() + RETRY_NS);
}

// ---------------------------------------------------------------- the source

enum status source_player_open_source(struct source_player *player)
{
    source_player_close_source(player);
    enum status status = source_open(&player->source, player->uri, player->wanted);
    player->film = status == OK && !source_is_live(player->source);
    player->began_ns = 0;
    return status;
}

void source_player_close_source(struct source_player *player) { source_close(&player->source); }

// When the film's frame of that time is due.
static void schedule(struct source_player *player, int64_t time_ns)
{
    const int64_t now_ns = clock_now_ns(), before_ns = player->due_ns, next_ns = player->due_ns + player->interval_ns;
    const bool first = !player->began_ns;
    if (first) {
        player->first_ns = time_ns;
        player->began_ns = now_ns > next_ns ? now_ns : next_ns;
    }
    player->due_ns = player->began_ns + time_ns - player->first_ns;
    player->interval_ns = first ? 0 : player->due_ns - before_ns;
}

enum status source_player_next(struct source_player *player, struct frame *out)
{
    enum status status = source_next(player->source, out);
    if (status == NOTHING && !player->film)
        return fail(ERR_DEVICE, "the %s has stopped", player->wanted == SOURCE_SENSOR ? "sensor" : "camera");
    if (status == OK && player->film)
        schedule(player, out->time_ns);
    return status;
}

void source_player_begin(struct source_player *player)
{
    const int64_t since_first_ns = player->due_ns - player->began_ns;
    player->began_ns = clock_now_ns();
    player->due_ns = player->began_ns + since_first_ns;
    player->interval_ns = 0;
}

void source_player_delay(struct source_player *player, int64_t delay_ns) { player->began_ns += delay_ns; }

void source_player_resume(struct source_player *player) { player->began_ns = player->due_ns = player->interval_ns = 0; }
