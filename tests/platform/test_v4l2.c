// A depth camera through Video4Linux, with a stand-in for the kernel that answers by the kernel's own structs: which
// nodes belong together, pixels, times, pairs, what is lost, and what goes wrong.
#include "tests/support/test.h"

#include "platform/sensors/source_internal.h"
#include "platform/sensors/v4l2.h"
#include "tests/support/scratch.h"

#include <errno.h>
#include <linux/videodev2.h>
#include <stdio.h>
#include <sys/mman.h>
#include <unistd.h>

enum { W = 16, H = 12, STRIDE = 2 * W + 6, BUFFERS = 4, FIRST_FILE = 1000 };
static const int64_t STEP_NS = 33333000; // in microseconds, as the kernel states times

// A node of the stand-in's. Image k (from 0) is there from its time on.
struct node {
    const char *card, *bus;
    uint32_t formats[3]; // that it offers
    uint32_t format;     // that was set
    int open, streaming;
    uint8_t images[BUFFERS][STRIDE * H + 64];
    bool queued[BUFFERS];
    uint32_t next;   // image
    int64_t late_ns; // of its images against depth's
    uint32_t lost;   // this image is lost in the bus; 0: none
    uint32_t torn;   // this image is damaged
    uint32_t ends;   // unplugged before this image; 0: never
    int cut;         // bytes that its images lack
};

static struct node nodes[4];
static int64_t now_ns;
static struct scratch scratch;

static uint16_t depth_of(uint32_t image, int x, int y) { return (uint16_t)(500 + 37 * image + 11 * (uint32_t)x + y); }

static int64_t time_of(const struct node *node, uint32_t image)
{
    return 5000000000 + (int64_t)(image + 1) * STEP_NS + node->late_ns;
}

static void paint(const struct node *node, uint32_t image, uint8_t *out)
{
    memset(out, 0xee, STRIDE * H);
    for (int y = 0; y < H; y++)
        for (int x = 0; x < W; x++) {
            uint8_t *at = out + y * STRIDE + 2 * x;
            const uint16_t depth = depth_of(image, x, y);
            at[0] = node->format == V4L2_PIX_FMT_Z16 ? (uint8_t)depth : (uint8_t)(16 + 2 * image); // grey: Y
            at[1] = node->format == V4L2_PIX_FMT_Z16 ? (uint8_t)(depth >> 8) : 128;                // Cb, Cr
        }
}

// ---------------------------------------------------------------- the kernel's answers

static int answer(int number) // what a call returns: 0, or -1 and the error
{
    errno = number;
    return number ? -1 : 0;
}

static int open_node(int number)
{
    if (number >= (int)COUNT_OF(nodes) || !nodes[number].card)
        return answer(ENOENT);
    nodes[number].open++;
    return FIRST_FILE + number;
}

static int close_node(int file)
{
    nodes[file - FIRST_FILE].open--;
    nodes[file - FIRST_FILE].streaming = 0;
    return 0;
}

static void *map_node(size_t bytes, int file, off_t at)
{
    EXPECT_INT(bytes, sizeof nodes[0].images[0]);
    return nodes[file - FIRST_FILE].images[at / 4096];
}

static int unmap_node(void *at, size_t bytes)
{
    (void)at;
    (void)bytes;
    return 0;
}

static int describe(const struct node *node, struct v4l2_capability *out)
{
    snprintf((char *)out->card, sizeof out->card, "%s", node->card);
    snprintf((char *)out->bus_info, sizeof out->bus_info, "%s", node->bus);
    out->capabilities = V4L2_CAP_DEVICE_CAPS | V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
    out->device_caps = node->formats[0] ? V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING : V4L2_CAP_META_CAPTURE;
    return 0;
}

static int set_format(struct node *node, struct v4l2_format *format)
{
    struct v4l2_pix_format *p = &format->fmt.pix;
    node->format = p->pixelformat;
    p->width = W; // a driver gives what it has
    p->height = H;
    p->bytesperline = STRIDE;
    p->sizeimage = STRIDE * H;
    return 0;
}

static int take(struct node *node, struct v4l2_buffer *out)
{
    if (node->ends && node->next >= node->ends)
        return answer(ENODEV);
    if (node->next == node->lost && node->lost)
        node->next++;
    if (!node->streaming || now_ns < time_of(node, node->next))
        return answer(EAGAIN);
    for (uint32_t i = 0; i < BUFFERS; i++)
        if (node->queued[i]) {
            const int64_t time_ns = time_of(node, node->next);
            node->queued[i] = false;
            paint(node, node->next, node->images[i]);
            out->index = i;
            out->bytesused = (uint32_t)(STRIDE * H - node->cut);
            out->sequence = node->next;
            out->flags = node->torn && node->next == node->torn ? V4L2_BUF_FLAG_ERROR : 0;
            out->timestamp.tv_sec = time_ns / 1000000000;
            out->timestamp.tv_usec = time_ns % 1000000000 / 1000;
            node->next++;
            return 0;
        }
    return answer(EAGAIN); // all buffers are the program's
}

