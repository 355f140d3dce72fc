// Depth sensors and .oni files through OpenNI2's C API.
//
//   openni, openni:N   the first, the N-th (from 0) connected sensor; live
//   oni:FILE           a recording made by OpenNI2; returns every frame, as
//                      fast as it is called, and NOTHING at the end
//
// Depth is requested in millimetres (100 µm is converted, rounded to the
// nearest), colour in RGB; the sensor registers depth to colour where it can.
// Images that the device or the file mirrors are mirrored back here.
//
// A file is played in a process of its own (oni_player.h), to which all that is
// said here of files belongs.
//
// A frame is a depth image with the colour image nearest in time, at most half
// a frame apart. Times are the sensor's own (OpenNI2's recorder lets each stream
// of a file begin at 0). Frames are counted as dropped where the depth stream's
// frame numbers have gaps, or where times do not rise.
//
// The calibration comes from what was measured of this sensor and kept
// (device_calibration_apply), else from the fields of view that it states. OpenNI2
// gives neither principal point nor distortion: the image's centre and none are
// assumed. Registered depth has the colour camera's lens. A file does not say
// whether its depth is registered; it is assumed to be. A sensor that cannot
// register is reported as not registered, with both cameras in one position,
// because OpenNI2 does not give their distance.
#include "base/clock.h"
#include "base/text.h"
#include "platform/sensors/oni_player.h"
#include "platform/sensors/openni_internal.h"

#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

// OpenNI2's reference count has no lock, and opening changes the working folder
// temporarily; so only one thread at a time opens or closes.
static pthread_mutex_t opening = PTHREAD_MUTEX_INITIALIZER;

// OpenNI2's file player iterates over its streams without a lock, every 10 ms while no stream runs, and crashes when
// one is created or destroyed meanwhile. So streams are created right after its first iteration, and destroyed when it
// has had time to finish an image and go idle.
static const int64_t PLAYER_IDLE_NS = 25000000;

// ------------------------------------------------------------- sentences

// OpenNI2's last error message, on one line.
static const char *last_error(char text[200])
{
    snprintf(text, 200, "%s", oniGetExtendedError());
    for (char *at = text; *at; at++)
        if (*at == '\n' || *at == '\t' || *at == '\r')
            *at = ' ';
    char *begin = text + strspn(text, " ");
    for (size_t n = strlen(begin); n && begin[n - 1] == ' '; n--)
        begin[n - 1] = 0;
    return *begin ? begin : "no reason is given";
}

// The folder of OpenNI2's drivers: beside its own library, unless /etc/openni2/OpenNI.ini says otherwise.
static void drivers_folder(char *out, size_t size)
{
    Dl_info info;
    // dladdr takes an object pointer; POSIX allows the conversion.
    void *address;
    OniStatus (*initialize)(int) = oniInitialize;
    memcpy(&address, &initialize, sizeof address);
    snprintf(out, size, "OpenNI2/Drivers");
    if (!dladdr(address, &info) || !info.dli_fname)
        return;
    const char *slash = strrchr(info.dli_fname, '/');
    if (slash)
        snprintf(out, size, "%.*s/OpenNI2/Drivers", (int)(slash - info.dli_fname), info.dli_fname);
}

static enum status no_sensor(int index, int count)
{
    char folder[200];
    drivers_folder(folder, sizeof folder);
    if (count)
        return fail(ERR_MISSING, "there is no depth sensor number %d: %d connected, counted from 0", index, count);
    return fail(ERR_MISSING,
                "no depth sensor is connected: plug one in, and see that you may use it (udev) and that its driver is "
                "in %s",
                folder);
}

// ------------------------------------------------------------- callbacks, on OpenNI2's threads

static void on_disconnected(const OniDeviceInfo *info, void *cookie)
{
    struct openni_sensor *s = cookie;
    if (!strcmp(info->uri, s->uri))
        atomic_store(&s->gone, true);
}

static void on_state(const OniDeviceInfo *info, OniDeviceState state, void *cookie)
{
    struct openni_sensor *s = cookie;
    if (strcmp(info->uri, s->uri))
        return;
    if (state == ONI_DEVICE_STATE_EOF)
        atomic_store(&s->ended, true);
    else if (state == ONI_DEVICE_STATE_ERROR)
        atomic_store(&s->gone, true);
}

// ------------------------------------------------------------- opening

