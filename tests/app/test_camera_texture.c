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

static void shake(struct rng *rng, uint8_t *bytes, size_t count)
{
    for (size_t i = 0; i < count; i++)
        bytes[i] = (uint8_t)(rng_uniform(rng) * 256);
}

// stride: of every plane; the second follows behind the first's rows.
static void by_processor(const uint8_t *in, size_t stride, const struct dmabuf_image *l, uint8_t *rgb)
{
    const struct yuv_layout layout = {l->encoding, W, H};
    switch (l->layout) {
    case DMABUF_NV12: pixels_from_nv12(in, stride, in + stride * H, stride, &layout, rgb); break;
    case DMABUF_RGBX: pixels_from_packed(in, stride, PACKED_RGBX, W, H, rgb); break;
    case DMABUF_BGRX: pixels_from_packed(in, stride, PACKED_BGRX, W, H, rgb); break;
    default: pixels_from_yuv422(in, stride, l->layout == DMABUF_YUYV, &layout, rgb); break;
    }
}

static int others(const uint8_t *rgba, const uint8_t *rgb)
{
    int count = 0;
    for (int i = 0; i < W * H; i++)
        count += memcmp(rgba + 4 * i, rgb + 3 * i, 3) != 0;
    return count;
}

static void test_gpu_conversion_matches_cpu(void **state)
{
    (void)state;
    static uint8_t bytes[BYTES], rgb[3 * W * H], rgba[4 * W * H];
    struct rng rng = {31};
    struct gpu *gpu;
    struct yuv_to_rgb *raw;
    EXPECT_STATUS(gpu_open(&gpu), OK);
    EXPECT_STATUS(yuv_to_rgb_open(&raw, gpu), OK);
    for (int round = 0; round < 4 * DMABUF_LAYOUTS; round++) {
        struct dmabuf_image what = {.layout = (enum dmabuf_layout)(round / 4),
                                    .width = W,
                                    .height = H,
                                    .encoding = {round & 1 ? YUV_BT709 : YUV_BT601, round & 2}};
        struct yuv_plane planes[2];
        struct gpu_texture *textures[2] = {NULL, NULL};
        int count = yuv_planes(what.layout, W, H, planes);
        size_t stride = (size_t)planes[0].format * (size_t)planes[0].width;
        shake(&rng, bytes, sizeof bytes);
        for (int i = 0; i < count; i++)
            EXPECT_STATUS(gpu_texture_open(&textures[i], gpu,
                                           &(struct gpu_texture_layout){planes[i].format, planes[i].width,
                                                                        planes[i].height, GPU_NEAREST},
                                           bytes + (i ? stride * H : 0)),
                          OK);
        const struct gpu_texture *const read[2] = {textures[0], textures[1]};
        EXPECT_STATUS(yuv_to_rgb_draw(raw, &what, read), OK);
        EXPECT_STATUS(yuv_to_rgb_read(raw, rgba), OK);
        by_processor(bytes, stride, &what, rgb);
        EXPECT_INT(others(rgba, rgb), 0);
        gpu_texture_close(&textures[0]);
        gpu_texture_close(&textures[1]);
    }
    yuv_to_rgb_close(&raw);
    gpu_close(&gpu);
}

// ---------------------------------------------------------------- lending

static int returned;

static void on_release(struct dmabuf_image *l)
{
    returned++;
    free(l);
}

static struct dmabuf_image *lend_image(enum dmabuf_layout layout, int file, unsigned stride)
{
    struct dmabuf_image *l = malloc(sizeof *l);
    assert_non_null(l);
    *l = (struct dmabuf_image){.layout = layout,
                               .width = W,
                               .height = H,
                               .encoding = {YUV_BT709, false},
                               .planes = {{file, 0, stride}, {file, stride * H, stride}},
                               .release = on_release};
    return l;
}

// What the viewfinder shows, read back.
static void read_shown(struct camera_texture *v, struct gpu *gpu, uint8_t *rgba)
{
    const struct dmabuf_image as_it_is = {.layout = DMABUF_RGBX, .width = W, .height = H};
    const struct gpu_texture *const shown[2] = {camera_texture_current(v), NULL};
    struct yuv_to_rgb *raw;
    EXPECT_STATUS(yuv_to_rgb_open(&raw, gpu), OK);
    EXPECT_STATUS(yuv_to_rgb_draw(raw, &as_it_is, shown), OK);
    EXPECT_STATUS(yuv_to_rgb_read(raw, rgba), OK);
    yuv_to_rgb_close(&raw);
}

static void test_unimportable_memory_is_uploaded(void **state)
{
    (void)state;
    static uint8_t rgb[3 * W * H], rgba[4 * W * H];
    struct rng rng = {32};
    struct gpu *gpu;
    struct camera_texture *v;
    int file = memfd_create("no graphics memory", MFD_CLOEXEC);
    assert_int_equal(ftruncate(file, BYTES), 0);
    EXPECT_STATUS(gpu_open(&gpu), OK);
    EXPECT_STATUS(camera_texture_open(&v, gpu), OK);
    returned = 0;
    for (int i = 0; i < 3; i++) {
        struct camera_frame camera_image = {.rgb = rgb, .lens = {.width = W, .height = H}, .number = i + 1};
        struct dmabuf_image *image =
            i < 2 ? lend_image(DMABUF_YUYV, file, 2 * W) : NULL; // and a camera that lends nothing
        shake(&rng, rgb, sizeof rgb);
        EXPECT_STATUS(camera_texture_update(v, &camera_image, &image), OK);
        EXPECT_TRUE(!image);
        read_shown(v, gpu, rgba);
        EXPECT_INT(others(rgba, rgb), 0);
    }
    EXPECT_INT(returned, 2);
    EXPECT_INT(camera_texture_count(v).uploaded, 3);
    EXPECT_INT(camera_texture_count(v).imported, 0);
    camera_texture_close(&v);
    EXPECT_STATUS(gpu_check(gpu), OK);
    gpu_close(&gpu);
    close(file);
}