static int control_node(int file, unsigned long request, void *argument)
{
    struct node *node = &nodes[file - FIRST_FILE];
    struct v4l2_fmtdesc *about = argument;
    struct v4l2_buffer *buffer = argument;
    switch (request) {
    case VIDIOC_QUERYCAP: return describe(node, argument);
    case VIDIOC_ENUM_FMT:
        if (about->index >= COUNT_OF(node->formats) || !node->formats[about->index])
            return answer(EINVAL);
        about->pixelformat = node->formats[about->index];
        return 0;
    case VIDIOC_S_FMT: return set_format(node, argument);
    case VIDIOC_S_PARM: return answer(ENOTTY);
    case VIDIOC_REQBUFS: return 0;
    case VIDIOC_QUERYBUF:
        buffer->length = sizeof node->images[0];
        buffer->m.offset = 4096 * buffer->index;
        return 0;
    case VIDIOC_QBUF:
        EXPECT_TRUE(!node->queued[buffer->index]);
        node->queued[buffer->index] = true;
        return 0;
    case VIDIOC_STREAMON: node->streaming = 1; return 0;
    case VIDIOC_STREAMOFF:
        node->streaming = 0;
        memset(node->queued, 0, sizeof node->queued); // the kernel gives all of them back
        return 0;
    case VIDIOC_DQBUF: return take(node, argument);
    default: return answer(ENOTTY);
    }
}

// Time goes on until the image is there, or the patience is over.
static int wait_node(struct pollfd *files, nfds_t count, int ms)
{
    EXPECT_INT(count, 1);
    const struct node *node = &nodes[files->fd - FIRST_FILE];
    const uint32_t next = node->next + (node->lost && node->next == node->lost);
    const int64_t due_ns = time_of(node, next), until_ns = now_ns + ms * 1000000ll;
    const bool comes = node->streaming && due_ns <= until_ns;
    now_ns = comes ? (due_ns > now_ns ? due_ns : now_ns) : until_ns;
    return comes || (node->ends && next >= node->ends);
}

static struct v4l2_system system_of_test = {open_node, control_node, map_node, unmap_node, wait_node, close_node, ""};

// A RealSense's nodes: depth, metadata, infrared, colour.
static void plug(void)
{
    static char class_folder[300];
    memset(nodes, 0, sizeof nodes);
    nodes[0] = (struct node){.card = "Depth camera", .bus = "usb-1", .formats = {V4L2_PIX_FMT_GREY, V4L2_PIX_FMT_Z16}};
    nodes[1] = (struct node){.card = "Depth camera", .bus = "usb-1"};
    nodes[2] = (struct node){.card = "A webcam", .bus = "usb-2", .formats = {V4L2_PIX_FMT_YUYV}};
    nodes[3] = (struct node){
        .card = "Depth camera", .bus = "usb-1", .formats = {V4L2_PIX_FMT_UYVY, V4L2_PIX_FMT_YUYV}, .late_ns = 4000000};
    now_ns = 5000000000;
    snprintf(class_folder, sizeof class_folder, "%s", scratch_file(&scratch, "class"));
    system_of_test.class_folder = class_folder;
    v4l2_use_system(&system_of_test);
}

// The lens, under the serial number that the kernel states.
static void write_lens(void)
{
    scratch_text(&scratch, "class/video0/serial", "00 7\n");
    scratch_text(&scratch, "class/video0/device/name", ""); // device/.. is video0 here
    scratch_text(&scratch, "config/reenact/cameras/v4l2-00_7.json",
                 "{\"depth\": {\"width\": 32, \"height\": 24, \"fx\": 38, \"fy\": 38, \"cx\": 15.5, \"cy\": 11.5}}");
}

static struct source *open_camera(const char *uri)
{
    struct source *source;
    EXPECT_STATUS(source_open(&source, uri, SOURCE_SENSOR), OK);
    return source;
}

static void close_camera(struct source **source)
{
    source_close(source);
    for (size_t i = 0; i < COUNT_OF(nodes); i++)
        EXPECT_TRUE(nodes[i].open == 0 && !nodes[i].streaming);
}

// ---------------------------------------------------------------- tests

static void expect_image(const struct frame *frame, uint32_t image)
{
    EXPECT_INT(frame->time_ns, time_of(&nodes[0], image));
    for (int i = 0; i < W * H; i++)
        EXPECT_INT(frame->depth[i], depth_of(image, i % W, i / W));
}

