// Depth cameras that the kernel's own driver opens (Video4Linux, most often uvcvideo): v4l2, v4l2:N for /dev/videoN.
//
// A depth camera is a node that offers the format Z16, 16 bits a pixel, taken as millimetres: RealSense's default (a
// D405's is a tenth of that). Colour is the first other node of the same device, by the bus that the driver states,
// which offers YUYV or Motion JPEG. A frame is a depth image with the colour image nearest in time, at most half a
// frame away; it is waited for so long. Both run by the kernel's monotonic clock.
//
// The kernel states no lens: depth's has to be in the device's calibration file, v4l2-SERIAL.json (source_internal.h),
// else the camera is refused. Colour's is guessed where it is not there, and the two cameras are in one position.
#include "platform/sensors/v4l2.h"

#include "base/pixels.h"
#include "base/text.h"
#include "platform/files/installed.h"
#include "platform/files/jpeg.h"
#include "platform/sensors/source_internal.h"

#include <errno.h>
#include <fcntl.h>
#include <linux/videodev2.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <unistd.h>

enum { NODES = 64, BUFFERS = 4, PATIENCE_MS = 2000, WANTED_WIDTH = 640, WANTED_HEIGHT = 480 };
enum { FRAME_NS = 33333333 }; // of 30 a second, which is asked for

// ---------------------------------------------------------------- the kernel

static int open_node(int number)
{
    char path[32];
    snprintf(path, sizeof path, "/dev/video%d", number);
    return open(path, O_RDONLY | O_NONBLOCK | O_CLOEXEC); // images are only read; the driver asks for no more
}

static int control_node(int file, unsigned long request, void *argument) { return ioctl(file, request, argument); }

static void *map_node(size_t bytes, int file, off_t at) { return mmap(NULL, bytes, PROT_READ, MAP_SHARED, file, at); }

static const struct v4l2_system kernel = {
    open_node, control_node, map_node, munmap, poll, close, "/sys/class/video4linux"};
static const struct v4l2_system *calls = &kernel;

void v4l2_use_system(const struct v4l2_system *system) { calls = system ? system : &kernel; }

static int control(int file, unsigned long request, void *argument)
{
    int result;
    do
        result = calls->control(file, request, argument);
    while (result < 0 && errno == EINTR);
    return result;
}

// ---------------------------------------------------------------- nodes

// False: no node that gives images.
static bool query_node(int file, struct v4l2_capability *out)
{
    *out = (struct v4l2_capability){.version = 0};
    if (control(file, VIDIOC_QUERYCAP, out) < 0)
        return false;
    const uint32_t can = out->capabilities & V4L2_CAP_DEVICE_CAPS ? out->device_caps : out->capabilities;
    return can & V4L2_CAP_VIDEO_CAPTURE && can & V4L2_CAP_STREAMING;
}

// Whether it offers the format of pixels.
static bool offers_format(int file, uint32_t format)
{
    for (uint32_t i = 0; i < 64; i++) {
        struct v4l2_fmtdesc about = {.index = i, .type = V4L2_BUF_TYPE_VIDEO_CAPTURE};
        if (control(file, VIDIOC_ENUM_FMT, &about) < 0)
            return false;
        if (about.pixelformat == format)
            return true;
    }
    return false;
}

// A line that the kernel states of the node's device. False: none.
static bool read_statement(int number, const char *name, char *out, size_t bytes)
{
    char path[400];
    snprintf(path, sizeof path, "%s/video%d/device/../%s", calls->class_folder, number, name);
    FILE *file = fopen(path, "r");
    const bool read = file && fgets(out, (int)bytes, file);
    if (file)
        fclose(file);
    if (read)
        out[strcspn(out, "\n")] = 0;
    return read;
}

// ---------------------------------------------------------------- a stream

struct stream {
    int file; // -1: there is none
    struct v4l2_capability about;
    struct v4l2_pix_format format;
    struct {
        void *at;
        size_t bytes;
    } buffers[BUFFERS];
    int held; // the buffer that was taken last and not given back; -1: none
    size_t used;
    int64_t time_ns; // of that
    uint32_t sequence;
    bool any; // an image came
};

