// The camera's picture on the graphics chip: what the GPU makes of a camera's bytes is
// to the bit what the processor makes of them, whether they were uploaded or are read
// where they lie.
//
//     test_viewfinder          reads foreign memory where this machine has a graphics device
//     test_viewfinder DEVICE   has to: in memory of that one (/dev/dri/card0)
#include "tests/support/test.h"

#include "app/camera/camera_texture.h"
#include "reenact/render/yuv_to_rgb.h"

#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>
#include <xf86drm.h>
#include <xf86drmMode.h>

enum { W = 64, H = 48, BYTES = 4 * W * H };

static const char *device; // NULL: none has to be there

static void shake(struct dice *dice, uint8_t *bytes, size_t count)
{
    for (size_t i = 0; i < count; i++)
        bytes[i] = (uint8_t)(dice_uniform(dice) * 256);
}

// stride: of every plane; the second follows behind the first's rows.
static void by_processor(const uint8_t *in, size_t stride, const struct loan *l, uint8_t *rgb)
{
    switch (l->layout) {
    case LOAN_NV12: pixels_from_nv12(in, stride, in + stride * H, stride, l->meaning, W, H, rgb); break;
    case LOAN_RGBX: pixels_from_packed(in, stride, PACKED_RGBX, W, H, rgb); break;
    case LOAN_BGRX: pixels_from_packed(in, stride, PACKED_BGRX, W, H, rgb); break;
    default: pixels_from_yuv422(in, stride, l->layout == LOAN_YUYV, l->meaning, W, H, rgb); break;
    }
}

static int others(const uint8_t *rgba, const uint8_t *rgb)
{
    int count = 0;
    for (int i = 0; i < W * H; i++)
        count += memcmp(rgba + 4 * i, rgb + 3 * i, 3) != 0;
    return count;
}

static void test_the_gpu_turns_bytes_into_the_same_pixels(void **state)
{
    (void)state;
    static uint8_t bytes[BYTES], rgb[3 * W * H], rgba[4 * W * H];
    struct dice dice = {31};
    struct gpu *gpu;
    struct raw_picture *raw;
    EXPECT_STATUS(gpu_open(&gpu), OK);
    EXPECT_STATUS(raw_picture_open(&raw, gpu), OK);
    for (int round = 0; round < 4 * LOAN_LAYOUTS; round++) {
        struct loan what = {.layout = (enum loan_layout)(round / 4),
                            .width = W,
                            .height = H,
                            .meaning = {round & 1 ? YUV_BT709 : YUV_BT601, round & 2}};
        struct raw_plane planes[2];
        struct gpu_texture *textures[2] = {NULL, NULL};
        int count = raw_planes(what.layout, W, H, planes);
        size_t stride = (size_t)planes[0].format * (size_t)planes[0].width;
        shake(&dice, bytes, sizeof bytes);
        for (int i = 0; i < count; i++)
            EXPECT_STATUS(gpu_texture_open(&textures[i], gpu, planes[i].format, planes[i].width, planes[i].height,
                                           GPU_NEAREST, bytes + (i ? stride * H : 0)),
                          OK);
        const struct gpu_texture *const read[2] = {textures[0], textures[1]};
        EXPECT_STATUS(raw_picture_draw(raw, &what, read), OK);
        EXPECT_STATUS(raw_picture_read(raw, rgba), OK);
        by_processor(bytes, stride, &what, rgb);
        EXPECT_INT(others(rgba, rgb), 0);
        gpu_texture_close(&textures[0]);
        gpu_texture_close(&textures[1]);
    }
    raw_picture_close(&raw);
    gpu_close(&gpu);
}

// ---------------------------------------------------------------- lending

static int returned;

static void come_back(struct loan *l)
{
    returned++;
    free(l);
}

static struct loan *lend(enum loan_layout layout, int file, unsigned stride)
{
    struct loan *l = malloc(sizeof *l);
    assert_non_null(l);
    *l = (struct loan){.layout = layout,
                       .width = W,
                       .height = H,
                       .meaning = {YUV_BT709, false},
                       .planes = {{file, 0, stride}, {file, stride * H, stride}},
                       .give_back = come_back};
    return l;
}

// What the viewfinder shows, read back.
static void read_shown(struct viewfinder *v, struct gpu *gpu, uint8_t *rgba)
{
    const struct loan as_it_is = {.layout = LOAN_RGBX, .width = W, .height = H};
    const struct gpu_texture *const shown[2] = {viewfinder_texture(v), NULL};
    struct raw_picture *raw;
    EXPECT_STATUS(raw_picture_open(&raw, gpu), OK);
    EXPECT_STATUS(raw_picture_draw(raw, &as_it_is, shown), OK);
    EXPECT_STATUS(raw_picture_read(raw, rgba), OK);
    raw_picture_close(&raw);
}

