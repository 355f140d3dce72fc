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
#include "platform/sensors/source_internal.h"

#include <dlfcn.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

// OpenNI2's C header uses these without `struct`.
typedef struct _OniDevice _OniDevice;
typedef struct _OniStream _OniStream;
typedef struct _OniRecorder _OniRecorder;
#include <OniCAPI.h>

enum {
    STREAM_QUEUE = 8,
    SLICE_MS = 50,          // one wait for a frame, before checking whether the source still exists
    LIVE_SILENCE_MS = 5000, // a sensor without frames for this long has failed
    FILE_SILENCE_MS = 3000, // a file without frames for this long has ended; its next frame takes milliseconds
};

// Keeps OpenNI2's file player from running ahead: OpenNI2 holds only one image
// per stream and overwrites it, so memory for the next one is returned only
// after the last one was read.
struct gate {
    pthread_mutex_t lock;
    pthread_cond_t changed;
    bool open; // closing: waits end
};

struct image_stream { // one stream and the images read from it, oldest first
    OniStreamHandle handle;
    OniVideoMode mode;
    bool mirrored; // by the source: copying mirrors it back
    OniFrame *queue[STREAM_QUEUE];
    int count;
    struct gate *gate;
    bool untaken; // guarded by gate.lock: OpenNI2 holds an image that is not yet in the queue
};

struct openni_sensor {
    char *name; // for error sentences: "the sensor" and its name, or the file
    char uri[ONI_MAX_STR];
    bool file;
    bool initialized;
    OniDeviceHandle device;
    OniCallbackHandle callbacks;
    struct gate gate;
    struct image_stream depth, color; // color.handle is NULL where there is none
    bool got_frame;                   // an image was received
    atomic_bool gone, ended;          // set from OpenNI2's threads
    void *pictures;                   // holds the next two
    size_t pictures_bytes;
    uint16_t *mm;
    uint8_t *rgb;
    int64_t half_frame_ns;
    int64_t handed_out, last_time_ns, last_index;
    struct source_facts *facts;
};

// ---------------------------------------------------------------- openni frames

// Reading from OpenNI2: throttling a file's player, pairing depth and colour,
// mirroring images.

// Header of the memory that the gate allocates, before the pixels.
struct gate_block {
    struct image_stream *stream;
    bool taken;
};
enum { BLOCK_BYTES = 64 }; // keeps the pixels aligned

// ------------------------------------------------------------- the gate

// Allocators of a file's images for OpenNI2; `cookie` is the stream.
static void *gate_alloc(int size, void *cookie)
{
    struct image_stream *stream = cookie;
    struct gate *gate = stream->gate;
    pthread_mutex_lock(&gate->lock);
    while (stream->untaken && !gate->open)
        pthread_cond_wait(&gate->changed, &gate->lock);
    stream->untaken = true;
    pthread_mutex_unlock(&gate->lock);
    size_t rounded = (BLOCK_BYTES + (size_t)size + BLOCK_BYTES - 1) / BLOCK_BYTES * BLOCK_BYTES;
    uint8_t *memory = aligned_alloc(BLOCK_BYTES, rounded);
    if (!memory)
        return NULL;
    *(struct gate_block *)memory = (struct gate_block){stream, false};
    return memory + BLOCK_BYTES;
}

static void gate_taken(struct image_stream *stream, struct gate_block *block)
{
    struct gate *gate = stream->gate;
    pthread_mutex_lock(&gate->lock);
    if (!block->taken) {
        block->taken = true;
        stream->untaken = false;
        pthread_cond_broadcast(&gate->changed);
    }
    pthread_mutex_unlock(&gate->lock);
}

static void gate_free(void *data, void *cookie)
{
    (void)cookie;
    if (!data)
        return;
    struct gate_block *block = (struct gate_block *)((uint8_t *)data - BLOCK_BYTES);
    gate_taken(block->stream, block); // discarded unread: the next may come
    free(block);
}

static void gate_open(struct gate *gate)
{
    pthread_mutex_lock(&gate->lock);
    gate->open = true;
    pthread_cond_broadcast(&gate->changed);
    pthread_mutex_unlock(&gate->lock);
}

// ------------------------------------------------------------- frames

static void image_stream_release_frames(struct image_stream *stream)
{
    for (int i = 0; i < stream->count; i++)
        oniFrameRelease(stream->queue[i]);
    stream->count = 0;
}

