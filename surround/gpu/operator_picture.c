#include "surround/gpu/operator_picture.h"

#include "platform/screen/gpu_draw2d.h"
#include "reenact/render/shaders.h"
#include "surround/gpu/surround_renderer.h"

#include <stdlib.h>
#include <string.h>

enum { DEPTH_STEP = 4, MAX_QUADS = OVERLAY_LINES + OVERLAY_RECTS };
static const double LOW_M = 0.1; // what is lower is floor

struct operator_picture {
    struct gpu *gpu;
    struct surround_renderer *renderer;
    struct gpu_draw2d *draw;
    struct gpu_texture *white;
    struct surround_view depth; // of the image before, every DEPTH_STEP-th pixel
    struct gpu_draw2d_vertex vertices[4 * MAX_QUADS];
    uint16_t indices[6 * MAX_QUADS];
    int quads;
};

enum status operator_picture_open(struct operator_picture **out, struct gpu *gpu)
{
    static const uint8_t white[4] = {255, 255, 255, 255};
    struct operator_picture *o = *out = calloc(1, sizeof *o);
    if (!o)
        return fail(ERR_MEMORY, "no memory for the driver's picture");
    const struct gpu_draw2d_shaders shaders = {shader_find("draw2d.vert"), shader_find("draw2d.frag")};
    o->gpu = gpu;
    enum status status = surround_renderer_open(&o->renderer, gpu);
    if (status == OK)
        status = gpu_draw2d_open(&o->draw, gpu, &shaders);
    if (status == OK)
        status = gpu_texture_open(&o->white, gpu, &(struct gpu_texture_layout){GPU_RGBA8, 1, 1, GPU_NEAREST}, white);
    if (status != OK)
        operator_picture_close(out);
    return status;
}

void operator_picture_close(struct operator_picture **out)
{
    struct operator_picture *o = *out;
    if (!o)
        return;
    surround_renderer_close(&o->renderer);
    gpu_draw2d_close(&o->draw);
    gpu_texture_close(&o->white);
    surround_view_close(&o->depth);
    free(o);
    *out = NULL;
}

// All of the session's picture, and more at the sides where the other is wider.
static struct lens fit_lens(const struct lens *of, int width, int height)
{
    const double scale = fmin((double)width / of->width, (double)height / of->height);
    return (struct lens){.width = width,
                         .height = height,
                         .fx = of->fx * scale,
                         .fy = of->fy * scale,
                         .cx = (width - 1) / 2.0 + (of->cx - (of->width - 1) / 2.0) * scale,
                         .cy = (height - 1) / 2.0 + (of->cy - (of->height - 1) / 2.0) * scale};
}

// ---------------------------------------------------------------- the overlay

static void add_quad(struct operator_picture *picture, const double at[4][2], const uint8_t color[3], int percent)
{
    struct gpu_draw2d_vertex *v = &picture->vertices[4 * picture->quads];
    static const uint16_t order[6] = {0, 1, 2, 0, 2, 3};
    for (int k = 0; k < 4; k++)
        v[k] = (struct gpu_draw2d_vertex){(float)at[k][0],
                                          (float)at[k][1],
                                          0.5f,
                                          0.5f,
                                          {color[0], color[1], color[2], (uint8_t)(percent * 255 / 100)}};
    for (int k = 0; k < 6; k++)
        picture->indices[6 * picture->quads + k] = (uint16_t)(4 * picture->quads + order[k]);
    picture->quads++;
}

// Two pixels wide.
static void add_line(struct operator_picture *picture, const struct overlay_line *line)
{
    const double dx = line->bx - line->ax, dy = line->by - line->ay, length = sqrt(dx * dx + dy * dy) + 1e-9;
    const double x = -dy / length, y = dx / length;
    const double at[4][2] = {{line->ax + x + 0.5, line->ay + y + 0.5},
                             {line->bx + x + 0.5, line->by + y + 0.5},
                             {line->bx - x + 0.5, line->by - y + 0.5},
                             {line->ax - x + 0.5, line->ay - y + 0.5}};
    add_quad(picture, at, line->color, OVERLAY_LINE_PERCENT);
}

static void add_rect(struct operator_picture *picture, const struct overlay_rect *rect)
{
    const double right = rect->x + rect->width, bottom = rect->y + rect->height;
    const double at[4][2] = {{rect->x, rect->y}, {right, rect->y}, {right, bottom}, {rect->x, bottom}};
    const uint8_t color[3] = {rect->grey, rect->grey, rect->grey};
    add_quad(picture, at, color, rect->percent);
}

static enum status draw_overlay(struct operator_picture *picture, const struct operator_overlay *overlay,
                                const struct nearest_thing *thing)
{
    struct surround_renderer *r = picture->renderer;
    struct surround_view view = {.lens = r->lens, .world_from_view = r->world_from_view};
    struct overlay_shapes shapes;
    quat_to_matrix(r->world_from_view.rotation, view.axes);
    operator_overlay_shapes(&shapes, &view, overlay, thing);
    picture->quads = 0;
    for (int i = 0; i < shapes.line_count; i++)
        add_line(picture, &shapes.lines[i]);
    for (int i = 0; i < shapes.rect_count; i++)
        add_rect(picture, &shapes.rects[i]);
    const float width = (float)r->lens.width, height = (float)r->lens.height;
    const struct gpu_draw2d_batch batch = {picture->white, 0, 0, width, height, 0, 0, 6 * picture->quads};
    const struct gpu_draw2d_list list = {picture->vertices,  picture->indices,   &batch,
                                         4 * picture->quads, 6 * picture->quads, 1};
    const struct gpu_draw2d_view to = {r->image, r->lens.width, r->lens.height, 0, NULL};
    gpu_draw2d_begin(picture->draw, &to);
    gpu_draw2d_draw(picture->draw, &list);
    return gpu_draw2d_end(picture->draw);
}

static void tint_body(struct operator_picture *picture, const struct operator_overlay *overlay)
{
    const double *size = overlay->size_m;
    struct surround_box box = {.world_from_box = overlay->world_from_body,
                               .low = {-size[0] / 2, -size[1] / 2, 0},
                               .high = {size[0] / 2, size[1] / 2, size[2]},
                               .opacity = OVERLAY_BODY_PERCENT / 100.0};
    memcpy(box.color, overlay_body_color, sizeof box.color);
    if (size[0] > 0)
        surround_renderer_tint(picture->renderer, &box);
}

enum status operator_picture_draw(struct operator_picture *picture, struct drive_session *session, int width,
                                  int height, const struct gpu_texture **out)
{
    struct drive_scene scene;
    struct nearest_thing thing = {0};
    const enum status before = surround_renderer_read_depth(picture->renderer, DEPTH_STEP, &picture->depth);
    enum status status = before < OK ? before : drive_session_prepare(session, &scene);
    if (status != OK)
        return status;
    const struct surround_image image = {fit_lens(&scene.lens, width, height), scene.world_from_view, scene.options,
                                         true, 1};
    status = surround_renderer_draw(picture->renderer, &image, scene.pictures, scene.count, out);
    if (status != OK)
        return status;
    tint_body(picture, &scene.overlay);
    session->near = before == OK &&
                    nearest_in_view(&picture->depth, scene.overlay.world_from_body, scene.size_m, LOW_M, &thing) == OK;
    session->nearest_m = thing.distance_m;
    return draw_overlay(picture, &scene.overlay, session->near ? &thing : NULL);
}

void operator_picture_view(const struct operator_picture *picture, struct lens *lens, struct pose *world_from_view)
{
    *lens = picture->renderer->lens;
    *world_from_view = picture->renderer->world_from_view;
}
