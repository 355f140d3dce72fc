// A simulated USB camera: the images of a folder, repeated endlessly, served by USB/IP to the
// kernel that this runs on (vhci-hcd, uvcvideo). Needs root.
#include "app/commands/command.h"
#include "base/clock.h"
#include "platform/files/jpeg.h"
#include "platform/sensors/source.h"
#include "tests/usb_camera/uvc.h"

#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { MAX_WAITING = 32, QUALITY = 95 };
enum { KEY_FORMAT = COMMAND_KEY, KEY_RATE, KEY_BT709, KEY_CROP };

struct camera_arguments {
    const char *source; // URI
    enum uvc_format format;
    double rate_hz;
    bool bt709;
    int crop_width, crop_height; // 0: the whole image
};

struct usb_image {
    uint8_t *bytes;
    size_t count;
};

struct camera {
    const struct camera_arguments *arguments;
    struct uvc_camera uvc;
    struct usb_image *images;
    int image_count;
    int socket;
    struct usb_request *waiting; // for a payload, oldest first
    int waiting_count;
    long sent;      // images
    size_t at;      // bytes of the current image already sent
    int64_t due_ns; // when the current image may be sent
};

static const struct argp_option options[] = {
    {"format", KEY_FORMAT, "mjpeg|yuyv", 0, "how the pictures are coded (default mjpeg)", 0},
    {"rate", KEY_RATE, "HZ", 0, "pictures a second (default 10)", 0},
    {"bt709", KEY_BT709, NULL, 0, "yuyv by the matrix of BT.709, not BT.601", 0},
    {"crop", KEY_CROP, "WxH", 0, "only so much of each picture, from its top left corner", 0},
    {0},
};

