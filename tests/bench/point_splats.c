#include "tests/bench/point_splats.h"

#include <stdlib.h>
#include <string.h>

enum { CHUNK = 65536 };
#define NEAREST_M 0.05f

struct point_splats {
    struct gpu *gpu;
    struct gpu_program *program;
    struct gpu_mesh **chunks;
    int count;
    struct lens lens; // of the image
    struct pose world_from_view;
    struct gpu_target *target;
};

static const char vertex_text[] =
    "#version 300 es\n"
    "precision highp float;\n"
    "layout(location = 0) in vec4 at_color; // world, metres; red, green and blue as one number\n"
    "uniform vec4 view_from_world[3];\n"
    "uniform vec4 view_lens;  // fx, fy, cx, cy\n"
    "uniform vec4 view_range; // width, height, nearest and farthest z drawn\n"
    "uniform vec4 show_depth; // 1: instead of the colour\n"
    "out vec3 shade;\n"
    "void main()\n"
    "{\n"
    "    vec4 h = vec4(at_color.xyz, 1.0);\n"
    "    vec3 p = vec3(dot(view_from_world[0], h), dot(view_from_world[1], h), dot(view_from_world[2], h));\n"
    "    vec2 px = view_lens.xy * p.xy + (view_lens.zw + 0.5) * p.z;\n"
    "    float near = view_range.z, far = view_range.w;\n"
    "    uint n = show_depth.x > 0.5 ? uint(clamp(near / p.z, 0.0, 1.0) * 16777215.0 + 0.5) : uint(at_color.w);\n"
    "    shade = vec3(n >> 16, (n >> 8) & 255u, n & 255u) / 255.0;\n"
    "    gl_PointSize = 2.0;\n"
    "    gl_Position = vec4(2.0 * px / view_range.xy - p.z, ((far + near) * p.z - 2.0 * far * near) / (far - near), "
    "p.z);\n"
    "}\n";
static const char fragment_text[] = "#version 300 es\n"
                                    "precision highp float;\n"
                                    "in vec3 shade;\n"
                                    "out vec4 color;\n"
                                    "void main() { color = vec4(shade, 1.0); }\n";

static enum status add_chunk(struct point_splats *s, const float *vertices, int count)
{
    struct gpu_mesh **chunks = realloc(s->chunks, sizeof *chunks * ((size_t)s->count + 1));
    if (!chunks)
        return fail(ERR_MEMORY, "out of memory");
    s->chunks = chunks;
    const struct gpu_mesh_data data = {vertices, 4, count, NULL, 0};
    const enum status status = gpu_mesh_open(&s->chunks[s->count], s->gpu, &data);
    s->count += status == OK;
    return status;
}

static void point(const struct surround_picture *p, int u, int v, float out[4])
{
    const size_t i = (size_t)v * (size_t)p->width + (size_t)u;
    const double far = 1 / (double)p->inverse[i];
    float ray[3];
    surround_picture_ray(p, u, v, ray);
    const struct vec3 w =
        pose_apply(p->world_from_camera, v3_scale(v3((double)ray[0], (double)ray[1], (double)ray[2]), far));
    out[0] = (float)w.x, out[1] = (float)w.y, out[2] = (float)w.z;
    out[3] = (float)(p->rgb[3 * i] * 65536 + p->rgb[3 * i + 1] * 256 + p->rgb[3 * i + 2]);
}

static enum status add_points(struct point_splats *s, const struct surround_picture *pictures, int count)
{
    float *vertices = malloc(sizeof *vertices * 4 * CHUNK);
    enum status status = vertices ? OK : fail(ERR_MEMORY, "out of memory");
    int n = 0;
    for (int k = 0; k < count; k++)
        for (int i = 0; i < pictures[k].width * pictures[k].height && status == OK; i++) {
            if (!(pictures[k].inverse[i] > 1e-4f))
                continue;
            point(&pictures[k], i % pictures[k].width, i / pictures[k].width, vertices + 4 * n++);
            if (n == CHUNK) {
                status = add_chunk(s, vertices, n);
                n = 0;
            }
        }
    if (status == OK && n)
        status = add_chunk(s, vertices, n);
    free(vertices);
    return status;
}

