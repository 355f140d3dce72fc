// Depth sensors and .oni files through OpenNI2's C API.
//
//   openni, openni:N   the first, the N-th (from 0) connected sensor; live
//   oni:FILE           a recording made by OpenNI2; every frame comes out, as
//                      fast as it is asked for, and NOTHING at its end
//
// Depth is asked for in millimetres (100 µm is converted, rounded to the
// nearest), colour in RGB; the sensor registers depth to colour where it can.
// Pictures are never mirrored: what the device or the file mirrors is turned
// back here.
//
// A frame is a depth picture with the colour picture nearest in time, at most
// half a frame apart. Times are the sensor's own (OpenNI2's recorder lets each
// stream of a file begin at 0). Frames are counted as dropped where the depth
// stream's frame numbers have gaps, or where time does not rise.
//
// The calibration comes from the fields of view that the sensor states; OpenNI2
// tells neither the lens's centre, so the picture's centre is taken, nor its
// distortion, so none is. Registered depth has the colour camera's lens. Whether
// a file's depth is registered is written nowhere; it is taken to be. A sensor
// that cannot register is said to be not registered, with its two cameras in
// one place, for OpenNI2 does not say how far they are apart.
#include "platform/clock.h"
#include "platform/file.h"
#include "platform/source_kinds.h"

#include <dlfcn.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// OpenNI2's C header uses these as C++ would, without `struct`.
typedef struct _OniDevice _OniDevice;
typedef struct _OniStream _OniStream;
typedef struct _OniRecorder _OniRecorder;
#include <OniCAPI.h>

enum { QUEUE = 8, SLICE_MS = 50 };
static const int64_t LIVE_SILENCE_NS = 5000000000; // a sensor silent for so long is gone
static const int64_t FILE_SILENCE_NS = 3000000000; // a file's next picture takes milliseconds

// OpenNI2 counts its users without a lock, and opening changes the working
// folder for a moment; so only one thread at a time opens or closes.
static pthread_mutex_t opening = PTHREAD_MUTEX_INITIALIZER;

// Keeps a file's player from running ahead: OpenNI2 holds only one picture per
// stream and overwrites it, so the next one's memory is handed out only when
// the last one has been taken.
struct gate {
    pthread_mutex_t lock;
    pthread_cond_t changed;
    bool open; // closing down: nobody waits any more
};

struct lane { // one stream and the pictures that came from it, oldest first
    OniStreamHandle stream;
    OniVideoMode mode;
    bool mirrored; // by the source: to be turned back
    OniFrame *queue[QUEUE];
    int count;
    struct gate *gate;
    bool untaken; // guarded by the gate: a picture is with OpenNI2 and not yet in the queue
};

// Goes before the pixels in memory that the gate hands out.
struct block {
    struct lane *lane;
    bool taken;
};
enum { BLOCK_BYTES = 64 }; // keeps the pixels aligned

struct sensor {
    char *name; // for sentences: "the sensor" and its name, or the file
    char uri[ONI_MAX_STR];
    bool file;
    bool initialized;
    OniDeviceHandle device;
    OniCallbackHandle callbacks;
    struct gate gate;
    struct lane depth, color; // color.stream is NULL where there is none
    atomic_bool gone, ended;  // set from OpenNI2's threads
    uint16_t *mm;
    uint8_t *rgb;
    int64_t half_frame_ns;
    int64_t handed_out, last_time_ns, last_index;
    struct source_facts *facts;
};

// ------------------------------------------------------------- sentences

// What OpenNI2 last complained of, on one line.
static const char *complaint(char text[200])
{
    snprintf(text, 200, "%s", oniGetExtendedError());
    for (char *at = text; *at; at++)
        if (*at == '\n' || *at == '\t' || *at == '\r')
            *at = ' ';
    char *begin = text + strspn(text, " ");
    for (size_t n = strlen(begin); n && begin[n - 1] == ' '; n--)
        begin[n - 1] = 0;
    return *begin ? begin : "OpenNI2 gives no reason";
}