struct v4l2_sensor {
    struct stream depth, color;
    uint16_t *mm;
    uint8_t *rgb;
    int64_t index, last_ns;
    struct source_facts *facts;
};

static enum status fail_stream(const struct stream *stream, const char *what)
{
    return fail(ERR_DEVICE, "%.32s %s (%s)", (const char *)stream->about.card, what, strerror(errno));
}

static enum status set_format(struct stream *stream, uint32_t pixels)
{
    struct v4l2_format format = {.type = V4L2_BUF_TYPE_VIDEO_CAPTURE};
    format.fmt.pix = (struct v4l2_pix_format){
        .width = WANTED_WIDTH, .height = WANTED_HEIGHT, .pixelformat = pixels, .field = V4L2_FIELD_NONE};
    if (control(stream->file, VIDIOC_S_FMT, &format) < 0)
        return fail_stream(stream, errno == EBUSY ? "is used by another program" : "takes no format of images");
    stream->format = format.fmt.pix;
    struct v4l2_streamparm rate = {.type = V4L2_BUF_TYPE_VIDEO_CAPTURE};
    rate.parm.capture.timeperframe = (struct v4l2_fract){1, 30};
    control(stream->file, VIDIOC_S_PARM, &rate); // a driver without rates has its own
    const struct v4l2_pix_format *p = &stream->format;
    const bool packed = pixels != V4L2_PIX_FMT_MJPEG; // with rows of a known length
    if (p->pixelformat != pixels || !image_size_is_usable(p->width, p->height) || p->width % 2 ||
        (packed && (p->bytesperline < 2 * p->width || p->bytesperline > 1u << 20)))
        return fail(ERR_DEVICE, "%.32s: its images of %u x %u pixels cannot be used", (const char *)stream->about.card,
                    p->width, p->height);
    return OK;
}

static bool give_buffer(const struct stream *stream, int index)
{
    struct v4l2_buffer buffer = {
        .index = (uint32_t)index, .type = V4L2_BUF_TYPE_VIDEO_CAPTURE, .memory = V4L2_MEMORY_MMAP};
    return control(stream->file, VIDIOC_QBUF, &buffer) >= 0;
}

static enum status map_buffers(struct stream *stream)
{
    struct v4l2_requestbuffers wanted = {
        .count = BUFFERS, .type = V4L2_BUF_TYPE_VIDEO_CAPTURE, .memory = V4L2_MEMORY_MMAP};
    if (control(stream->file, VIDIOC_REQBUFS, &wanted) < 0 || wanted.count < 2)
        return fail_stream(stream, "has no memory for images");
    for (uint32_t i = 0; i < wanted.count && i < BUFFERS; i++) {
        struct v4l2_buffer buffer = {.index = i, .type = V4L2_BUF_TYPE_VIDEO_CAPTURE, .memory = V4L2_MEMORY_MMAP};
        if (control(stream->file, VIDIOC_QUERYBUF, &buffer) < 0)
            return fail_stream(stream, "has no memory for images");
        void *at = calls->map(buffer.length, stream->file, (off_t)buffer.m.offset);
        if (at == MAP_FAILED)
            return fail_stream(stream, "gives no access to its images");
        stream->buffers[i].at = at;
        stream->buffers[i].bytes = buffer.length;
        if (!give_buffer(stream, (int)i))
            return fail_stream(stream, "takes no memory for images");
    }
    return OK;
}

static enum status start_stream(struct stream *stream, uint32_t pixels)
{
    int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    enum status status = set_format(stream, pixels);
    if (status == OK)
        status = map_buffers(stream);
    if (status == OK && control(stream->file, VIDIOC_STREAMON, &type) < 0)
        status = fail_stream(stream, "does not start");
    return status;
}

static void close_stream(struct stream *stream)
{
    int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    if (stream->file < 0)
        return;
    control(stream->file, VIDIOC_STREAMOFF, &type);
    for (int i = 0; i < BUFFERS; i++)
        if (stream->buffers[i].at)
            calls->unmap(stream->buffers[i].at, stream->buffers[i].bytes);
    calls->close_node(stream->file);
    stream->file = -1;
}