enum status point_splats_open(struct point_splats **out, struct gpu *gpu, const struct surround_picture *pictures,
                              int count)
{
    static const char *const uniforms[] = {"view_from_world", "view_lens", "view_range", "show_depth"};
    const struct gpu_program_source text = {
        .name = "points", .vertex = vertex_text, .fragment = fragment_text, .uniforms = uniforms, .uniform_count = 4};
    struct point_splats *s = *out = calloc(1, sizeof *s);
    if (!s)
        return fail(ERR_MEMORY, "out of memory");
    s->gpu = gpu;
    enum status status = gpu_program_open(&s->program, gpu, &text);
    if (status == OK)
        status = add_points(s, pictures, count);
    if (status != OK)
        point_splats_close(out);
    return status;
}

void point_splats_close(struct point_splats **out)
{
    struct point_splats *s = *out;
    if (!s)
        return;
    for (int i = 0; i < s->count; i++)
        gpu_mesh_close(&s->chunks[i]);
    free(s->chunks);
    gpu_program_close(&s->program);
    gpu_target_close(&s->target);
    free(s);
    *out = NULL;
}

static enum status fit_target(struct point_splats *s, const struct lens *lens)
{
    const bool fits = s->target && s->lens.width == lens->width && s->lens.height == lens->height;
    s->lens = *lens;
    if (fits)
        return OK;
    gpu_target_close(&s->target);
    return gpu_target_open(&s->target, s->gpu, lens->width, lens->height);
}

static enum status draw(struct point_splats *s, bool depth)
{
    const struct lens *lens = &s->lens;
    const struct pose view_from_world = pose_inverse(s->world_from_view);
    const double shift[3] = {view_from_world.translation.x, view_from_world.translation.y,
                             view_from_world.translation.z};
    const float l[4] = {(float)lens->fx, (float)lens->fy, (float)lens->cx, (float)lens->cy};
    const float range[4] = {(float)lens->width, (float)lens->height, NEAREST_M, 100}, mode[4] = {depth, 0, 0, 0};
    float rows[12];
    double m[3][3];
    quat_to_matrix(view_from_world.rotation, m);
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++)
            rows[4 * i + k] = (float)m[i][k];
        rows[4 * i + 3] = (float)shift[i];
    }
    gpu_program_set(s->program, 0, rows, 3);
    gpu_program_set(s->program, 1, l, 1);
    gpu_program_set(s->program, 2, range, 1);
    gpu_program_set(s->program, 3, mode, 1);
    gpu_target_clear(s->target);
    for (int i = 0; i < s->count; i++)
        gpu_draw(&(struct gpu_job){
            .target = s->target, .program = s->program, .mesh = s->chunks[i], .depth_test = true, .points = true});
    return gpu_check(s->gpu);
}

enum status point_splats_draw(struct point_splats *s, const struct lens *lens, struct pose world_from_view)
{
    const enum status status = fit_target(s, lens);
    s->world_from_view = world_from_view;
    return status == OK ? draw(s, false) : status;
}

enum status point_splats_read(struct point_splats *s, struct surround_view *view)
{
    const size_t pixels = (size_t)s->lens.width * (size_t)s->lens.height;
    uint8_t *rgba = malloc(8 * pixels), *depth = rgba + 4 * pixels;
    enum status status = rgba ? gpu_target_read(s->target, rgba) : fail(ERR_MEMORY, "out of memory");
    if (status == OK)
        status = draw(s, true);
    if (status == OK)
        status = gpu_target_read(s->target, depth);
    for (size_t i = 0; i < pixels && status == OK; i++) {
        const uint8_t *d = depth + 4 * i;
        const bool seen = rgba[4 * i + 3];
        const float inverse_z = (float)(d[0] * 65536 + d[1] * 256 + d[2]) / 16777215 / NEAREST_M;
        view->source[i] = seen ? SOURCE_SEEN : SOURCE_UNSEEN;
        view->inverse_z[i] = seen ? inverse_z : DEPTH_UNKNOWN;
        for (size_t c = 0; c < 3; c++)
            view->rgb[3 * i + c] = seen ? rgba[4 * i + c] : 128;
    }
    free(rgba);
    return status;
}
