// YUV to RGB conversion on the GPU (camera.frag).
#include "reenact/render/yuv_to_rgb.h"

#include "reenact/render/shaders.h"

#include <stdlib.h>

// camera.frag has these numbers.
static_assert(DMABUF_YUYV == 0 && DMABUF_UYVY == 1 && DMABUF_NV12 == 2 && DMABUF_RGBX == 3 && DMABUF_BGRX == 4,
              "camera.frag");

enum { ARRANGEMENT, COEFFICIENTS, UNIFORMS };

struct yuv_to_rgb {
    struct gpu *gpu;
    struct gpu_program *program;
    struct gpu_mesh *fullscreen; // one triangle over the whole target
    struct gpu_target *target;
    int width, height;
};

int yuv_planes(enum dmabuf_layout layout, int width, int height, struct yuv_plane planes[2])
{
    planes[0] = (struct yuv_plane){GPU_RGBA8, width, height};
    if (layout == DMABUF_YUYV || layout == DMABUF_UYVY)
        planes[0].width = width / 2;
    if (layout != DMABUF_NV12)
        return 1;
    planes[0].format = GPU_R8;
    planes[1] = (struct yuv_plane){GPU_RG8, width / 2, height / 2};
    return 2;
}

enum status yuv_to_rgb_open(struct yuv_to_rgb **out, struct gpu *gpu)
{
    static const char *const uniforms[] = {[ARRANGEMENT] = "arrangement", [COEFFICIENTS] = "coefficients"};
    static const char *const samplers[] = {"first_plane", "chroma_plane"};
    const struct gpu_program_source text = {.name = "camera",
                                            .vertex = shader_find("fullscreen.vert"),
                                            .fragment = shader_find("camera.frag"),
                                            .uniforms = uniforms,
                                            .uniform_count = UNIFORMS,
                                            .samplers = samplers,
                                            .sampler_count = 2};
    *out = NULL;
    struct yuv_to_rgb *r = calloc(1, sizeof *r);
    if (!r)
        return fail(ERR_MEMORY, "no memory for converting an image");
    r->gpu = gpu;
    enum status status = fullscreen_mesh_open(&r->fullscreen, gpu);
    if (status == OK)
        status = gpu_program_open(&r->program, gpu, &text);
    if (status != OK) {
        yuv_to_rgb_close(&r);
        return status;
    }
    *out = r;
    return OK;
}

void yuv_to_rgb_close(struct yuv_to_rgb **rgb)
{
    if (!*rgb)
        return;
    gpu_target_close(&(*rgb)->target);
    gpu_mesh_close(&(*rgb)->fullscreen);
    gpu_program_close(&(*rgb)->program);
    free(*rgb);
    *rgb = NULL;
}

enum status yuv_to_rgb_draw(struct yuv_to_rgb *converter, const struct dmabuf_image *image,
                            const struct gpu_texture *const planes[2])
{
    if (!converter->target || converter->width != image->width || converter->height != image->height) {
        gpu_target_close(&converter->target);
        converter->width = image->width;
        converter->height = image->height;
        enum status status = gpu_target_open(&converter->target, converter->gpu, image->width, image->height);
        if (status != OK)
            return status;
    }
    const struct yuv_coefficients k = yuv_coefficients_of(image->encoding);
    const float arrangement[4] = {(float)image->layout, 0, 0, 0};
    const float coefficients[8] = {
        (float)k.y, (float)k.r_cr, (float)k.g_cb, (float)k.g_cr, (float)k.b_cb, (float)k.y_zero, 0, 0};
    gpu_program_set(converter->program, ARRANGEMENT, arrangement, 1);
    gpu_program_set(converter->program, COEFFICIENTS, coefficients, 2);
    gpu_draw(&(struct gpu_job){.target = converter->target,
                               .program = converter->program,
                               .mesh = converter->fullscreen,
                               .textures = {planes[0], planes[1] ? planes[1] : planes[0]}});
    return gpu_check(converter->gpu);
}

const struct gpu_texture *yuv_to_rgb_texture(struct yuv_to_rgb *rgb) { return gpu_target_texture(rgb->target); }

enum status yuv_to_rgb_read(struct yuv_to_rgb *converter, uint8_t *rgba)
{
    return gpu_target_read(converter->target, rgba);
}