// The next image that is there, in place of the one before. NOTHING: none is. ERR_DEVICE: unplugged.
static enum status take_image(struct stream *stream, int64_t *dropped)
{
    for (;;) {
        struct v4l2_buffer buffer = {.type = V4L2_BUF_TYPE_VIDEO_CAPTURE, .memory = V4L2_MEMORY_MMAP};
        if (control(stream->file, VIDIOC_DQBUF, &buffer) < 0)
            return errno == EAGAIN ? NOTHING : fail_stream(stream, "gives no more images; is it plugged in?");
        if (buffer.index >= BUFFERS || !stream->buffers[buffer.index].at)
            return fail(ERR_DEVICE, "%.32s gives an image that nobody asked for", (const char *)stream->about.card);
        const int64_t time_ns =
            (int64_t)buffer.timestamp.tv_sec * 1000000000 + (int64_t)buffer.timestamp.tv_usec * 1000;
        const uint32_t missing = stream->any ? buffer.sequence - stream->sequence - 1 : 0;
        *dropped += missing < 1000 ? missing : 0;
        stream->sequence = buffer.sequence;
        if (buffer.flags & V4L2_BUF_FLAG_ERROR || (stream->any && time_ns <= stream->time_ns)) {
            ++*dropped;
            if (!give_buffer(stream, (int)buffer.index))
                return fail_stream(stream, "takes no memory for images");
            continue;
        }
        if (stream->held >= 0 && !give_buffer(stream, stream->held))
            return fail_stream(stream, "takes no memory for images");
        stream->held = (int)buffer.index;
        const size_t room = stream->buffers[buffer.index].bytes;
        stream->used = buffer.bytesused < room ? buffer.bytesused : room;
        stream->time_ns = time_ns;
        stream->any = true;
        return OK;
    }
}

// ---------------------------------------------------------------- frames

// Waits for a depth image.
static enum status next_depth(struct v4l2_sensor *sensor)
{
    for (;;) {
        enum status status = take_image(&sensor->depth, &sensor->facts->dropped);
        if (status != NOTHING)
            return status;
        struct pollfd file = {.fd = sensor->depth.file, .events = POLLIN};
        const int ready = calls->wait(&file, 1, PATIENCE_MS);
        if (ready == 0)
            return fail(ERR_DEVICE, "%.32s gives no depth images", (const char *)sensor->depth.about.card);
        if (ready < 0 && errno != EINTR)
            return fail_stream(&sensor->depth, "gives no more images");
    }
}

// The newest colour image that is there; waits half a frame for one that is not older than depth. *missing: none is
// near in time.
static enum status next_color(struct v4l2_sensor *sensor, bool *missing)
{
    struct stream *color = &sensor->color;
    const int64_t depth_ns = sensor->depth.time_ns;
    int64_t unused = 0;
    *missing = true;
    if (color->file < 0)
        return OK;
    for (bool waited = false;;) {
        const enum status status = take_image(color, &unused);
        if (status == OK)
            continue;
        if (status < 0)
            return status;
        if (waited || (color->any && color->time_ns >= depth_ns))
            break;
        struct pollfd file = {.fd = color->file, .events = POLLIN};
        waited = calls->wait(&file, 1, FRAME_NS / 2000000) <= 0;
    }
    *missing = !color->any || llabs(color->time_ns - depth_ns) > FRAME_NS / 2;
    return OK;
}

static enum status show_depth(struct v4l2_sensor *sensor, struct frame *out)
{
    const struct stream *depth = &sensor->depth;
    const size_t width = depth->format.width, stride = depth->format.bytesperline;
    const uint8_t *from = depth->buffers[depth->held].at;
    if (depth->used < stride * (depth->format.height - 1) + 2 * width)
        return fail(ERR_INPUT, "%.32s: depth image %lld is cut short", (const char *)depth->about.card,
                    (long long)sensor->index - 1);
    for (size_t y = 0; y < depth->format.height; y++)
        for (size_t x = 0; x < width; x++)
            sensor->mm[y * width + x] = (uint16_t)(from[y * stride + 2 * x] | from[y * stride + 2 * x + 1] << 8);
    out->depth = sensor->mm;
    return OK;
}