// Times of no clock, in a damaged file, are all the same, so that those after the first do not rise.
static int64_t time_of(const OniFrame *frame)
{
    const uint64_t max_us = INT64_MAX / 4000;
    return (int64_t)(frame->timestamp < max_us ? frame->timestamp : max_us) * 1000;
}

static void drop_oldest(struct image_stream *stream, int how_many)
{
    for (int i = 0; i < how_many; i++)
        oniFrameRelease(stream->queue[i]);
    stream->count -= how_many;
    memmove(stream->queue, stream->queue + how_many, (size_t)stream->count * sizeof *stream->queue);
}

// Waits at most `wait_ms` for an image and appends it to its queue. NOTHING: none came.
static enum status openni_read_frame(struct openni_sensor *sensor, int wait_ms)
{
    struct image_stream *both[2] = {&sensor->depth, &sensor->color};
    OniStreamHandle streams[2] = {sensor->depth.handle, sensor->color.handle};
    int index = 0;
    OniFrame *frame = NULL;
    if (oniWaitForAnyStream(streams, sensor->color.handle ? 2 : 1, &index, wait_ms) != ONI_STATUS_OK ||
        oniStreamReadFrame(streams[index], &frame) != ONI_STATUS_OK || !frame)
        return NOTHING;
    struct image_stream *stream = both[index];
    if (sensor->file)
        gate_taken(stream, (struct gate_block *)((uint8_t *)frame->data - BLOCK_BYTES));
    if (stream->count == STREAM_QUEUE)
        drop_oldest(stream, 1);
    stream->queue[stream->count++] = frame;
    struct stream_times *color = &sensor->facts->color_times;
    if (stream == &sensor->color && (!color->count || time_of(frame) > color->last_ns))
        stream_times_add(color, time_of(frame));
    sensor->got_frame = true;
    return OK;
}

// Whether it is decided which colour image, if any, belongs to the oldest depth image. For a file this depends only on
// the order of the images, not on timing.
static bool pairing_decided(const struct openni_sensor *sensor, bool over)
{
    if (!sensor->depth.count)
        return false;
    if (over || !sensor->color.handle)
        return true;
    if (sensor->color.count && time_of(sensor->color.queue[sensor->color.count - 1]) >= time_of(sensor->depth.queue[0]))
        return true; // later images are further away
    return sensor->depth.count >= (sensor->file ? STREAM_QUEUE : 2);
}

static enum status check_frame(const struct openni_sensor *sensor, const struct image_stream *stream,
                               const OniFrame *frame, int pixel_bytes, const char *what)
{
    int w = stream->mode.resolutionX, h = stream->mode.resolutionY;
    if (frame->width != w || frame->height != h)
        return fail(ERR_INPUT, "%s: %s picture %d has %d x %d pixels where %d x %d were announced", sensor->name, what,
                    frame->frameIndex, frame->width, frame->height, w, h);
    if (frame->stride < w * pixel_bytes || frame->dataSize < frame->stride * (h - 1) + w * pixel_bytes)
        return fail(ERR_INPUT, "%s: %s picture %d is damaged", sensor->name, what, frame->frameIndex);
    return OK;
}

static enum status copy_depth(struct openni_sensor *sensor, const OniFrame *frame)
{
    int w = sensor->depth.mode.resolutionX, h = sensor->depth.mode.resolutionY;
    enum status status = check_frame(sensor, &sensor->depth, frame, 2, "depth");
    if (status != OK)
        return status;
    bool tenths = sensor->depth.mode.pixelFormat == ONI_PIXEL_FORMAT_DEPTH_100_UM;
    for (int y = 0; y < h; y++) {
        const uint16_t *in =
            (const uint16_t *)(const void *)((const uint8_t *)frame->data + (size_t)y * (size_t)frame->stride);
        uint16_t *out = sensor->mm + (size_t)y * (size_t)w;
        for (int x = 0; x < w; x++) {
            int value = in[sensor->depth.mirrored ? w - 1 - x : x];
            out[x] = (uint16_t)(tenths ? (value + 5) / 10 : value);
        }
    }
    return OK;
}

static enum status copy_color(struct openni_sensor *sensor, const OniFrame *frame)
{
    int w = sensor->color.mode.resolutionX, h = sensor->color.mode.resolutionY;
    enum status status = check_frame(sensor, &sensor->color, frame, 3, "colour");
    if (status != OK)
        return status;
    for (int y = 0; y < h; y++) {
        const uint8_t *in = (const uint8_t *)frame->data + (size_t)y * (size_t)frame->stride;
        uint8_t *out = sensor->rgb + (size_t)y * (size_t)w * 3;
        if (!sensor->color.mirrored)
            memcpy(out, in, (size_t)w * 3);
        else
            for (int x = 0; x < w; x++)
                memcpy(out + 3 * x, in + 3 * (w - 1 - x), 3);
    }
    return OK;
}