// Where OpenNI2 looks for its drivers: beside its own library, unless /etc/openni2/OpenNI.ini says otherwise.
static void drivers_folder(char *out, size_t size)
{
    Dl_info info;
    // A function's address as an object's: what dladdr wants and POSIX allows.
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

// ------------------------------------------------------------- the gate

static void *gate_alloc(int size, void *cookie)
{
    struct lane *lane = cookie;
    struct gate *gate = lane->gate;
    pthread_mutex_lock(&gate->lock);
    while (lane->untaken && !gate->open)
        pthread_cond_wait(&gate->changed, &gate->lock);
    lane->untaken = true;
    pthread_mutex_unlock(&gate->lock);
    size_t rounded = (BLOCK_BYTES + (size_t)size + BLOCK_BYTES - 1) / BLOCK_BYTES * BLOCK_BYTES;
    uint8_t *memory = aligned_alloc(BLOCK_BYTES, rounded);
    if (!memory)
        return NULL;
    *(struct block *)memory = (struct block){lane, false};
    return memory + BLOCK_BYTES;
}

static void gate_taken(struct lane *lane, struct block *block)
{
    struct gate *gate = lane->gate;
    pthread_mutex_lock(&gate->lock);
    if (!block->taken) {
        block->taken = true;
        lane->untaken = false;
        pthread_cond_broadcast(&gate->changed);
    }
    pthread_mutex_unlock(&gate->lock);
}

static void gate_free(void *data, void *cookie)
{
    (void)cookie;
    if (!data)
        return;
    struct block *block = (struct block *)((uint8_t *)data - BLOCK_BYTES);
    gate_taken(block->lane, block); // thrown away unread: the next may come
    free(block);
}

static void gate_open(struct gate *gate)
{
    pthread_mutex_lock(&gate->lock);
    gate->open = true;
    pthread_cond_broadcast(&gate->changed);
    pthread_mutex_unlock(&gate->lock);
}

// ------------------------------------------------------------- news from OpenNI2's threads

static void on_disconnected(const OniDeviceInfo *info, void *cookie)
{
    struct sensor *s = cookie;
    if (!strcmp(info->uri, s->uri))
        atomic_store(&s->gone, true);
}

static void on_state(const OniDeviceInfo *info, OniDeviceState state, void *cookie)
{
    struct sensor *s = cookie;
    if (strcmp(info->uri, s->uri))
        return;
    if (state == ONI_DEVICE_STATE_EOF)
        atomic_store(&s->ended, true);
    else if (state == ONI_DEVICE_STATE_ERROR)
        atomic_store(&s->gone, true);
}

// ------------------------------------------------------------- opening

// How well a mode serves: the nearer to 640 x 480 at 30 Hz the better; -1 not at all.
static int mode_worth(const OniVideoMode *mode, OniSensorType type)
{
    int worth = 0;
    if (type == ONI_SENSOR_DEPTH && mode->pixelFormat == ONI_PIXEL_FORMAT_DEPTH_1_MM)
        worth = 2000000;
    else if (type == ONI_SENSOR_DEPTH && mode->pixelFormat == ONI_PIXEL_FORMAT_DEPTH_100_UM)
        worth = 1000000;
    else if (type == ONI_SENSOR_COLOR && mode->pixelFormat == ONI_PIXEL_FORMAT_RGB888)
        worth = 2000000;
    else
        return -1;
    if (mode->resolutionX < 1 || mode->resolutionY < 1 || mode->resolutionX > 4096 || mode->resolutionY > 4096)
        return -1;
    int away = abs(mode->resolutionX - 640) + abs(mode->resolutionY - 480), slow = abs(mode->fps - 30);
    return worth - 100 * (away < 9000 ? away : 9000) - (slow < 99 ? slow : 99);
}

// NOTHING: the device has no such stream. Leaves the stream made, in its best mode, not started.
static enum status make_stream(struct sensor *s, struct lane *lane, OniSensorType type)
{
    const char *what = type == ONI_SENSOR_DEPTH ? "depth" : "colour";
    const OniSensorInfo *info = oniDeviceGetSensorInfo(s->device, type);
    if (!info)
        return NOTHING;
    const OniVideoMode *best = NULL;
    for (int i = 0; i < info->numSupportedVideoModes; i++) {
        const OniVideoMode *mode = &info->pSupportedVideoModes[i];
        if (mode_worth(mode, type) >= 0 && (!best || mode_worth(mode, type) > mode_worth(best, type)))
            best = mode;
    }
    if (!best)
        return fail(s->file ? ERR_INPUT : ERR_DEVICE, "%s gives its %s pictures in no format that can be used", s->name,
                    what);
    lane->mode = *best;
    char why[200];
    if (oniDeviceCreateStream(s->device, type, &lane->stream) != ONI_STATUS_OK) {
        lane->stream = NULL;
        return fail(ERR_DEVICE, "%s gives no %s stream: %s", s->name, what, complaint(why));
    }
    if (!s->file && oniStreamSetProperty(lane->stream, ONI_STREAM_PROPERTY_VIDEO_MODE, &lane->mode,
                                         sizeof lane->mode) != ONI_STATUS_OK)
        return fail(ERR_DEVICE, "%s refuses %s of %d x %d pixels: %s", s->name, what, lane->mode.resolutionX,
                    lane->mode.resolutionY, complaint(why));
    OniBool mirrored = FALSE;
    int size = sizeof mirrored;
    if (!s->file)
        oniStreamSetProperty(lane->stream, ONI_STREAM_PROPERTY_MIRRORING, &mirrored, sizeof mirrored);
    if (oniStreamGetProperty(lane->stream, ONI_STREAM_PROPERTY_MIRRORING, &mirrored, &size) == ONI_STATUS_OK)
        lane->mirrored = mirrored; // some cannot be told not to, and no file can
    if (s->file && oniStreamSetFrameBuffersAllocator(lane->stream, gate_alloc, gate_free, lane) != ONI_STATUS_OK)
        return fail(ERR_DEVICE, "%s: its %s cannot be read picture by picture: %s", s->name, what, complaint(why));
    return OK;
}

static enum status read_lens(const struct sensor *s, const struct lane *lane, const char *what, struct lens *lens)
{
    float h = 0, v = 0;
    int h_size = sizeof h, v_size = sizeof v;
    if (oniStreamGetProperty(lane->stream, ONI_STREAM_PROPERTY_HORIZONTAL_FOV, &h, &h_size) != ONI_STATUS_OK ||
        oniStreamGetProperty(lane->stream, ONI_STREAM_PROPERTY_VERTICAL_FOV, &v, &v_size) != ONI_STATUS_OK ||
        !(h > 0.1f && h < 3.0f) || !(v > 0.1f && v < 3.0f))
        return fail(s->file ? ERR_INPUT : ERR_DEVICE, "%s does not say how wide its %s camera sees", s->name, what);
    int w = lane->mode.resolutionX, height = lane->mode.resolutionY;
    *lens = (struct lens){.width = w,
                          .height = height,
                          .fx = w / (2 * tan(0.5 * (double)h)),
                          .fy = height / (2 * tan(0.5 * (double)v)),
                          .cx = 0.5 * (w - 1),
                          .cy = 0.5 * (height - 1)};
    return OK;
}

static enum status calibrate(struct sensor *s)
{
    struct calibration *c = &s->facts->calibration;
    *c = (struct calibration){.registered = true, .color_from_depth = POSE_IDENTITY};
    enum status status = read_lens(s, &s->depth, "depth", &c->depth);
    if (status != OK || !s->color.stream)
        return status;
    if ((status = read_lens(s, &s->color, "colour", &c->color)) != OK)
        return status;
    if (!s->file) {
        OniImageRegistrationMode mode = ONI_IMAGE_REGISTRATION_DEPTH_TO_COLOR;
        c->registered = oniDeviceIsImageRegistrationModeSupported(s->device, mode) &&
                        oniDeviceSetProperty(s->device, ONI_DEVICE_PROPERTY_IMAGE_REGISTRATION, &mode, sizeof mode) ==
                            ONI_STATUS_OK;
    }
    if (c->registered) { // the colour camera's lens, at the depth picture's size
        double scale = (double)c->depth.width / c->color.width;
        c->depth.fx = c->color.fx * scale;
        c->depth.fy = c->color.fy * scale;
    }
    return OK;
}

static enum status make_streams(struct sensor *s)
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
    const OniVideoMode *d = &s->depth.mode, *c = &s->color.mode;
    s->mm = malloc((size_t)d->resolutionX * (size_t)d->resolutionY * sizeof *s->mm);
    s->rgb = malloc((size_t)c->resolutionX * (size_t)c->resolutionY * 3 + 1);
    if (!s->mm || !s->rgb)
        return fail(ERR_MEMORY, "no memory for the pictures of %s", s->name);
    s->half_frame_ns = 500000000 / (d->fps > 0 ? d->fps : 30);
    if (s->file) {
        int count = -1, size = sizeof count;
        if (oniStreamGetProperty(s->depth.stream, ONI_STREAM_PROPERTY_NUMBER_OF_FRAMES, &count, &size) ==
                ONI_STATUS_OK &&
            count >= 0)
            s->facts->remaining = count;
    }
    return OK;
}

