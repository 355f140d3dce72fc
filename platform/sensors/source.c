#include "platform/sensors/source.h"

#include "platform/files/file.h"
#include "platform/sensors/source_internal.h"

#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

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

// The scheme that is missing before the path of a file or folder that is there; NULL: it is none that could be opened.
static const char *missing_scheme(const char *path, enum source_wanted wanted)
{
    struct stat about;
    const char *kind = file_kind(path);
    if (!stat(path, &about) && S_ISDIR(about.st_mode))
        return "folder";
    if (!kind || wanted != SOURCE_SENSOR)
        return NULL;
    if (strstr(kind, "oni:FILE"))
        return "oni";
    return strstr(kind, "mkv:FILE") ? "mkv" : NULL;
}

enum status source_open(struct source **out, const char *uri, enum source_wanted wanted)
{
    assert(out && uri);
    *out = NULL;
    const char *what = wanted == SOURCE_SENSOR ? "sensor" : "camera";
    const char *choice = wanted == SOURCE_SENSOR ? "openni, openni:N, oni:FILE, mkv:FILE or folder:DIR"
                                                 : "libcamera, libcamera:N or folder:DIR";
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

enum status source_save_lens(const struct source *s, const struct lens *lens)
{
    struct lens kept = s->facts.calibration.color;
    if (!*s->facts.camera_id || kept.width != lens->width || kept.height != lens->height ||
        lens->focal_sigma >= kept.focal_sigma)
        return NOTHING;
    kept.fx = lens->fx;
    kept.fy = lens->fy;
    kept.focal_sigma = lens->focal_sigma;
    return camera_lens_save(s->facts.camera_id, &kept);
}

enum status source_save_calibration(const struct source *s, const struct calibration *calibration)
{
    return *s->facts.camera_id ? device_calibration_save(s->facts.camera_id, calibration) : NOTHING;
}

void source_enable_dmabuf(struct source *source) { source->facts.dmabuf_enabled = true; }

enum status source_next(struct source *s, struct frame *out)
{
    *out = (struct frame){0};
    enum status status = s->kind->next(s->self, out);
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
    int sensors = 0, cameras = 0;
    if (openni_devices(out, capacity, &sensors) != OK)
        sensors = 0;
    int filled = sensors < capacity ? sensors : capacity;
    if (libcamera_devices(out + filled, capacity - filled, &cameras) != OK)
        cameras = 0;
    *count = sensors + cameras;
    return OK;
}