// Counts the depth images missing between the last one returned and the oldest in the queue. A sensor has dropped them;
// in a file they are damaged, which is reported once, before the next image.
static enum status count_gap(struct openni_sensor *sensor)
{
    const int index = sensor->depth.queue[0]->frameIndex;
    const int64_t gap = sensor->last_index < 0 ? 0 : index - sensor->last_index - 1;
    if (gap <= 0)
        return OK;
    sensor->facts->dropped += gap;
    sensor->last_index = index - 1;
    if (!sensor->file)
        return OK;
    sensor->facts->remaining =
        sensor->facts->remaining > gap ? sensor->facts->remaining - gap : sensor->facts->remaining;
    return fail(ERR_INPUT, "%s: the %lld pictures before number %d are damaged and left out", sensor->name,
                (long long)gap, index);
}

// The colour image nearest in time, at most half a frame away; -1: none.
static int color_for(const struct openni_sensor *sensor, int64_t time_ns)
{
    int best = -1;
    int64_t best_ns = sensor->half_frame_ns + 1;
    for (int i = 0; i < sensor->color.count; i++) {
        int64_t away_ns = llabs(time_of(sensor->color.queue[i]) - time_ns);
        if (away_ns < best_ns) {
            best = i;
            best_ns = away_ns;
        }
    }
    return best;
}

// Makes a frame of the oldest depth image and its colour. NOTHING: it was dropped because its time does not rise.
static enum status make_frame(struct openni_sensor *sensor, struct frame *out)
{
    enum status status = count_gap(sensor);
    if (status != OK)
        return status;
    const OniFrame *depth = sensor->depth.queue[0];
    int64_t time_ns = time_of(depth);
    sensor->last_index = depth->frameIndex;
    if (sensor->facts->remaining > 0)
        sensor->facts->remaining--;
    if (time_ns <= sensor->last_time_ns) {
        sensor->facts->dropped++;
        drop_oldest(&sensor->depth, 1);
        return NOTHING;
    }
    sensor->last_time_ns = time_ns;
    stream_times_add(&sensor->facts->depth_times, time_ns);
    out->time_ns = time_ns;
    snprintf(out->name, sizeof out->name, "%04lld", (long long)sensor->handed_out++);
    int color = color_for(sensor, time_ns);
    sensor->facts->pairs += color >= 0;
    status = copy_depth(sensor, depth);
    if (status == OK && color >= 0)
        status = copy_color(sensor, sensor->color.queue[color]);
    out->depth = sensor->mm;
    out->color = color >= 0 ? sensor->rgb : NULL;
    drop_oldest(&sensor->depth, 1);
    int used = color + 1; // and those before it; colour older than half a frame fits no later depth image
    while (used < sensor->color.count && time_of(sensor->color.queue[used]) < time_ns - sensor->half_frame_ns)
        used++;
    drop_oldest(&sensor->color, used);
    return status;
}

// Reports, once, a file that ends before the number of images it announced.
static enum status at_end(struct openni_sensor *sensor)
{
    int64_t lost = sensor->facts->remaining;
    sensor->facts->remaining = 0;
    if (lost > 0)
        return fail(ERR_INPUT, "%s breaks off %lld pictures before its end: it is damaged", sensor->name,
                    (long long)lost);
    return NOTHING;
}

// as source_next
static enum status openni_next(void *self, struct frame *out)
{
    struct openni_sensor *s = self;
    int64_t since_ns = clock_now_ns();
    for (;;) {
        while (s->depth.count < STREAM_QUEUE && !(s->file && pairing_decided(s, false)) &&
               openni_read_frame(s, 0) == OK)
            since_ns = clock_now_ns();
        // Read before the queues are filled for the last time, so that they then hold all that came before the end.
        bool gone = atomic_load(&s->gone), over = gone || atomic_load(&s->ended);
        if (over)
            while (s->depth.count < STREAM_QUEUE && openni_read_frame(s, 0) == OK)
                ;
        if (!s->file && s->depth.count > 2)
            drop_oldest(&s->depth, s->depth.count - 2); // late: keep the newest; count_gap() counts the rest
        if (pairing_decided(s, over)) {
            enum status status = make_frame(s, out);
            if (status != NOTHING)
                return status;
            continue;
        }
        if (gone)
            return fail(ERR_DEVICE, "%s was unplugged", s->name);
        if (over)
            return at_end(s);
        if (openni_read_frame(s, SLICE_MS) == OK)
            since_ns = clock_now_ns();
        else if (s->file && clock_now_ns() - since_ns > FILE_SILENCE_MS * INT64_C(1000000))
            atomic_store(&s->ended, true);
        else if (!s->file && clock_now_ns() - since_ns > LIVE_SILENCE_MS * INT64_C(1000000))
            return fail(ERR_DEVICE, "%s has sent no picture for %d seconds; is it still plugged in?", s->name,
                        LIVE_SILENCE_MS / 1000);
    }
}