// A file's player runs as soon as one stream is started and would throw away the other's first
// pictures; at speed -1 it waits to be asked, so both streams are started before anything moves.
static enum status start(struct sensor *s)
{
    char why[200];
    float by_hand = -1, no_waiting = 0;
    OniBool repeat = FALSE;
    if (s->file && (oniDeviceSetProperty(s->device, ONI_DEVICE_PROPERTY_PLAYBACK_REPEAT_ENABLED, &repeat,
                                         sizeof repeat) != ONI_STATUS_OK ||
                    oniDeviceSetProperty(s->device, ONI_DEVICE_PROPERTY_PLAYBACK_SPEED, &by_hand, sizeof by_hand) !=
                        ONI_STATUS_OK))
        return fail(ERR_DEVICE, "%s cannot be played picture by picture: %s", s->name, complaint(why));
    if (oniStreamStart(s->depth.stream) != ONI_STATUS_OK)
        return fail(ERR_DEVICE, "%s does not start its depth: %s", s->name, complaint(why));
    if (s->color.stream && oniStreamStart(s->color.stream) != ONI_STATUS_OK)
        return fail(ERR_DEVICE, "%s does not start its colour: %s", s->name, complaint(why));
    if (s->file)
        oniDeviceSetProperty(s->device, ONI_DEVICE_PROPERTY_PLAYBACK_SPEED, &no_waiting, sizeof no_waiting);
    else if (s->color.stream)
        oniDeviceEnableDepthColorSync(s->device); // nice to have; pairs are made by time anyway
    return OK;
}

