// UVC descriptors, control requests and payload headers of uvc.h.
#include "tests/usb_camera/uvc.h"

#include <errno.h>
#include <string.h>

enum { SET_CUR = 0x01, GET_CUR = 0x81, GET_MIN, GET_MAX, GET_RES, GET_LEN, GET_INFO, GET_DEF };
enum { PROBE = 1, COMMIT = 2, PROBE_BYTES = 26, PAYLOAD_HEADER = 12 };

// A growing sequence of bytes.
struct bytes {
    uint8_t at[512];
    int count;
};

static void put(struct bytes *b, const uint8_t *what, int count)
{
    memcpy(b->at + b->count, what, (size_t)count);
    b->count += count;
}
#define PUT(b, ...) put(b, (const uint8_t[]){__VA_ARGS__}, (int)sizeof((const uint8_t[]){__VA_ARGS__}))
#define LE16(x)     (uint8_t)(x), (uint8_t)((x) >> 8)
#define LE32(x)     LE16(x), LE16((uint32_t)(x) >> 16)

static uint32_t image_bytes(const struct uvc_camera *c) { return (uint32_t)(2 * c->width * c->height); }

static void put_streaming(const struct uvc_camera *c, struct bytes *b)
{
    const uint32_t interval = (uint32_t)(c->frame_ns / 100), rate = 8 * image_bytes(c) * 30;
    const bool jpeg = c->format == UVC_MJPEG;
    const int total = 14 + (jpeg ? 11 : 27) + 30 + 6;
    PUT(b, 9, 4, 1, 0, 1, 0x0e, 2, 0, 0);                                          // video streaming
    PUT(b, 14, 0x24, 1, 1, LE16(total), 0x80 | UVC_ENDPOINT, 0, 2, 0, 0, 0, 1, 0); // its header
    if (jpeg)
        PUT(b, 11, 0x24, 6, 1, 1, 1, 1, 0, 0, 0, 0);
    else
        PUT(b, 27, 0x24, 4, 1, 1, 'Y', 'U', 'Y', '2', 0, 0, 0x10, 0, 0x80, 0, 0, 0xaa, 0, 0x38, 0x9b, 0x71, 16, 1, 0, 0,
            0, 0);
    PUT(b, 30, 0x24, jpeg ? 7 : 5, 1, 0, LE16(c->width), LE16(c->height), LE32(rate), LE32(rate), LE32(image_bytes(c)),
        LE32(interval), 1, LE32(interval));
    PUT(b, 6, 0x24, 13, 1, 1, c->bt709 ? 1 : 4); // colour primaries, transfer function and matrix
    PUT(b, 7, 5, 0x80 | UVC_ENDPOINT, 2, LE16(512), 0);
}

static void put_configuration(const struct uvc_camera *c, struct bytes *b)
{
    PUT(b, 9, 2, 0, 0, 2, 1, 0, 0x80, 250);
    PUT(b, 8, 11, 0, 2, 0x0e, 3, 0, 0);   // both interfaces are one function
    PUT(b, 9, 4, 0, 0, 0, 0x0e, 1, 0, 0); // video control
    PUT(b, 13, 0x24, 1, LE16(0x100), LE16(13 + 18 + 9), LE32(48000000), 1, 1);
    PUT(b, 18, 0x24, 2, 1, LE16(0x201), 0, 0, LE16(0), LE16(0), LE16(0), 3, 0, 0, 0); // the camera
    PUT(b, 9, 0x24, 3, 2, LE16(0x101), 0, 1, 0);                                      // its output terminal
    put_streaming(c, b);
    b->at[2] = (uint8_t)b->count;
    b->at[3] = (uint8_t)(b->count >> 8);
}