// Rank of a video mode: the nearer to 640 x 480 at 30 Hz, the higher; -1: unusable.
static int mode_score(const OniVideoMode *mode, OniSensorType type)
{
    int format_score = 0;
    if (type == ONI_SENSOR_DEPTH && mode->pixelFormat == ONI_PIXEL_FORMAT_DEPTH_1_MM)
        format_score = 2000000;
    else if (type == ONI_SENSOR_DEPTH && mode->pixelFormat == ONI_PIXEL_FORMAT_DEPTH_100_UM)
        format_score = 1000000;
    else if (type == ONI_SENSOR_COLOR && mode->pixelFormat == ONI_PIXEL_FORMAT_RGB888)
        format_score = 2000000;
    else
        return -1;
    if (mode->resolutionX < 1 || mode->resolutionY < 1 || mode->resolutionX > 4096 || mode->resolutionY > 4096)
        return -1;
    int away = abs(mode->resolutionX - 640) + abs(mode->resolutionY - 480), slow = abs(mode->fps - 30);
    return format_score - 100 * (away < 9000 ? away : 9000) - (slow < 99 ? slow : 99);
}

// Creates the stream in its best mode, not started. NOTHING: the device has no such stream.
static enum status make_stream(struct openni_sensor *s, struct image_stream *stream, OniSensorType type)
{
    const char *what = type == ONI_SENSOR_DEPTH ? "depth" : "colour";
    const OniSensorInfo *info = oniDeviceGetSensorInfo(s->device, type);
    if (!info)
        return NOTHING;
    const OniVideoMode *best = NULL;
    for (int i = 0; i < info->numSupportedVideoModes; i++) {
        const OniVideoMode *mode = &info->pSupportedVideoModes[i];
        if (mode_score(mode, type) >= 0 && (!best || mode_score(mode, type) > mode_score(best, type)))
            best = mode;
    }
    if (!best)
        return fail(s->file ? ERR_INPUT : ERR_DEVICE, "%s gives its %s pictures in no format that can be used", s->name,
                    what);
    stream->mode = *best;
    char why[200];
    if (oniDeviceCreateStream(s->device, type, &stream->handle) != ONI_STATUS_OK) {
        stream->handle = NULL;
        return fail(ERR_DEVICE, "%s gives no %s stream (OpenNI2: %s)", s->name, what, last_error(why));
    }
    if (!s->file && oniStreamSetProperty(stream->handle, ONI_STREAM_PROPERTY_VIDEO_MODE, &stream->mode,
                                         sizeof stream->mode) != ONI_STATUS_OK)
        return fail(ERR_DEVICE, "%s refuses %s of %d x %d pixels (OpenNI2: %s)", s->name, what,
                    stream->mode.resolutionX, stream->mode.resolutionY, last_error(why));
    OniBool mirrored = FALSE;
    int size = sizeof mirrored;
    if (!s->file)
        oniStreamSetProperty(stream->handle, ONI_STREAM_PROPERTY_MIRRORING, &mirrored, sizeof mirrored);
    if (oniStreamGetProperty(stream->handle, ONI_STREAM_PROPERTY_MIRRORING, &mirrored, &size) == ONI_STATUS_OK)
        stream->mirrored = mirrored; // some devices ignore the setting, and files cannot change it
    if (s->file && oniStreamSetFrameBuffersAllocator(stream->handle, gate_alloc, gate_free, stream) != ONI_STATUS_OK)
        return fail(ERR_DEVICE, "%s: its %s cannot be read picture by picture (OpenNI2: %s)", s->name, what,
                    last_error(why));
    return OK;
}

static enum status read_lens(const struct openni_sensor *s, const struct image_stream *stream, const char *what,
                             struct lens *lens)
{
    float h = 0, v = 0;
    int h_size = sizeof h, v_size = sizeof v;
    if (oniStreamGetProperty(stream->handle, ONI_STREAM_PROPERTY_HORIZONTAL_FOV, &h, &h_size) != ONI_STATUS_OK ||
        oniStreamGetProperty(stream->handle, ONI_STREAM_PROPERTY_VERTICAL_FOV, &v, &v_size) != ONI_STATUS_OK ||
        !(h > 0.1f && h < 3.0f) || !(v > 0.1f && v < 3.0f))
        return fail(s->file ? ERR_INPUT : ERR_DEVICE, "%s does not say how wide its %s camera sees", s->name, what);
    int w = stream->mode.resolutionX, height = stream->mode.resolutionY;
    *lens = (struct lens){.width = w,
                          .height = height,
                          .fx = w / (2 * tan(0.5 * (double)h)),
                          .fy = height / (2 * tan(0.5 * (double)v)),
                          .cx = 0.5 * (w - 1),
                          .cy = 0.5 * (height - 1)};
    return OK;
}