static void release_all(struct lane *lane)
{
    for (int i = 0; i < lane->count; i++)
        oniFrameRelease(lane->queue[i]);
    lane->count = 0;
}

static void openni_close(void *self)
{
    struct sensor *s = self;
    if (!s)
        return;
    pthread_mutex_lock(&opening);
    gate_open(&s->gate);
    release_all(&s->depth);
    release_all(&s->color);
    if (s->callbacks)
        oniUnregisterDeviceCallbacks(s->callbacks);
    if (s->color.stream)
        oniStreamStop(s->color.stream);
    if (s->depth.stream)
        oniStreamStop(s->depth.stream);
    if (s->color.stream)
        oniStreamDestroy(s->color.stream);
    if (s->depth.stream)
        oniStreamDestroy(s->depth.stream);
    if (s->device)
        oniDeviceClose(s->device);
    if (s->initialized)
        oniShutdown();
    pthread_mutex_unlock(&opening);
    pthread_cond_destroy(&s->gate.changed);
    pthread_mutex_destroy(&s->gate.lock);
    free(s->mm);
    free(s->rgb);
    free(s->name);
    free(s);
}

// OpenNI2 up and running; ERR_DEVICE with its reason.
static enum status initialize(void)
{
    char why[200];
    if (oniInitialize(ONI_API_VERSION) == ONI_STATUS_OK)
        return OK;
    enum status status = fail(ERR_DEVICE, "OpenNI2 does not start: %s", complaint(why));
    oniShutdown(); // it counts failed starts too
    return status;
}