static enum status show_color(struct v4l2_sensor *sensor, struct frame *out)
{
    const struct stream *color = &sensor->color;
    const struct v4l2_pix_format *p = &color->format;
    const int width = (int)p->width, height = (int)p->height;
    const uint8_t *from = color->buffers[color->held].at;
    if (p->pixelformat == V4L2_PIX_FMT_MJPEG) {
        if (jpeg_decode(from, color->used, sensor->rgb, width, height) != OK)
            return OK; // a colour image that is damaged is missing
        out->jpeg = from;
        out->jpeg_bytes = color->used;
    } else {
        if (color->used < (size_t)p->bytesperline * (p->height - 1) + 2 * (size_t)p->width)
            return OK;
        const struct yuv_layout layout = {{YUV_BT601, false}, width, height};
        pixels_from_yuv422(from, p->bytesperline, true, &layout, sensor->rgb);
    }
    out->color = sensor->rgb;
    sensor->facts->pairs++;
    return OK;
}

static enum status v4l2_next(void *self, struct frame *out)
{
    struct v4l2_sensor *sensor = self;
    bool missing;
    enum status status = next_depth(sensor);
    if (status == OK)
        status = next_color(sensor, &missing);
    if (status != OK)
        return status;
    stream_times_add(&sensor->facts->depth_times, sensor->depth.time_ns);
    out->time_ns = sensor->depth.time_ns;
    snprintf(out->name, sizeof out->name, "%04lld", (long long)sensor->index++);
    status = show_depth(sensor, out);
    return status == OK && !missing ? show_color(sensor, out) : status;
}

// ---------------------------------------------------------------- opening

static uint32_t color_format(int file)
{
    if (offers_format(file, V4L2_PIX_FMT_YUYV))
        return V4L2_PIX_FMT_YUYV;
    return offers_format(file, V4L2_PIX_FMT_MJPEG) ? V4L2_PIX_FMT_MJPEG : 0;
}

// The colour camera of the same device, where there is one that starts.
static void open_color(struct v4l2_sensor *sensor, int depth_number)
{
    for (int i = 0; i < NODES && sensor->color.file < 0; i++) {
        struct stream found = {.file = i == depth_number ? -1 : calls->open_node(i), .held = -1};
        if (found.file < 0)
            continue;
        const bool beside = query_node(found.file, &found.about) &&
                            !memcmp(found.about.bus_info, sensor->depth.about.bus_info, sizeof found.about.bus_info) &&
                            !offers_format(found.file, V4L2_PIX_FMT_Z16);
        const uint32_t format = beside ? color_format(found.file) : 0;
        if (format && start_stream(&found, format) == OK)
            sensor->color = found;
        else
            close_stream(&found);
    }
}

static enum status open_depth(struct v4l2_sensor *sensor, int number)
{
    struct stream *depth = &sensor->depth;
    depth->file = calls->open_node(number);
    if (depth->file < 0)
        return fail(errno == ENOENT ? ERR_MISSING : ERR_DEVICE, "/dev/video%d: %s", number, strerror(errno));
    if (!query_node(depth->file, &depth->about) || !offers_format(depth->file, V4L2_PIX_FMT_Z16))
        return fail(ERR_INPUT, "/dev/video%d is no depth camera: it offers no images of 16-bit depth (Z16)", number);
    return start_stream(depth, V4L2_PIX_FMT_Z16);
}