// What `calibrate` measured of this very sensor, by its serial number; one that states none is known by its name and
// port.
static enum status apply_calibration(struct openni_sensor *s)
{
    char serial[100] = "";
    int size = sizeof serial - 1;
    if (oniDeviceGetProperty(s->device, ONI_DEVICE_PROPERTY_SERIAL_NUMBER, serial, &size) != ONI_STATUS_OK)
        serial[0] = 0;
    snprintf(s->facts->camera_id, sizeof s->facts->camera_id, "openni-%.100s", *serial ? serial : s->uri);
    return device_calibration_apply(s->facts->camera_id, &s->facts->calibration);
}

static enum status calibrate(struct openni_sensor *s)
{
    struct calibration *c = &s->facts->calibration;
    *c = (struct calibration){.registered = true, .color_from_depth = POSE_IDENTITY};
    enum status status = read_lens(s, &s->depth, "depth", &c->depth);
    if (status != OK || !s->color.handle)
        return status;
    if ((status = read_lens(s, &s->color, "colour", &c->color)) != OK)
        return status;
    if (!s->file) {
        OniImageRegistrationMode mode = ONI_IMAGE_REGISTRATION_DEPTH_TO_COLOR;
        c->registered = oniDeviceIsImageRegistrationModeSupported(s->device, mode) &&
                        oniDeviceSetProperty(s->device, ONI_DEVICE_PROPERTY_IMAGE_REGISTRATION, &mode, sizeof mode) ==
                            ONI_STATUS_OK;
    }
    if (c->registered) { // the colour camera's lens, at the depth image's size
        double scale = (double)c->depth.width / c->color.width;
        c->depth.fx = c->color.fx * scale;
        c->depth.fy = c->color.fy * scale;
    }
    return s->file ? OK : apply_calibration(s);
}

// Room for the pictures: a file's in the memory that the program maps, depth first.
static enum status make_pictures(struct openni_sensor *s)
{
    const OniVideoMode *d = &s->depth.mode, *c = &s->color.mode;
    const size_t depth_bytes = (size_t)d->resolutionX * (size_t)d->resolutionY * sizeof *s->mm;
    const size_t color_bytes = (size_t)c->resolutionX * (size_t)c->resolutionY * 3;
    s->pictures_bytes = depth_bytes + color_bytes;
    if (!s->file)
        s->pictures = malloc(s->pictures_bytes);
    else if (!ftruncate(PLAYER_MEMORY, (off_t)s->pictures_bytes))
        s->pictures = mmap(NULL, s->pictures_bytes, PROT_READ | PROT_WRITE, MAP_SHARED, PLAYER_MEMORY, 0);
    if (!s->pictures || s->pictures == MAP_FAILED) {
        s->pictures = NULL;
        return fail(ERR_MEMORY, "no memory for the pictures of %s", s->name);
    }
    s->mm = s->pictures;
    s->rgb = (uint8_t *)s->pictures + depth_bytes;
    return OK;
}

static enum status make_streams(struct openni_sensor *s)
{
    enum status status = make_stream(s, &s->depth, ONI_SENSOR_DEPTH);
    if (status == NOTHING)
        return fail(s->file ? ERR_INPUT : ERR_DEVICE, "%s has no depth", s->name);
    if (status == OK && (status = make_stream(s, &s->color, ONI_SENSOR_COLOR)) == NOTHING)
        status = OK;
    if (status == OK)
        status = calibrate(s);
    if (status != OK)
        return status;
    if ((status = make_pictures(s)) != OK)
        return status;
    s->half_frame_ns = 500000000 / (s->depth.mode.fps > 0 ? s->depth.mode.fps : 30);
    if (s->file) {
        int count = -1, size = sizeof count;
        if (oniStreamGetProperty(s->depth.handle, ONI_STREAM_PROPERTY_NUMBER_OF_FRAMES, &count, &size) ==
                ONI_STATUS_OK &&
            count >= 0)
            s->facts->remaining = count;
    }
    return OK;
}