static enum status open_device(struct sensor *s)
{
    OniDeviceCallbacks callbacks = {NULL, on_disconnected, on_state};
    if (oniRegisterDeviceCallbacks(&callbacks, s, &s->callbacks) != ONI_STATUS_OK)
        s->callbacks = NULL;
    char why[200];
    if (oniDeviceOpen(s->uri, &s->device) != ONI_STATUS_OK) {
        s->device = NULL;
        return s->file ? fail(ERR_INPUT, "%s is no recording that OpenNI2 can play", s->name)
                       : fail(ERR_DEVICE, "%s does not open: %s", s->name, complaint(why));
    }
    enum status status = make_streams(s);
    return status == OK ? start(s) : status;
}

static struct sensor *new_sensor(bool file, const char *name, struct source_facts *facts)
{
    struct sensor *s = calloc(1, sizeof *s);
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

// Takes over `s`; closes it on error.
static enum status finish_open(struct sensor *s, void **self)
{
    pthread_mutex_lock(&opening);
    enum status status = initialize();
    s->initialized = status == OK;
    if (status == OK)
        status = open_device(s);
    pthread_mutex_unlock(&opening);
    if (status == OK)
        *self = s;
    else
        openni_close(s);
    return status;
}

// Finds the N-th device's URI and name.
static enum status find_device(int index, OniDeviceInfo *out)
{
    pthread_mutex_lock(&opening);
    enum status status = initialize();
    if (status == OK) {
        OniDeviceInfo *list = NULL;
        int count = 0;
        if (oniGetDeviceList(&list, &count) != ONI_STATUS_OK)
            count = 0;
        if (index < count)
            *out = list[index];
        else
            status = no_sensor(index, count);
        if (list)
            oniReleaseDeviceList(list);
        oniShutdown();
    }
    pthread_mutex_unlock(&opening);
    return status;
}

enum status openni_open(void **self, const char *where, enum source_wanted wanted, struct source_facts *facts)
{
    (void)wanted;
    *self = NULL;
    char *end = NULL;
    long index = *where ? strtol(where, &end, 10) : 0;
    if (*where && (*end || end == where || index < 0 || index > 999))
        return fail(ERR_INPUT, "'openni:%s' does not say which sensor; write openni:0 for the first", where);
    OniDeviceInfo info;
    enum status status = find_device((int)index, &info);
    if (status != OK)
        return status;
    char name[2 * ONI_MAX_STR + 20];
    snprintf(name, sizeof name, "the sensor %s %s", info.vendor, info.name);
    struct sensor *s = new_sensor(false, name, facts);
    if (!s)
        return fail(ERR_MEMORY, "no memory to open a depth sensor");
    snprintf(s->uri, sizeof s->uri, "%s", info.uri);
    return finish_open(s, self);
}

enum status oni_open(void **self, const char *where, enum source_wanted wanted, struct source_facts *facts)
{
    (void)wanted;
    *self = NULL;
    if (!file_exists(where))
        return fail(ERR_MISSING, "there is no file %s", where);
    char *path = realpath(where, NULL); // OpenNI2 changes the working folder while it opens
    if (!path)
        return fail(ERR_IO, "%s cannot be found by its full path", where);
    if (strlen(path) >= ONI_MAX_STR) {
        free(path);
        return fail(ERR_INPUT, "the full path of %s is longer than the %d letters OpenNI2 takes", where,
                    ONI_MAX_STR - 1);
    }
    struct sensor *s = new_sensor(true, where, facts);
    if (s)
        snprintf(s->uri, sizeof s->uri, "%s", path);
    free(path);
    return s ? finish_open(s, self) : fail(ERR_MEMORY, "no memory to open %s", where);
}

// ------------------------------------------------------------- frames

static int64_t time_of(const OniFrame *frame)
{
    return (int64_t)frame->timestamp * 1000; // microseconds
}

static void drop_oldest(struct lane *lane, int how_many)
{
    for (int i = 0; i < how_many; i++)
        oniFrameRelease(lane->queue[i]);
    lane->count -= how_many;
    memmove(lane->queue, lane->queue + how_many, (size_t)lane->count * sizeof *lane->queue);
}

// Waits at most `wait_ms` for a picture and puts it into its queue. NOTHING: none came.
static enum status take_picture(struct sensor *s, int wait_ms)
{
    struct lane *lanes[2] = {&s->depth, &s->color};
    OniStreamHandle streams[2] = {s->depth.stream, s->color.stream};
    int index = 0;
    OniFrame *frame = NULL;
    if (oniWaitForAnyStream(streams, s->color.stream ? 2 : 1, &index, wait_ms) != ONI_STATUS_OK ||
        oniStreamReadFrame(streams[index], &frame) != ONI_STATUS_OK || !frame)
        return NOTHING;
    struct lane *lane = lanes[index];
    if (s->file)
        gate_taken(lane, (struct block *)((uint8_t *)frame->data - BLOCK_BYTES));
    if (lane->count == QUEUE)
        drop_oldest(lane, 1);
    lane->queue[lane->count++] = frame;
    return OK;
}

// Is it known which colour picture, if any, belongs to the oldest depth picture? For a file
// this depends on the pictures' order alone, never on how fast they come.
static bool decided(const struct sensor *s, bool over)
{
    if (!s->depth.count)
        return false;
    if (over || !s->color.stream)
        return true;
    if (s->color.count && time_of(s->color.queue[s->color.count - 1]) >= time_of(s->depth.queue[0]))
        return true; // whatever comes later is further away
    return s->depth.count >= (s->file ? QUEUE : 2);
}

static enum status copy_depth(struct sensor *s, const OniFrame *frame)
{
    int w = s->depth.mode.resolutionX, h = s->depth.mode.resolutionY;
    if (frame->width != w || frame->height != h || frame->stride < w * 2 ||
        frame->dataSize < frame->stride * (h - 1) + w * 2)
        return fail(ERR_INPUT, "%s: depth picture %d has %d x %d pixels where %d x %d were announced", s->name,
                    frame->frameIndex, frame->width, frame->height, w, h);
    bool tenths = s->depth.mode.pixelFormat == ONI_PIXEL_FORMAT_DEPTH_100_UM;
    for (int y = 0; y < h; y++) {
        const uint16_t *in =
            (const uint16_t *)(const void *)((const uint8_t *)frame->data + (size_t)y * (size_t)frame->stride);
        uint16_t *out = s->mm + (size_t)y * (size_t)w;
        for (int x = 0; x < w; x++) {
            int value = in[s->depth.mirrored ? w - 1 - x : x];
            out[x] = (uint16_t)(tenths ? (value + 5) / 10 : value);
        }
    }
    return OK;
}

static enum status copy_color(struct sensor *s, const OniFrame *frame)
{
    int w = s->color.mode.resolutionX, h = s->color.mode.resolutionY;
    if (frame->width != w || frame->height != h || frame->stride < w * 3 ||
        frame->dataSize < frame->stride * (h - 1) + w * 3)
        return fail(ERR_INPUT, "%s: colour picture %d has %d x %d pixels where %d x %d were announced", s->name,
                    frame->frameIndex, frame->width, frame->height, w, h);
    for (int y = 0; y < h; y++) {
        const uint8_t *in = (const uint8_t *)frame->data + (size_t)y * (size_t)frame->stride;
        uint8_t *out = s->rgb + (size_t)y * (size_t)w * 3;
        if (!s->color.mirrored)
            memcpy(out, in, (size_t)w * 3);
        else
            for (int x = 0; x < w; x++)
                memcpy(out + 3 * x, in + 3 * (w - 1 - x), 3);
    }
    return OK;
}

// Makes a frame of the oldest depth picture and its colour. NOTHING: its time does not rise, it was dropped.
static enum status hand_out(struct sensor *s, struct frame *out)
{
    const OniFrame *depth = s->depth.queue[0];
    int64_t time_ns = time_of(depth);
    int best = -1;
    for (int i = 0; i < s->color.count; i++)
        if (best < 0 || llabs(time_of(s->color.queue[i]) - time_ns) < llabs(time_of(s->color.queue[best]) - time_ns))
            best = i;
    if (best >= 0 && llabs(time_of(s->color.queue[best]) - time_ns) > s->half_frame_ns)
        best = -1;
    if (s->last_index >= 0 && depth->frameIndex > s->last_index + 1)
        s->facts->dropped += depth->frameIndex - s->last_index - 1;
    s->last_index = depth->frameIndex;
    if (s->facts->remaining > 0)
        s->facts->remaining--;
    enum status status = OK;
    if (time_ns <= s->last_time_ns) {
        s->facts->dropped++;
        status = NOTHING;
    } else {
        s->last_time_ns = time_ns;
        out->time_ns = time_ns;
        snprintf(out->name, sizeof out->name, "%04lld", (long long)s->handed_out++);
        status = copy_depth(s, depth);
        if (status == OK && best >= 0)
            status = copy_color(s, s->color.queue[best]);
        out->depth = s->mm;
        out->color = best >= 0 ? s->rgb : NULL;
        int used = best + 1; // those before it are too old for what comes
        while (used < s->color.count && time_of(s->color.queue[used]) < time_ns - s->half_frame_ns)
            used++;
        drop_oldest(&s->color, used);
    }
    drop_oldest(&s->depth, 1);
    return status;
}

static enum status openni_next(void *self, struct frame *out)
{
    struct sensor *s = self;
    int64_t since_ns = clock_now_ns();
    for (;;) {
        while (s->depth.count < QUEUE && !(s->file && decided(s, false)) && take_picture(s, 0) == OK)
            since_ns = clock_now_ns();
        // Read before the queues are looked at again: what came before the end is already there.
        bool over = atomic_load(&s->ended);
        if (over)
            while (s->depth.count < QUEUE && take_picture(s, 0) == OK)
                ;
        if (!s->file && s->depth.count > 2)
            drop_oldest(&s->depth, s->depth.count - 2); // late: the newest is wanted; the gap is counted
        if (decided(s, over)) {
            enum status status = hand_out(s, out);
            if (status != NOTHING)
                return status;
            continue;
        }
        if (over)
            return NOTHING;
        if (atomic_load(&s->gone))
            return fail(ERR_DEVICE, "%s was unplugged", s->name);
        if (take_picture(s, SLICE_MS) == OK)
            since_ns = clock_now_ns();
        else if (clock_now_ns() - since_ns > (s->file ? FILE_SILENCE_NS : LIVE_SILENCE_NS))
            return s->file ? fail(ERR_INPUT, "%s breaks off in the middle: it is damaged or was not finished", s->name)
                           : fail(ERR_DEVICE, "%s has sent no picture for %d seconds; is it still plugged in?", s->name,
                                  (int)(LIVE_SILENCE_NS / 1000000000));
    }
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