static enum status read_calibration(struct v4l2_sensor *sensor, int number)
{
    struct source_facts *facts = sensor->facts;
    char serial[64];
    const struct v4l2_pix_format *d = &sensor->depth.format, *c = &sensor->color.format;
    facts->calibration = (struct calibration){.depth = camera_lens_guess((int)d->width, (int)d->height),
                                              .color_from_depth = POSE_IDENTITY};
    if (sensor->color.file >= 0)
        facts->calibration.color = camera_lens_guess((int)c->width, (int)c->height);
    if (!read_statement(number, "serial", serial, sizeof serial))
        snprintf(serial, sizeof serial, "%.32s", (const char *)sensor->depth.about.card);
    snprintf(facts->camera_id, sizeof facts->camera_id, "v4l2-%s", serial);
    enum status status = device_calibration_apply(facts->camera_id, &facts->calibration);
    if (status == OK && facts->calibration.depth.focal_sigma > 0) {
        char path[4096], text[INSTALLED_PATH_BYTES];
        status = camera_calibration_file(facts->camera_id, path, sizeof path);
        if (status == OK)
            status = fail(ERR_INPUT,
                          "%.32s: the kernel states no lens, and without depth's no distance aside is right; write it "
                          "into %s, as %s says",
                          (const char *)sensor->depth.about.card, path, installed_text("sensors.md", text));
    }
    facts->calibration.registered = sensor->color.file < 0;
    return status;
}

static void v4l2_close(void *self)
{
    struct v4l2_sensor *sensor = self;
    if (!sensor)
        return;
    close_stream(&sensor->depth);
    close_stream(&sensor->color);
    free(sensor->mm);
    free(sensor->rgb);
    free(sensor);
}

static enum status open_steps(struct v4l2_sensor *sensor, int number)
{
    enum status status = open_depth(sensor, number);
    if (status != OK)
        return status;
    open_color(sensor, number);
    const struct v4l2_pix_format *d = &sensor->depth.format, *c = &sensor->color.format;
    sensor->mm = malloc((size_t)d->width * d->height * sizeof *sensor->mm);
    sensor->rgb = malloc(3 * (size_t)c->width * c->height + 1);
    if (!sensor->mm || !sensor->rgb)
        return fail(ERR_MEMORY, "no memory for the images of a depth camera");
    return read_calibration(sensor, number);
}

// The first depth camera; -1: none.
static int first_depth_camera(void)
{
    struct source_device device;
    int count;
    if (v4l2_devices(&device, 1, &count) != OK || !count)
        return -1;
    return atoi(strchr(device.uri, ':') + 1);
}

enum status v4l2_open(void **self, const char *where, enum source_wanted wanted, struct source_facts *facts)
{
    (void)wanted; // a sensor
    int number = 0;
    *self = NULL;
    if (*where && !text_index(where, NODES - 1, &number))
        return fail(ERR_INPUT, "'v4l2:%s' does not say which camera; write v4l2:0 for /dev/video0", where);
    if (!*where && (number = first_depth_camera()) < 0)
        return fail(ERR_MISSING, "no camera of the kernel's (/dev/video0 and so on) gives depth");
    struct v4l2_sensor *sensor = calloc(1, sizeof *sensor);
    if (!sensor)
        return fail(ERR_MEMORY, "no memory to open a depth camera");
    sensor->depth.file = sensor->color.file = -1;
    sensor->depth.held = sensor->color.held = -1;
    sensor->facts = facts;
    facts->live = true;
    const enum status status = open_steps(sensor, number);
    if (status != OK) {
        struct failure first;
        failure_keep(&first, status);
        v4l2_close(sensor);
        return failure_restore(&first);
    }
    *self = sensor;
    return OK;
}

const struct source_kind v4l2_kind = {v4l2_next, v4l2_close};

enum status v4l2_devices(struct source_device *out, int capacity, int *count)
{
    *count = 0;
    for (int i = 0; i < NODES; i++) {
        struct v4l2_capability about;
        char id[16];
        const int file = calls->open_node(i);
        if (file < 0)
            continue;
        if (query_node(file, &about) && offers_format(file, V4L2_PIX_FMT_Z16)) {
            if (*count < capacity) {
                struct source_device *device = &out[*count];
                *device = (struct source_device){.usb_vendor = 0};
                snprintf(device->uri, sizeof device->uri, "v4l2:%d", i);
                snprintf(device->name, sizeof device->name, "%.32s", (const char *)about.card);
                if (read_statement(i, "idVendor", id, sizeof id))
                    device->usb_vendor = (uint16_t)strtoul(id, NULL, 16);
                if (read_statement(i, "idProduct", id, sizeof id))
                    device->usb_product = (uint16_t)strtoul(id, NULL, 16);
            }
            ++*count;
        }
        calls->close_node(file);
    }
    return OK;
}