// A file's player runs as soon as one stream is started and would drop the other stream's first images. At speed -1 it
// waits, so both streams are started before it plays.
static enum status start(struct openni_sensor *s)
{
    char why[200];
    float paused = -1, as_fast_as_read = 0;
    OniBool repeat = FALSE;
    if (s->file &&
        (oniDeviceSetProperty(s->device, ONI_DEVICE_PROPERTY_PLAYBACK_REPEAT_ENABLED, &repeat, sizeof repeat) !=
             ONI_STATUS_OK ||
         oniDeviceSetProperty(s->device, ONI_DEVICE_PROPERTY_PLAYBACK_SPEED, &paused, sizeof paused) != ONI_STATUS_OK))
        return fail(ERR_DEVICE, "%s cannot be played picture by picture (OpenNI2: %s)", s->name, last_error(why));
    if (oniStreamStart(s->depth.handle) != ONI_STATUS_OK)
        return fail(ERR_DEVICE, "%s does not start its depth (OpenNI2: %s)", s->name, last_error(why));
    if (s->color.handle && oniStreamStart(s->color.handle) != ONI_STATUS_OK)
        return fail(ERR_DEVICE, "%s does not start its colour (OpenNI2: %s)", s->name, last_error(why));
    if (s->file) {
        oniDeviceSetProperty(s->device, ONI_DEVICE_PROPERTY_PLAYBACK_SPEED, &as_fast_as_read, sizeof as_fast_as_read);
        for (int ms = 0; !s->got_frame && !atomic_load(&s->ended) && ms < FILE_SILENCE_MS; ms += SLICE_MS)
            status_ignore(openni_read_frame(s, SLICE_MS)); // the first image stays queued for openni_next
    } else if (s->color.handle) {
        oniDeviceEnableDepthColorSync(s->device); // optional: frames are paired by time in any case
    }
    return OK;
}

static void openni_close(void *self)
{
    struct openni_sensor *s = self;
    if (!s)
        return;
    pthread_mutex_lock(&opening);
    // A player closed before its thread has begun does not end: OpenNI2 waits 3 s and then kills the thread.
    if (s->file && s->device && !s->got_frame)
        clock_sleep_until_ns(clock_now_ns() + 100000000);
    gate_open(&s->gate);
    image_stream_release_frames(&s->depth);
    image_stream_release_frames(&s->color);
    if (s->callbacks)
        oniUnregisterDeviceCallbacks(s->callbacks);
    if (s->color.handle)
        oniStreamStop(s->color.handle);
    if (s->depth.handle)
        oniStreamStop(s->depth.handle);
    if (s->file && s->device)
        clock_sleep_until_ns(clock_now_ns() + PLAYER_IDLE_NS);
    if (s->color.handle)
        oniStreamDestroy(s->color.handle);
    if (s->depth.handle)
        oniStreamDestroy(s->depth.handle);
    if (s->device)
        oniDeviceClose(s->device);
    if (s->initialized)
        oniShutdown();
    pthread_mutex_unlock(&opening);
    pthread_cond_destroy(&s->gate.changed);
    pthread_mutex_destroy(&s->gate.lock);
    if (s->file && s->pictures)
        munmap(s->pictures, s->pictures_bytes);
    else
        free(s->pictures);
    free(s->name);
    free(s);
}

// OpenNI2 up and running; ERR_DEVICE with its reason.
static enum status initialize(void)
{
    char why[200];
    if (oniInitialize(ONI_API_VERSION) == ONI_STATUS_OK)
        return OK;
    enum status status = fail(ERR_DEVICE, "depth sensors cannot be used: OpenNI2 does not start (%s)", last_error(why));
    oniShutdown(); // it counts failed starts too
    return status;
}

// Learns the URI and the name of the device with that number.
static enum status find_device(struct openni_sensor *s, int index)
{
    OniDeviceInfo *list = NULL;
    int count = 0;
    if (oniGetDeviceList(&list, &count) != ONI_STATUS_OK)
        count = 0;
    enum status status = index < count ? OK : no_sensor(index, count);
    if (status == OK) {
        snprintf(s->uri, sizeof s->uri, "%s", list[index].uri);
        char name[2 * ONI_MAX_STR + 20];
        snprintf(name, sizeof name, "the sensor %s %s", list[index].vendor, list[index].name);
        char *named = strdup(name);
        if (named) {
            free(s->name);
            s->name = named;
        }
    }
    if (list)
        oniReleaseDeviceList(list);
    return status;
}