static error_t parse(int key, char *value, struct argp_state *state)
{
    struct camera_arguments *a = state->input;
    switch (key) {
    case KEY_FORMAT:
        if (strcmp(value, "mjpeg") && strcmp(value, "yuyv"))
            argp_error(state, "--format takes mjpeg or yuyv, not '%s'", value);
        a->format = strcmp(value, "yuyv") ? UVC_MJPEG : UVC_YUYV;
        return 0;
    case KEY_RATE:
        a->rate_hz = atof(value);
        if (!(a->rate_hz >= 0.1 && a->rate_hz <= 200))
            argp_error(state, "--rate takes 0.1 to 200, not '%s'", value);
        return 0;
    case KEY_BT709: a->bt709 = true; return 0;
    case KEY_CROP:
        if (sscanf(value, "%dx%d", &a->crop_width, &a->crop_height) != 2 || a->crop_width < 2 || a->crop_height < 2)
            argp_error(state, "--crop takes a size like 321x251, not '%s'", value);
        return 0;
    case ARGP_KEY_ARG: a->source = value; return 0;
    case ARGP_KEY_END: command_require(state, a->source, "folder:DIR"); return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

// ---------------------------------------------------------------- images

// Limited range, chroma averaged over two neighbours; BT.601 or BT.709.
static void to_yuyv(const uint8_t *rgb, size_t pixels, bool bt709, uint8_t *out)
{
    const double kr = bt709 ? 0.2126 : 0.299, kb = bt709 ? 0.0722 : 0.114, kg = 1 - kr - kb;
    for (size_t i = 0; i < pixels; i += 2) {
        double y[2], cb = 0, cr = 0;
        for (size_t k = 0; k < 2; k++) {
            const uint8_t *p = rgb + 3 * (i + k);
            y[k] = kr * p[0] + kg * p[1] + kb * p[2];
            cb += (p[2] - y[k]) / (2 - 2 * kb) / 2;
            cr += (p[0] - y[k]) / (2 - 2 * kr) / 2;
        }
        out[2 * i] = (uint8_t)(16 + 219 * y[0] / 255 + 0.5);
        out[2 * i + 1] = (uint8_t)(128 + 224 * cb / 255 + 0.5);
        out[2 * i + 2] = (uint8_t)(16 + 219 * y[1] / 255 + 0.5);
        out[2 * i + 3] = (uint8_t)(128 + 224 * cr / 255 + 0.5);
    }
}

static enum status encode(const struct camera *c, const uint8_t *rgb, struct usb_image *p)
{
    const int width = c->uvc.width, height = c->uvc.height;
    if (c->arguments->format == UVC_MJPEG)
        return jpeg_encode(rgb, width, height, QUALITY, &p->bytes, &p->count);
    size_t pixels = (size_t)width * (size_t)height;
    p->count = 2 * pixels;
    p->bytes = malloc(p->count);
    if (!p->bytes)
        return fail(ERR_MEMORY, "out of memory");
    to_yuyv(rgb, pixels, c->arguments->bt709, p->bytes);
    return OK;
}

// Crops the image to the camera's size, from its top left corner, encodes it and appends it.
static enum status append(struct camera *c, const uint8_t *rgb, int from_width)
{
    const size_t row = 3 * (size_t)c->uvc.width, rows = (size_t)c->uvc.height;
    struct usb_image *more = realloc(c->images, sizeof *more * (size_t)(c->image_count + 1));
    if (more)
        c->images = more;
    uint8_t *part = more ? malloc(row * rows) : NULL;
    if (!part)
        return fail(ERR_MEMORY, "out of memory");
    for (size_t y = 0; y < rows; y++)
        memcpy(part + y * row, rgb + y * 3 * (size_t)from_width, row);
    struct usb_image *p = &more[c->image_count++];
    *p = (struct usb_image){0};
    enum status status = encode(c, part, p);
    free(part);
    return status;
}

static enum status load(struct camera *c)
{
    struct source *source;
    enum status status = source_open(&source, c->arguments->source, SOURCE_CAMERA);
    if (status != OK)
        return status;
    const struct camera_arguments *a = c->arguments;
    const struct lens *lens = &source_calibration(source)->color;
    const bool cropped = a->crop_width && a->crop_width <= lens->width && a->crop_height <= lens->height;
    c->uvc = (struct uvc_camera){.format = a->format,
                                 .width = cropped ? a->crop_width : lens->width,
                                 .height = cropped ? a->crop_height : lens->height,
                                 .frame_ns = (int)(1e9 / a->rate_hz),
                                 .bt709 = a->bt709};
    struct frame frame;
    while ((status = source_next(source, &frame)) == OK)
        if (frame.color && (status = append(c, frame.color, lens->width)) != OK)
            break;
    source_close(&source);
    if (status == NOTHING && !c->image_count)
        status = fail(ERR_INPUT, "%s holds no picture", c->arguments->source);
    return status == NOTHING ? OK : status;
}

// ---------------------------------------------------------------- serving

static volatile sig_atomic_t frozen;

static void freeze(int signal)
{
    (void)signal;
    frozen = 1;
}

// Answers waiting requests with the images that are due. False: the host disconnected.
static bool feed(struct camera *c)
{
    uint8_t payload[UVC_PAYLOAD_BYTES];
    while (c->waiting_count > 0 && clock_now_ns() >= c->due_ns && !frozen) {
        const struct usb_image *p = &c->images[c->sent % c->image_count];
        int count = uvc_payload(p->bytes, p->count, &c->at, c->sent & 1, payload);
        if (!usbip_answer(c->socket, &c->waiting[0], 0, payload, count))
            return false;
        c->waiting_count--;
        memmove(c->waiting, c->waiting + 1, sizeof *c->waiting * (size_t)c->waiting_count);
        if (c->at == p->count) {
            c->at = 0;
            c->sent++;
            c->due_ns += c->uvc.frame_ns;
            if (c->due_ns < clock_now_ns())
                c->due_ns = clock_now_ns();
        }
    }
    return true;
}

static bool cancel(struct camera *c, const struct usb_request *r)
{
    bool waited = false;
    for (int i = 0; i < c->waiting_count; i++)
        if (c->waiting[i].number == r->number) {
            waited = true;
            c->waiting_count--;
            memmove(c->waiting + i, c->waiting + i + 1, sizeof *c->waiting * (size_t)(c->waiting_count - i));
            c->at = 0; // the host stops: send the current image from its start again
        }
    return usbip_cancelled(c->socket, (uint32_t)r->length, waited);
}

static bool serve_one(struct camera *c, struct usb_request *r)
{
    int64_t left = c->waiting_count > 0 && !frozen ? (c->due_ns - clock_now_ns()) / 1000000 + 1 : 100;
    switch (usbip_receive(c->socket, left < 0 ? 0 : (int)left, r)) {
    case USB_GONE: return false;
    case USB_CANCELLED: return cancel(c, r);
    case USB_REQUEST:
        if (r->endpoint == 0)
            return uvc_control(&c->uvc, c->socket, r);
        if (c->waiting_count == MAX_WAITING || r->length < UVC_PAYLOAD_BYTES)
            return false;
        c->waiting[c->waiting_count++] = *r;
        return true;
    case USB_QUIET: break;
    }
    return true;
}

static enum status serve(struct camera *c)
{
    struct usb_request *request = malloc(sizeof *request);
    c->waiting = malloc(sizeof *c->waiting * MAX_WAITING);
    enum status status = request && c->waiting ? usbip_plug(&c->socket) : fail(ERR_MEMORY, "out of memory");
    if (status == OK) {
        printf("plugged in: %d pictures of %d x %d\n", c->image_count, c->uvc.width, c->uvc.height);
        fflush(stdout);
        while (!command_stopped() && serve_one(c, request) && feed(c))
            ;
        close(c->socket); // which unplugs the device
        printf("unplugged after %ld pictures\n", c->sent);
    }
    free(request);
    free(c->waiting);
    return status;
}

int main(int argc, char **argv)
{
    static const struct argp argp = {
        options,
        parse,
        "folder:DIR",
        "Plugs a simulated USB camera into this machine's own kernel that shows the images of a folder. Needs root "
        "and the kernel's modules vhci-hcd and uvcvideo. Ctrl-C unplugs it; after SIGUSR1 it sends no more, but "
        "stays plugged in.",
        0,
        0,
        0};
    struct camera_arguments arguments = {.format = UVC_MJPEG, .rate_hz = 10};
    argp_parse(&argp, argc, argv, 0, NULL, &arguments);
    command_catch_signals();
    signal(SIGUSR1, freeze);
    struct camera camera = {.arguments = &arguments};
    enum status status = load(&camera);
    if (status == OK)
        status = serve(&camera);
    for (int i = 0; i < camera.image_count; i++)
        free(camera.images[i].bytes);
    free(camera.images);
    return status == OK ? 0 : command_failed(argv[0]);
}