static void test_depth_with_the_colour_beside_it(void **state)
{
    (void)state;
    struct source *source;
    plug();
    EXPECT_STATUS(source_open(&source, "v4l2:0", SOURCE_SENSOR), ERR_INPUT);
    EXPECT_SAYS("the kernel states no lens");
    EXPECT_SAYS("config/reenact/cameras/v4l2-Depth_camera.json");
    write_lens();
    source = open_camera("v4l2"); // the first that has depth
    const struct calibration *c = source_calibration(source);
    EXPECT_NEAR(c->depth.fx, 19, 1e-9); // of half as many pixels
    EXPECT_TRUE(source_is_live(source) && !c->registered && c->depth.width == W && c->color.height == H);
    EXPECT_INT(nodes[2].streaming, 0); // another device's
    for (uint32_t i = 0; i < 20; i++) {
        struct frame frame;
        EXPECT_STATUS(source_next(source, &frame), OK);
        expect_image(&frame, i);
        EXPECT_TRUE(frame.color != NULL); // 4 ms late
        const int grey = (int)((2 * i * 255 + 109) / 219);
        EXPECT_NEAR(frame.color[0], grey, 1);
    }
    EXPECT_INT(source_dropped(source), 0);
    close_camera(&source);
}

static void test_what_is_lost_and_late(void **state)
{
    (void)state;
    plug();
    nodes[0].lost = 3;
    nodes[0].torn = 6;
    nodes[3].late_ns = 5000000000; // its first image comes after all of these
    struct source *source = open_camera("v4l2:0");
    for (uint32_t i = 0; i < 10; i++) {
        struct frame frame;
        if (i == 3 || i == 6)
            continue;
        EXPECT_STATUS(source_next(source, &frame), OK);
        expect_image(&frame, i);
        EXPECT_TRUE(!frame.color);
    }
    EXPECT_INT(source_dropped(source), 2);
    // A program that was busy gets what waits for it, and no later image is mixed with an earlier one.
    struct frame frame;
    now_ns += 20 * STEP_NS;
    EXPECT_STATUS(source_next(source, &frame), OK);
    expect_image(&frame, 10);
    close_camera(&source);
}

static void test_unplugged_and_silent(void **state)
{
    (void)state;
    struct frame frame;
    plug();
    nodes[0].ends = 2;
    struct source *source = open_camera("v4l2:0");
    EXPECT_STATUS(source_next(source, &frame), OK);
    EXPECT_STATUS(source_next(source, &frame), OK);
    EXPECT_STATUS(source_next(source, &frame), ERR_DEVICE);
    EXPECT_SAYS("Depth camera gives no more images");
    close_camera(&source);
    plug();
    nodes[0].late_ns = 60000000000;
    source = open_camera("v4l2:0");
    EXPECT_STATUS(source_next(source, &frame), ERR_DEVICE);
    EXPECT_SAYS("gives no depth images");
    close_camera(&source);
    plug();
    nodes[0].cut = STRIDE;
    source = open_camera("v4l2:0");
    EXPECT_STATUS(source_next(source, &frame), ERR_INPUT);
    EXPECT_SAYS("depth image 0 is cut short");
    close_camera(&source);
}

static void expect_refused(const char *uri, enum status status, const char *says)
{
    struct source *source;
    EXPECT_STATUS(source_open(&source, uri, SOURCE_SENSOR), status);
    EXPECT_SAYS(says);
}

static void test_what_is_no_depth_camera(void **state)
{
    (void)state;
    plug();
    expect_refused("v4l2:2", ERR_INPUT, "/dev/video2 is no depth camera");
    expect_refused("v4l2:1", ERR_INPUT, "/dev/video1 is no depth camera");
    expect_refused("v4l2:7", ERR_MISSING, "/dev/video7");
    expect_refused("v4l2:x", ERR_INPUT, "does not say which camera");
    expect_refused("v4l2:64", ERR_INPUT, "does not say which camera");
    nodes[0].card = NULL;
    expect_refused("v4l2", ERR_MISSING, "gives depth");
}

static void test_the_list_of_devices(void **state)
{
    (void)state;
    struct source_device list[16];
    int count, found = -1;
    plug();
    scratch_text(&scratch, "class/video0/idVendor", "8086\n");
    scratch_text(&scratch, "class/video0/idProduct", "0b07\n");
    EXPECT_STATUS(v4l2_devices(list, COUNT_OF(list), &count), OK);
    for (int i = 0; i < count; i++)
        if (!strcmp(list[i].uri, "v4l2:0"))
            found = i;
        else
            EXPECT_TRUE(strncmp(list[i].uri, "v4l2", 4));
    EXPECT_TRUE(found >= 0 && !strcmp(list[found].name, "Depth camera"));
    EXPECT_INT(list[found].usb_vendor, 0x8086);
    EXPECT_INT(list[found].usb_product, 0x0b07);
}

static int set_up(void **state)
{
    (void)state;
    scratch = scratch_make();
    setenv("XDG_CONFIG_HOME", scratch_file(&scratch, "config"), 1);
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    v4l2_use_system(NULL);
    scratch_remove(&scratch);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_depth_with_the_colour_beside_it),
        cmocka_unit_test(test_what_is_lost_and_late),
        cmocka_unit_test(test_unplugged_and_silent),
        cmocka_unit_test(test_what_is_no_depth_camera),
        cmocka_unit_test(test_the_list_of_devices),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