static void test_what_cannot_be_read_there_is_uploaded(void **state)
{
    (void)state;
    static uint8_t rgb[3 * W * H], rgba[4 * W * H];
    struct dice dice = {32};
    struct gpu *gpu;
    struct viewfinder *v;
    int file = memfd_create("no graphics memory", MFD_CLOEXEC);
    assert_int_equal(ftruncate(file, BYTES), 0);
    EXPECT_STATUS(gpu_open(&gpu), OK);
    EXPECT_STATUS(viewfinder_open(&v, gpu), OK);
    returned = 0;
    for (int i = 0; i < 3; i++) {
        struct sight sight = {.rgb = rgb, .lens = {.width = W, .height = H}, .number = i + 1};
        struct loan *loan = i < 2 ? lend(LOAN_YUYV, file, 2 * W) : NULL; // and a camera that lends nothing
        shake(&dice, rgb, sizeof rgb);
        EXPECT_STATUS(viewfinder_show(v, &sight, &loan), OK);
        EXPECT_TRUE(!loan);
        read_shown(v, gpu, rgba);
        EXPECT_INT(others(rgba, rgb), 0);
    }
    EXPECT_INT(returned, 2);
    EXPECT_INT(viewfinder_counts(v).uploaded, 3);
    EXPECT_INT(viewfinder_counts(v).borrowed, 0);
    viewfinder_close(&v);
    EXPECT_STATUS(gpu_check(gpu), OK);
    gpu_close(&gpu);
    close(file);
}

// ---------------------------------------------------------------- memory of a graphics device

struct memory {
    int device, file;
    uint32_t handle, stride;
    uint64_t size;
    uint8_t *bytes;
};

// Rows of a multiple of four bytes, and half as many again for a second plane. False: the device has none.
static bool memory_open(struct memory *m, const char *path)
{
    *m = (struct memory){.device = open(path, O_RDWR | O_CLOEXEC), .file = -1};
    uint64_t offset;
    if (m->device < 0 || drmModeCreateDumbBuffer(m->device, W, H * 2, 32, 0, &m->handle, &m->stride, &m->size) ||
        drmModeMapDumbBuffer(m->device, m->handle, &offset) ||
        drmPrimeHandleToFD(m->device, m->handle, DRM_CLOEXEC | DRM_RDWR, &m->file))
        return false;
    m->bytes = mmap(NULL, m->size, PROT_READ | PROT_WRITE, MAP_SHARED, m->device, (off_t)offset);
    return m->bytes != MAP_FAILED;
}

static void memory_close(struct memory *m)
{
    munmap(m->bytes, m->size);
    close(m->file);
    drmModeDestroyDumbBuffer(m->device, m->handle);
    close(m->device);
}

static void expect_borrowed(struct viewfinder *v, struct gpu *gpu, const struct memory *m, enum loan_layout layout)
{
    static uint8_t rgb[3 * W * H], rgba[4 * W * H];
    struct dice dice = {33 + (uint64_t)layout};
    struct sight sight = {.rgb = rgb, .lens = {.width = W, .height = H}};
    for (int i = 0; i < 3; i++) { // what is there changes; the picture has to follow
        struct loan *loan = lend(layout, m->file, m->stride);
        int64_t before = viewfinder_counts(v).borrowed;
        shake(&dice, m->bytes, m->size);
        by_processor(m->bytes, m->stride, loan, rgb);
        EXPECT_STATUS(viewfinder_show(v, &sight, &loan), OK);
        read_shown(v, gpu, rgba);
        print_message("layout %d, picture %d: %d of %d pixels differ %s\n", (int)layout, i, others(rgba, rgb), W * H,
                      viewfinder_counts(v).why);
        EXPECT_INT(others(rgba, rgb), 0);
        EXPECT_INT(viewfinder_counts(v).borrowed, before + 1);
    }
}

static void test_a_device_s_memory_is_read_where_it_lies(void **state)
{
    (void)state;
    static uint8_t rgb[3 * W * H], rgba[4 * W * H];
    struct memory memory;
    struct gpu *gpu;
    struct viewfinder *v;
    EXPECT_STATUS(gpu_open(&gpu), OK);
    EXPECT_STATUS(viewfinder_open(&v, gpu), OK);
    bool there = memory_open(&memory, device ? device : "/dev/dri/card0") && viewfinder_can_borrow(v);
    print_message("%s, memory to be read where it lies: %s\n", gpu_renderer(gpu), there ? "yes" : "none here");
    EXPECT_TRUE(there || !device);
    returned = 0;
    for (int layout = 0; layout < LOAN_LAYOUTS && there; layout++)
        expect_borrowed(v, gpu, &memory, (enum loan_layout)layout);
    if (there) {
        // All but the last came back, for the GPU was waited for since.
        EXPECT_INT(returned, 3 * LOAN_LAYOUTS - 1);
        // A driver that shows other pixels than the processor reads is not believed. This is a new kind of picture.
        struct sight sight = {.rgb = rgb, .lens = {.width = W, .height = H}};
        struct loan *loan = lend(LOAN_YUYV, memory.file, memory.stride);
        EXPECT_STATUS(viewfinder_show(v, &sight, &loan), OK);
        read_shown(v, gpu, rgba);
        EXPECT_INT(others(rgba, rgb), 0);
        EXPECT_TRUE(strstr(viewfinder_counts(v).why, "wrongly"));
        EXPECT_INT(viewfinder_counts(v).uploaded, 1);
    }
    viewfinder_close(&v);
    EXPECT_INT(returned, there ? 3 * LOAN_LAYOUTS + 1 : 0);
    gpu_close(&gpu);
    if (there)
        memory_close(&memory);
}

int main(int argc, char **argv)
{
    device = argc > 1 ? argv[1] : NULL;
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_the_gpu_turns_bytes_into_the_same_pixels),
        cmocka_unit_test(test_what_cannot_be_read_there_is_uploaded),
        cmocka_unit_test(test_a_device_s_memory_is_read_where_it_lies),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