// ---------------------------------------------------------------- memory of a graphics device

struct device_memory {
    int device, file;
    uint32_t handle, stride;
    uint64_t size;
    uint8_t *bytes;
};

// Rows of a multiple of four bytes, and half as many again for a second plane. False: the device has none.
static bool memory_open(struct device_memory *m, const char *path)
{
    *m = (struct device_memory){.device = open(path, O_RDWR | O_CLOEXEC), .file = -1};
    uint64_t offset;
    if (m->device < 0 || drmModeCreateDumbBuffer(m->device, W, H * 2, 32, 0, &m->handle, &m->stride, &m->size) ||
        drmModeMapDumbBuffer(m->device, m->handle, &offset) ||
        drmPrimeHandleToFD(m->device, m->handle, DRM_CLOEXEC | DRM_RDWR, &m->file))
        return false;
    m->bytes = mmap(NULL, m->size, PROT_READ | PROT_WRITE, MAP_SHARED, m->device, (off_t)offset);
    return m->bytes != MAP_FAILED;
}

static void memory_close(struct device_memory *m)
{
    munmap(m->bytes, m->size);
    close(m->file);
    drmModeDestroyDumbBuffer(m->device, m->handle);
    close(m->device);
}

static void expect_borrowed(struct camera_texture *v, struct gpu *gpu, const struct device_memory *m,
                            enum dmabuf_layout layout)
{
    static uint8_t rgb[3 * W * H], rgba[4 * W * H];
    struct rng rng = {33 + (uint64_t)layout};
    struct camera_frame camera_image = {.rgb = rgb, .lens = {.width = W, .height = H}};
    for (int i = 0; i < 3; i++) { // what is there changes; the picture has to follow
        struct dmabuf_image *image = lend_image(layout, m->file, m->stride);
        int64_t before = camera_texture_count(v).imported;
        shake(&rng, m->bytes, m->size);
        by_processor(m->bytes, m->stride, image, rgb);
        EXPECT_STATUS(camera_texture_update(v, &camera_image, &image), OK);
        read_shown(v, gpu, rgba);
        print_message("layout %d, picture %d: %d of %d pixels differ %s\n", (int)layout, i, others(rgba, rgb), W * H,
                      camera_texture_count(v).why);
        EXPECT_INT(others(rgba, rgb), 0);
        EXPECT_INT(camera_texture_count(v).imported, before + 1);
    }
}

static void test_device_memory_is_imported(void **state)
{
    (void)state;
    static uint8_t rgb[3 * W * H], rgba[4 * W * H];
    struct device_memory memory;
    struct gpu *gpu;
    struct camera_texture *v;
    EXPECT_STATUS(gpu_open(&gpu), OK);
    EXPECT_STATUS(camera_texture_open(&v, gpu), OK);
    bool there = memory_open(&memory, device ? device : "/dev/dri/card0") && camera_texture_can_import(v);
    print_message("%s, memory to be read where it lies: %s\n", gpu_renderer(gpu), there ? "yes" : "none here");
    EXPECT_TRUE(there || !device);
    returned = 0;
    for (int layout = 0; layout < DMABUF_LAYOUTS && there; layout++)
        expect_borrowed(v, gpu, &memory, (enum dmabuf_layout)layout);
    if (there) {
        // All but the last came back, for the GPU was waited for since.
        EXPECT_INT(returned, 3 * DMABUF_LAYOUTS - 1);
        // A driver that shows other pixels than the processor reads is not believed. This is a new kind of picture.
        struct camera_frame camera_image = {.rgb = rgb, .lens = {.width = W, .height = H}};
        struct dmabuf_image *image = lend_image(DMABUF_YUYV, memory.file, memory.stride);
        EXPECT_STATUS(camera_texture_update(v, &camera_image, &image), OK);
        read_shown(v, gpu, rgba);
        EXPECT_INT(others(rgba, rgb), 0);
        EXPECT_TRUE(strstr(camera_texture_count(v).why, "wrongly"));
        EXPECT_INT(camera_texture_count(v).uploaded, 1);
    }
    camera_texture_close(&v);
    EXPECT_INT(returned, there ? 3 * DMABUF_LAYOUTS + 1 : 0);
    gpu_close(&gpu);
    if (there)
        memory_close(&memory);
}

int main(int argc, char **argv)
{
    device = argc > 1 ? argv[1] : NULL;
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_gpu_conversion_matches_cpu),
        cmocka_unit_test(test_unimportable_memory_is_uploaded),
        cmocka_unit_test(test_device_memory_is_imported),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
