// The camera's image as a texture: the GPU converts a camera's bytes to exactly the CPU's pixels, whether they were
// uploaded or imported.
//
//     test_camera_texture          imports memory if this machine has a graphics device
//     test_camera_texture DEVICE   must import memory of that device (/dev/dri/card0)
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

static const char *device; // NULL: no device is required

static void fill_random(struct rng *rng, uint8_t *bytes, size_t count)
{
    for (size_t i = 0; i < count; i++)
        bytes[i] = (uint8_t)(rng_uniform(rng) * 256);
}

// stride: of every plane; the second plane follows the first's rows.
static void convert_on_cpu(const uint8_t *in, size_t stride, const struct dmabuf_image *l, uint8_t *rgb)
{
    const struct yuv_layout layout = {l->encoding, W, H};
    switch (l->layout) {
    case DMABUF_NV12: pixels_from_nv12(in, stride, in + stride * H, stride, &layout, rgb); break;
    case DMABUF_RGBX: pixels_from_packed(in, stride, PACKED_RGBX, W, H, rgb); break;
    case DMABUF_BGRX: pixels_from_packed(in, stride, PACKED_BGRX, W, H, rgb); break;
    default: pixels_from_yuv422(in, stride, l->layout == DMABUF_YUYV, &layout, rgb); break;
    }
}

static int count_different(const uint8_t *rgba, const uint8_t *rgb)
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
    struct yuv_to_rgb *converter;
    EXPECT_STATUS(gpu_open(&gpu), OK);
    EXPECT_STATUS(yuv_to_rgb_open(&converter, gpu), OK);
    for (int round = 0; round < 4 * DMABUF_LAYOUTS; round++) {
        struct dmabuf_image what = {.layout = (enum dmabuf_layout)(round / 4),
                                    .width = W,
                                    .height = H,
                                    .encoding = {round & 1 ? YUV_BT709 : YUV_BT601, round & 2}};
        struct yuv_plane planes[2];
        struct gpu_texture *textures[2] = {NULL, NULL};
        int count = yuv_planes(what.layout, W, H, planes);
        size_t stride = (size_t)planes[0].format * (size_t)planes[0].width;
        fill_random(&rng, bytes, sizeof bytes);
        for (int i = 0; i < count; i++)
            EXPECT_STATUS(gpu_texture_open(&textures[i], gpu,
                                           &(struct gpu_texture_layout){planes[i].format, planes[i].width,
                                                                        planes[i].height, GPU_NEAREST},
                                           bytes + (i ? stride * H : 0)),
                          OK);
        const struct gpu_texture *const read[2] = {textures[0], textures[1]};
        EXPECT_STATUS(yuv_to_rgb_draw(converter, &what, read), OK);
        EXPECT_STATUS(yuv_to_rgb_read(converter, rgba), OK);
        convert_on_cpu(bytes, stride, &what, rgb);
        EXPECT_INT(count_different(rgba, rgb), 0);
        gpu_texture_close(&textures[0]);
        gpu_texture_close(&textures[1]);
    }
    yuv_to_rgb_close(&converter);
    gpu_close(&gpu);
}

// ---------------------------------------------------------------- lending

static int released;