// ---------------------------------------------------------------- openni

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
    OniStatus (*initialize_openni)(int) = oniInitialize;
    memcpy(&address, &initialize_openni, sizeof address);
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
static enum status make_stream(struct openni_sensor *sensor, struct image_stream *stream, OniSensorType type)
{
    const char *what = type == ONI_SENSOR_DEPTH ? "depth" : "colour";
    const OniSensorInfo *info = oniDeviceGetSensorInfo(sensor->device, type);
    if (!info)
        return NOTHING;
    const OniVideoMode *best = NULL;
    for (int i = 0; i < info->numSupportedVideoModes; i++) {
        const OniVideoMode *mode = &info->pSupportedVideoModes[i];
        if (mode_score(mode, type) >= 0 && (!best || mode_score(mode, type) > mode_score(best, type)))
            best = mode;
    }
    if (!best)
        return fail(sensor->file ? ERR_INPUT : ERR_DEVICE, "%s gives its %s pictures in no format that can be used",
                    sensor->name, what);
    stream->mode = *best;
    char why[200];
    if (oniDeviceCreateStream(sensor->device, type, &stream->handle) != ONI_STATUS_OK) {
        stream->handle = NULL;
        return fail(ERR_DEVICE, "%s gives no %s stream (OpenNI2: %s)", sensor->name, what, last_error(why));
    }
    if (!sensor->file && oniStreamSetProperty(stream->handle, ONI_STREAM_PROPERTY_VIDEO_MODE, &stream->mode,
                                              sizeof stream->mode) != ONI_STATUS_OK)
        return fail(ERR_DEVICE, "%s refuses %s of %d x %d pixels (OpenNI2: %s)", sensor->name, what,
                    stream->mode.resolutionX, stream->mode.resolutionY, last_error(why));
    OniBool mirrored = FALSE;
    int size = sizeof mirrored;
    if (!sensor->file)
        oniStreamSetProperty(stream->handle, ONI_STREAM_PROPERTY_MIRRORING, &mirrored, sizeof mirrored);
    if (oniStreamGetProperty(stream->handle, ONI_STREAM_PROPERTY_MIRRORING, &mirrored, &size) == ONI_STATUS_OK)
        stream->mirrored = mirrored; // some devices ignore the setting, and files cannot change it
    if (sensor->file &&
        oniStreamSetFrameBuffersAllocator(stream->handle, gate_alloc, gate_free, stream) != ONI_STATUS_OK)
        return fail(ERR_DEVICE, "%s: its %s cannot be read picture by picture (OpenNI2: %s)", sensor->name, what,
                    last_error(why));
    return OK;
}