static enum status open_device(struct openni_sensor *s)
{
    OniDeviceCallbacks callbacks = {NULL, on_disconnected, on_state};
    if (oniRegisterDeviceCallbacks(&callbacks, s, &s->callbacks) != ONI_STATUS_OK)
        s->callbacks = NULL;
    char why[200];
    if (oniDeviceOpen(s->uri, &s->device) != ONI_STATUS_OK) {
        s->device = NULL;
        return s->file ? fail(ERR_INPUT,
                              "%s is cut short or damaged: OpenNI2 does not play it; was it copied whole, and its "
                              "recording ended in good order?",
                              s->name)
                       : fail(ERR_DEVICE, "%s does not open (OpenNI2: %s)", s->name, last_error(why));
    }
    if (s->file)
        clock_sleep_until_ns(clock_now_ns() + PLAYER_IDLE_NS / 5);
    enum status status = make_streams(s);
    return status == OK ? start(s) : status;
}

static struct openni_sensor *new_sensor(bool file, const char *name, struct source_facts *facts)
{
    struct openni_sensor *s = calloc(1, sizeof *s);
    if (!s)
        return NULL;
    pthread_mutex_init(&s->gate.lock, NULL);
    pthread_cond_init(&s->gate.changed, NULL);
    s->depth.gate = s->color.gate = &s->gate;
    s->file = file;
    s->last_time_ns = INT64_MIN;
    s->last_index = -1;
    s->facts = facts;
    facts->live = !file;
    s->name = strdup(name);
    if (!s->name) {
        openni_close(s);
        return NULL;
    }
    return s;
}

// Takes over `s`; closes it on error. index: of the device; -1 for a file, whose URI is known.
static enum status finish_open(struct openni_sensor *s, int index, void **self)
{
    pthread_mutex_lock(&opening);
    enum status status = initialize();
    s->initialized = status == OK;
    if (status == OK && index >= 0)
        status = find_device(s, index);
    if (status == OK)
        status = open_device(s);
    pthread_mutex_unlock(&opening);
    if (status == OK)
        *self = s;
    else
        openni_close(s);
    return status;
}

enum status openni_open(void **self, const char *where, enum source_wanted wanted, struct source_facts *facts)
{
    (void)wanted;
    *self = NULL;
    int index = 0;
    if (*where && !text_index(where, 999, &index))
        return fail(ERR_INPUT, "'openni:%s' does not say which sensor; write openni:0 for the first", where);
    struct openni_sensor *s = new_sensor(false, "the sensor", facts);
    return s ? finish_open(s, index, self) : fail(ERR_MEMORY, "no memory to open a depth sensor");
}

enum status oni_play(void **self, const char *name, struct source_facts *facts)
{
    *self = NULL;
    struct openni_sensor *s = new_sensor(true, name, facts);
    if (!s)
        return fail(ERR_MEMORY, "no memory to open %s", name);
    // By its descriptor: OpenNI2 crashes on a path with bytes above 127, and takes none of more than 255.
    snprintf(s->uri, sizeof s->uri, "/proc/self/fd/%d", PLAYER_FILE);
    return finish_open(s, -1, self);
}

const struct source_kind openni_kind = {openni_next, openni_close};

// ------------------------------------------------------------- the list

enum status openni_devices(struct source_device *out, int capacity, int *count)
{
    *count = 0;
    pthread_mutex_lock(&opening);
    enum status status = initialize();
    if (status == OK) {
        OniDeviceInfo *list = NULL;
        int found = 0;
        if (oniGetDeviceList(&list, &found) != ONI_STATUS_OK)
            found = 0;
        for (int i = 0; i < found && i < capacity; i++) {
            snprintf(out[i].uri, sizeof out[i].uri, "openni:%d", i);
            snprintf(out[i].name, sizeof out[i].name, "%.60s %.60s", list[i].vendor, list[i].name);
        }
        *count = found;
        if (list)
            oniReleaseDeviceList(list);
        oniShutdown();
    }
    pthread_mutex_unlock(&opening);
    return status;
}