static void on_release(struct dmabuf_image *l)
{
    released++;
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

// The pixels of the current texture.
static void read_shown(struct camera_texture *t, struct gpu *gpu, uint8_t *rgba)
{
    const struct dmabuf_image as_it_is = {.layout = DMABUF_RGBX, .width = W, .height = H};
    const struct gpu_texture *const shown[2] = {camera_texture_current(t), NULL};
    struct yuv_to_rgb *converter;
    EXPECT_STATUS(yuv_to_rgb_open(&converter, gpu), OK);
    EXPECT_STATUS(yuv_to_rgb_draw(converter, &as_it_is, shown), OK);
    EXPECT_STATUS(yuv_to_rgb_read(converter, rgba), OK);
    yuv_to_rgb_close(&converter);
}

static void test_unimportable_memory_is_uploaded(void **state)
{
    (void)state;
    static uint8_t rgb[3 * W * H], rgba[4 * W * H];
    struct rng rng = {32};
    struct gpu *gpu;
    struct camera_texture *t;
    int file = memfd_create("no graphics memory", MFD_CLOEXEC);
    assert_int_equal(ftruncate(file, BYTES), 0);
    EXPECT_STATUS(gpu_open(&gpu), OK);
    EXPECT_STATUS(camera_texture_open(&t, gpu), OK);
    released = 0;
    for (int i = 0; i < 3; i++) {
        struct camera_frame camera_image = {.rgb = rgb, .lens = {.width = W, .height = H}, .number = i + 1};
        struct dmabuf_image *image =
            i < 2 ? lend_image(DMABUF_YUYV, file, 2 * W) : NULL; // and a camera without DMA buffers
        fill_random(&rng, rgb, sizeof rgb);
        EXPECT_STATUS(camera_texture_update(t, &camera_image, &image), OK);
        EXPECT_TRUE(!image);
        read_shown(t, gpu, rgba);
        EXPECT_INT(count_different(rgba, rgb), 0);
    }
    EXPECT_INT(released, 2);
    EXPECT_INT(camera_texture_count(t).uploaded, 3);
    EXPECT_INT(camera_texture_count(t).imported, 0);
    camera_texture_close(&t);
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

static void expect_imported(struct camera_texture *t, struct gpu *gpu, const struct device_memory *m,
                            enum dmabuf_layout layout)
{
    static uint8_t rgb[3 * W * H], rgba[4 * W * H];
    struct rng rng = {33 + (uint64_t)layout};
    struct camera_frame camera_image = {.rgb = rgb, .lens = {.width = W, .height = H}};
    for (int i = 0; i < 3; i++) { // the memory changes; the texture must follow
        struct dmabuf_image *image = lend_image(layout, m->file, m->stride);
        int64_t before = camera_texture_count(t).imported;
        fill_random(&rng, m->bytes, m->size);
        convert_on_cpu(m->bytes, m->stride, image, rgb);
        EXPECT_STATUS(camera_texture_update(t, &camera_image, &image), OK);
        read_shown(t, gpu, rgba);
        print_message("layout %d, image %d: %d of %d pixels differ %s\n", (int)layout, i, count_different(rgba, rgb),
                      W * H, camera_texture_count(t).why);
        EXPECT_INT(count_different(rgba, rgb), 0);
        EXPECT_INT(camera_texture_count(t).imported, before + 1);
    }
}

static void test_device_memory_is_imported(void **state)
{
    (void)state;
    static uint8_t rgb[3 * W * H], rgba[4 * W * H];
    struct device_memory memory;
    struct gpu *gpu;
    struct camera_texture *t;
    EXPECT_STATUS(gpu_open(&gpu), OK);
    EXPECT_STATUS(camera_texture_open(&t, gpu), OK);
    bool importable = memory_open(&memory, device ? device : "/dev/dri/card0") && camera_texture_can_import(t);
    print_message("%s, memory to import: %s\n", gpu_renderer(gpu), importable ? "yes" : "none here");
    EXPECT_TRUE(importable || !device);
    released = 0;
    for (int layout = 0; layout < DMABUF_LAYOUTS && importable; layout++)
        expect_imported(t, gpu, &memory, (enum dmabuf_layout)layout);
    if (importable) {
        // All but the last have been released, for reading back waited for the GPU.
        EXPECT_INT(released, 3 * DMABUF_LAYOUTS - 1);
        // A driver whose pixels differ from the CPU's is not trusted. This is a new kind of image.
        struct camera_frame camera_image = {.rgb = rgb, .lens = {.width = W, .height = H}};
        struct dmabuf_image *image = lend_image(DMABUF_YUYV, memory.file, memory.stride);
        EXPECT_STATUS(camera_texture_update(t, &camera_image, &image), OK);
        read_shown(t, gpu, rgba);
        EXPECT_INT(count_different(rgba, rgb), 0);
        EXPECT_TRUE(strstr(camera_texture_count(t).why, "wrongly"));
        EXPECT_INT(camera_texture_count(t).uploaded, 1);
    }
    camera_texture_close(&t);
    EXPECT_INT(released, importable ? 3 * DMABUF_LAYOUTS + 1 : 0);
    gpu_close(&gpu);
    if (importable)
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