// False: there is no such descriptor.
static bool put_descriptor(const struct uvc_camera *c, int kind, int index, struct bytes *b)
{
    static const char *const strings[] = {"", "Reenact", "Camera of paper", "0001"};
    switch (kind) {
    case 1:
        PUT(b, 18, 1, LE16(0x200), 0xef, 2, 1, 64, LE16(0x1209), LE16(0x0001), LE16(0x100), 1, 2, 3, 1);
        return true;
    case 2: put_configuration(c, b); return true;
    case 3:
        if (index >= (int)COUNT_OF(strings))
            return false;
        if (index == 0) {
            PUT(b, 4, 3, LE16(0x409));
            return true;
        }
        PUT(b, (uint8_t)(2 + 2 * strlen(strings[index])), 3);
        for (const char *s = strings[index]; *s; s++)
            PUT(b, LE16(*s));
        return true;
    default: return false;
    }
}

static void put_probe(const struct uvc_camera *c, struct bytes *b)
{
    PUT(b, LE16(1), 1, 1, LE32((uint32_t)(c->frame_ns / 100)), LE16(0), LE16(0), LE16(0), LE16(0), LE16(0),
        LE32(image_bytes(c)), LE32(UVC_PAYLOAD_BYTES));
}

// False: unsupported.
static bool video_request(struct uvc_camera *c, const struct usb_request *r, struct bytes *b)
{
    const int request = r->setup[1], selector = r->setup[3], interface = r->setup[4], entity = r->setup[5];
    if (interface != 1 || entity != 0 || (selector != PROBE && selector != COMMIT))
        return false;
    switch (request) {
    case SET_CUR:
        memcpy(c->chosen, r->data, r->length < PROBE_BYTES ? (size_t)r->length : PROBE_BYTES);
        c->committed |= selector == COMMIT;
        return true;
    case GET_LEN: PUT(b, LE16(PROBE_BYTES)); return true;
    case GET_INFO: PUT(b, 3); return true;
    case GET_CUR:
    case GET_MIN:
    case GET_MAX:
    case GET_DEF: put_probe(c, b); return true;
    default: return false;
    }
}

static bool standard_request(const struct uvc_camera *c, const struct usb_request *r, struct bytes *b)
{
    enum {
        GET_STATUS = 0,
        CLEAR_FEATURE = 1,
        GET_DESCRIPTOR = 6,
        GET_CONFIGURATION = 8,
        SET_CONFIGURATION = 9,
        GET_INTERFACE = 10,
        SET_INTERFACE = 11
    };
    switch (r->setup[1]) {
    case GET_STATUS: PUT(b, 0, 0); return true;
    case GET_DESCRIPTOR: return put_descriptor(c, r->setup[3], r->setup[2], b);
    case GET_CONFIGURATION: PUT(b, 1); return true;
    case GET_INTERFACE: PUT(b, 0); return true;
    case CLEAR_FEATURE:
    case SET_CONFIGURATION:
    case SET_INTERFACE: return true;
    default: return false;
    }
}

bool uvc_control(struct uvc_camera *c, int socket, const struct usb_request *r)
{
    struct bytes b = {.count = 0};
    const bool of_class = (r->setup[0] & 0x60) == 0x20;
    bool done = of_class ? video_request(c, r, &b) : standard_request(c, r, &b);
    if (!done)
        return usbip_answer(socket, r, -EPIPE, NULL, 0);
    int count = r->in ? (b.count < r->length ? b.count : r->length) : r->length;
    return usbip_answer(socket, r, 0, b.at, count);
}

int uvc_payload(const uint8_t *image, size_t count, size_t *at, bool frame_id, uint8_t out[UVC_PAYLOAD_BYTES])
{
    const size_t space = UVC_PAYLOAD_BYTES - PAYLOAD_HEADER, left = count - *at, now = left < space ? left : space;
    memset(out, 0, PAYLOAD_HEADER);
    out[0] = PAYLOAD_HEADER;
    out[1] = (uint8_t)(0x80 | (frame_id ? 1 : 0) | (now == left ? 2 : 0)); // end of header, frame id, end of frame
    memcpy(out + PAYLOAD_HEADER, image + *at, now);
    *at += now;
    return PAYLOAD_HEADER + (int)now;
}