static enum status read_lens(const struct openni_sensor *sensor, const struct image_stream *stream, const char *what,
                             struct lens *lens)
{
    float h = 0, v = 0;
    int h_size = sizeof h, v_size = sizeof v;
    if (oniStreamGetProperty(stream->handle, ONI_STREAM_PROPERTY_HORIZONTAL_FOV, &h, &h_size) != ONI_STATUS_OK ||
        oniStreamGetProperty(stream->handle, ONI_STREAM_PROPERTY_VERTICAL_FOV, &v, &v_size) != ONI_STATUS_OK ||
        !(h > 0.1f && h < 3.0f) || !(v > 0.1f && v < 3.0f))
        return fail(sensor->file ? ERR_INPUT : ERR_DEVICE, "%s does not say how wide its %s camera sees", sensor->name,
                    what);
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
static enum status apply_calibration(struct openni_sensor *sensor)
{
    char serial[100] = "";
    int size = sizeof serial - 1;
    if (oniDeviceGetProperty(sensor->device, ONI_DEVICE_PROPERTY_SERIAL_NUMBER, serial, &size) != ONI_STATUS_OK)
        serial[0] = 0;
    snprintf(sensor->facts->camera_id, sizeof sensor->facts->camera_id, "openni-%.100s",
             *serial ? serial : sensor->uri);
    return device_calibration_apply(sensor->facts->camera_id, &sensor->facts->calibration);
}

static enum status read_calibration(struct openni_sensor *sensor)
{
    struct calibration *c = &sensor->facts->calibration;
    *c = (struct calibration){.registered = true, .color_from_depth = POSE_IDENTITY};
    enum status status = read_lens(sensor, &sensor->depth, "depth", &c->depth);
    if (status != OK || !sensor->color.handle)
        return status;
    if ((status = read_lens(sensor, &sensor->color, "colour", &c->color)) != OK)
        return status;
    if (!sensor->file) {
        OniImageRegistrationMode mode = ONI_IMAGE_REGISTRATION_DEPTH_TO_COLOR;
        c->registered = oniDeviceIsImageRegistrationModeSupported(sensor->device, mode) &&
                        oniDeviceSetProperty(sensor->device, ONI_DEVICE_PROPERTY_IMAGE_REGISTRATION, &mode,
                                             sizeof mode) == ONI_STATUS_OK;
    }
    if (c->registered) { // the colour camera's lens, at the depth image's size
        double scale = (double)c->depth.width / c->color.width;
        c->depth.fx = c->color.fx * scale;
        c->depth.fy = c->color.fy * scale;
    }
    return sensor->file ? OK : apply_calibration(sensor);
}

// Room for the pictures: a file's in the memory that the program maps, depth first.
static enum status make_pictures(struct openni_sensor *sensor)
{
    const OniVideoMode *d = &sensor->depth.mode, *c = &sensor->color.mode;
    const size_t depth_bytes = (size_t)d->resolutionX * (size_t)d->resolutionY * sizeof *sensor->mm;
    const size_t color_bytes = (size_t)c->resolutionX * (size_t)c->resolutionY * 3;
    sensor->pictures_bytes = depth_bytes + color_bytes;
    if (!sensor->file)
        sensor->pictures = malloc(sensor->pictures_bytes);
    else if (!ftruncate(PLAYER_MEMORY, (off_t)sensor->pictures_bytes))
        sensor->pictures = mmap(NULL, sensor->pictures_bytes, PROT_READ | PROT_WRITE, MAP_SHARED, PLAYER_MEMORY, 0);
    if (!sensor->pictures || sensor->pictures == MAP_FAILED) {
        sensor->pictures = NULL;
        return fail(ERR_MEMORY, "no memory for the pictures of %s", sensor->name);
    }
    sensor->mm = sensor->pictures;
    sensor->rgb = (uint8_t *)sensor->pictures + depth_bytes;
    return OK;
}

static enum status make_streams(struct openni_sensor *sensor)
{
    enum status status = make_stream(sensor, &sensor->depth, ONI_SENSOR_DEPTH);
    if (status == NOTHING)
        return fail(sensor->file ? ERR_INPUT : ERR_DEVICE, "%s has no depth", sensor->name);
    if (status == OK && (status = make_stream(sensor, &sensor->color, ONI_SENSOR_COLOR)) == NOTHING)
        status = OK;
    if (status == OK)
        status = read_calibration(sensor);
    if (status != OK)
        return status;
    if ((status = make_pictures(sensor)) != OK)
        return status;
    sensor->half_frame_ns = 500000000 / (sensor->depth.mode.fps > 0 ? sensor->depth.mode.fps : 30);
    if (sensor->file) {
        int count = -1, size = sizeof count;
        if (oniStreamGetProperty(sensor->depth.handle, ONI_STREAM_PROPERTY_NUMBER_OF_FRAMES, &count, &size) ==
                ONI_STATUS_OK &&
            count >= 0)
            sensor->facts->remaining = count;
    }
    return OK;
}

// A file's player runs as soon as one stream is started and would drop the other stream's first images. At speed -1 it
// waits, so both streams are started before it plays.
static enum status start_streams(struct openni_sensor *sensor)
{
    char why[200];
    float paused = -1, as_fast_as_read = 0;
    OniBool repeat = FALSE;
    if (sensor->file && (oniDeviceSetProperty(sensor->device, ONI_DEVICE_PROPERTY_PLAYBACK_REPEAT_ENABLED, &repeat,
                                              sizeof repeat) != ONI_STATUS_OK ||
                         oniDeviceSetProperty(sensor->device, ONI_DEVICE_PROPERTY_PLAYBACK_SPEED, &paused,
                                              sizeof paused) != ONI_STATUS_OK))
        return fail(ERR_DEVICE, "%s cannot be played picture by picture (OpenNI2: %s)", sensor->name, last_error(why));
    if (oniStreamStart(sensor->depth.handle) != ONI_STATUS_OK)
        return fail(ERR_DEVICE, "%s does not start its depth (OpenNI2: %s)", sensor->name, last_error(why));
    if (sensor->color.handle && oniStreamStart(sensor->color.handle) != ONI_STATUS_OK)
        return fail(ERR_DEVICE, "%s does not start its colour (OpenNI2: %s)", sensor->name, last_error(why));
    if (sensor->file) {
        oniDeviceSetProperty(sensor->device, ONI_DEVICE_PROPERTY_PLAYBACK_SPEED, &as_fast_as_read,
                             sizeof as_fast_as_read);
        for (int ms = 0; !sensor->got_frame && !atomic_load(&sensor->ended) && ms < FILE_SILENCE_MS; ms += SLICE_MS)
            status_ignore(openni_read_frame(sensor, SLICE_MS)); // the first image stays queued for openni_next
    } else if (sensor->color.handle) {
        oniDeviceEnableDepthColorSync(sensor->device); // optional: frames are paired by time in any case
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
static enum status initialize_openni(void)
{
    char why[200];
    if (oniInitialize(ONI_API_VERSION) == ONI_STATUS_OK)
        return OK;
    enum status status = fail(ERR_DEVICE, "depth sensors cannot be used: OpenNI2 does not start (%s)", last_error(why));
    oniShutdown(); // it counts failed starts too
    return status;
}

// Learns the URI and the name of the device with that number.
static enum status find_device(struct openni_sensor *sensor, int index)
{
    OniDeviceInfo *list = NULL;
    int count = 0;
    if (oniGetDeviceList(&list, &count) != ONI_STATUS_OK)
        count = 0;
    enum status status = index < count ? OK : no_sensor(index, count);
    if (status == OK) {
        snprintf(sensor->uri, sizeof sensor->uri, "%s", list[index].uri);
        char name[2 * ONI_MAX_STR + 20];
        snprintf(name, sizeof name, "the sensor %s %s", list[index].vendor, list[index].name);
        char *named = strdup(name);
        if (named) {
            free(sensor->name);
            sensor->name = named;
        }
    }
    if (list)
        oniReleaseDeviceList(list);
    return status;
}

static enum status open_device(struct openni_sensor *sensor)
{
    OniDeviceCallbacks callbacks = {NULL, on_disconnected, on_state};
    if (oniRegisterDeviceCallbacks(&callbacks, sensor, &sensor->callbacks) != ONI_STATUS_OK)
        sensor->callbacks = NULL;
    char why[200];
    if (oniDeviceOpen(sensor->uri, &sensor->device) != ONI_STATUS_OK) {
        sensor->device = NULL;
        return sensor->file ? fail(ERR_INPUT,
                                   "%s is cut short or damaged: OpenNI2 does not play it; was it copied whole, and its "
                                   "recording ended in good order?",
                                   sensor->name)
                            : fail(ERR_DEVICE, "%s does not open (OpenNI2: %s)", sensor->name, last_error(why));
    }
    if (sensor->file)
        clock_sleep_until_ns(clock_now_ns() + PLAYER_IDLE_NS / 5);
    enum status status = make_streams(sensor);
    return status == OK ? start_streams(sensor) : status;
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

// Takes over `sensor`; closes it on error. index: of the device; -1 for a file, whose URI is known.
static enum status finish_open(struct openni_sensor *sensor, int index, void **self)
{
    pthread_mutex_lock(&opening);
    enum status status = initialize_openni();
    sensor->initialized = status == OK;
    if (status == OK && index >= 0)
        status = find_device(sensor, index);
    if (status == OK)
        status = open_device(sensor);
    pthread_mutex_unlock(&opening);
    if (status == OK)
        *self = sensor;
    else
        openni_close(sensor);
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
    enum status status = initialize_openni();
    if (status == OK) {
        OniDeviceInfo *list = NULL;
        int found = 0;
        if (oniGetDeviceList(&list, &found) != ONI_STATUS_OK)
            found = 0;
        for (int i = 0; i < found && i < capacity; i++) {
            out[i] = (struct source_device){.usb_vendor = list[i].usbVendorId, .usb_product = list[i].usbProductId};
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
