#include "reenact/render/depth_overlay.h"

#include "reenact/render/shaders.h"

#include <math.h>
#include <stdlib.h>

enum { STROKE_FLOATS = 12, SEEN_FLOATS = 8, QUAD = 4, QUAD_CORNERS = 6 };
enum { POINTS_MAX = OVERLAY_GROUPS_MAX * OVERLAY_POINTS };
static const double FARTHEST_PX = 1e5; // a stroke's end farther outside of the image is not drawn

enum program { STROKE, STROKE_ROOM, SEEN, SEEN_ROOM, PROGRAMS };
static const char *const size_uniform[] = {"image_size"};

struct depth_overlay {
    struct gpu_program *programs[PROGRAMS];
    struct gpu_mesh *strokes, *points;
    struct gpu_target *answers; // a pixel for each point, a row for each group
    float (*stroke_vertices)[STROKE_FLOATS], (*point_vertices)[SEEN_FLOATS];
    bool inside[POINTS_MAX]; // the image contains the point
    int groups;              // asked for last
};

static enum status open_programs(struct depth_overlay *overlay, struct gpu *gpu)
{
    static const char *const samplers[] = {"actor", "room"};
    enum status status = OK;
    for (int i = 0; i < PROGRAMS && status == OK; i++) {
        const bool stroke = i < SEEN, room = i == STROKE_ROOM || i == SEEN_ROOM;
        const struct gpu_program_source text = {.name = stroke ? "stroke" : "seen",
                                                .vertex = shader_find(stroke ? "stroke.vert" : "seen.vert"),
                                                .fragment = shader_find(stroke ? "stroke.frag" : "seen.frag"),
                                                .uniforms = size_uniform,
                                                .uniform_count = stroke,
                                                .samplers = samplers,
                                                .sampler_count = room ? 2 : 1,
                                                .word = room ? "ROOM_OCCLUSION" : NULL};
        status = gpu_program_open(&overlay->programs[i], gpu, &text);
    }
    return status;
}

static enum status open_quads(struct gpu_mesh **out, struct gpu *gpu, int floats, int quads)
{
    static const uint16_t order[QUAD_CORNERS] = {0, 1, 2, 2, 1, 3};
    uint16_t *corners = malloc(sizeof *corners * QUAD_CORNERS * (size_t)quads);
    if (!corners)
        return fail(ERR_MEMORY, "no memory for the overlay");
    for (int i = 0; i < QUAD_CORNERS * quads; i++)
        corners[i] = (uint16_t)(QUAD * (i / QUAD_CORNERS) + order[i % QUAD_CORNERS]);
    const struct gpu_mesh_data data = {NULL, floats, QUAD * quads, corners, QUAD_CORNERS * quads};
    const enum status status = gpu_mesh_open(out, gpu, &data);
    free(corners);
    return status;
}

enum status depth_overlay_open(struct depth_overlay **out, struct gpu *gpu)
{
    struct depth_overlay *o = *out = calloc(1, sizeof *o);
    if (!o)
        return fail(ERR_MEMORY, "no memory for the overlay");
    o->stroke_vertices = calloc((size_t)QUAD * OVERLAY_STROKES_MAX, sizeof *o->stroke_vertices);
    o->point_vertices = calloc((size_t)QUAD * POINTS_MAX, sizeof *o->point_vertices);
    enum status status = o->stroke_vertices && o->point_vertices ? OK : fail(ERR_MEMORY, "no memory for the overlay");
    if (status == OK)
        status = open_programs(o, gpu);
    if (status == OK)
        status = open_quads(&o->strokes, gpu, STROKE_FLOATS, OVERLAY_STROKES_MAX);
    if (status == OK)
        status = open_quads(&o->points, gpu, SEEN_FLOATS, POINTS_MAX);
    if (status == OK)
        status = gpu_target_open_color(&o->answers, gpu, OVERLAY_POINTS, OVERLAY_GROUPS_MAX);
    if (status != OK)
        depth_overlay_close(out);
    return status;
}

void depth_overlay_close(struct depth_overlay **out)
{
    struct depth_overlay *o = *out;
    if (!o)
        return;
    for (int i = 0; i < PROGRAMS; i++)
        gpu_program_close(&o->programs[i]);
    gpu_mesh_close(&o->strokes);
    gpu_mesh_close(&o->points);
    gpu_target_close(&o->answers);
    free(o->stroke_vertices);
    free(o->point_vertices);
    free(o);
    *out = NULL;
}

// As the shaders' gl_Position.z / w: linear over a straight line's image.
static double clip_depth(double z_m)
{
    const double n = VIEW_NEAREST_M, f = VIEW_FARTHEST_M;
    return ((f + n) * z_m - 2 * f * n) / ((f - n) * z_m);
}

static bool project_point(const struct lens *lens, struct vec3 p, struct pixel *out)
{
    if (!(p.z > VIEW_NEAREST_M && p.z < VIEW_FARTHEST_M))
        return false;
    *out = lens_project_clamped(lens, lens_max_radius2(lens), p);
    return fabs(out->x) < FARTHEST_PX && fabs(out->y) < FARTHEST_PX;
}

// ---------------------------------------------------------------- strokes

static bool put_stroke(const struct overlay_picture *picture, const struct overlay_stroke *stroke,
                       float (*v)[STROKE_FLOATS])
{
    struct pixel from, to;
    if (!project_point(&picture->lens, stroke->from, &from) || !project_point(&picture->lens, stroke->to, &to))
        return false;
    const double dx = to.x - from.x, dy = to.y - from.y, length = sqrt(dx * dx + dy * dy),
                 radius = stroke->width_px * picture->scale / 2;
    const double ax = length > 0 ? dx / length : 1, ay = length > 0 ? dy / length : 0, reach = radius + 1;
    for (int i = 0; i < QUAD; i++) {
        const bool end = i / 2;
        const double along = end ? length + reach : -reach, across = i % 2 ? reach : -reach;
        const double values[STROKE_FLOATS] = {from.x + along * ax - across * ay,
                                              from.y + along * ay + across * ax,
                                              clip_depth(end ? stroke->to.z : stroke->from.z),
                                              radius,
                                              along,
                                              across,
                                              length,
                                              stroke->dash_px * picture->scale,
                                              (stroke->color >> 24) / 255.0,
                                              (stroke->color >> 16 & 255) / 255.0,
                                              (stroke->color >> 8 & 255) / 255.0,
                                              (stroke->color & 255) / 255.0};
        for (int k = 0; k < STROKE_FLOATS; k++)
            v[i][k] = (float)values[k];
    }
    return true;
}

static void draw_strokes(struct depth_overlay *depth_overlay, struct gpu_target *target,
                         const struct overlay_picture *picture, const struct overlay *overlay)
{
    int count = 0;
    for (int i = 0; i < overlay->stroke_count && count < OVERLAY_STROKES_MAX; i++)
        count += put_stroke(picture, &overlay->strokes[i], depth_overlay->stroke_vertices + QUAD * count);
    if (!count)
        return;
    struct gpu_program *program = depth_overlay->programs[picture->room ? STROKE_ROOM : STROKE];
    gpu_mesh_write_vertices(depth_overlay->strokes, 0, depth_overlay->stroke_vertices[0], STROKE_FLOATS * QUAD * count);
    gpu_program_set(program, 0, (const float[4]){(float)picture->lens.width, (float)picture->lens.height, 0, 0}, 1);
    gpu_draw(&(struct gpu_job){.target = target,
                               .program = program,
                               .mesh = depth_overlay->strokes,
                               .textures = {picture->actor, picture->room},
                               .blend = true,
                               .count = QUAD_CORNERS * count});
}

// ---------------------------------------------------------------- points

static void put_point(const struct overlay_picture *picture, struct vec3 point, int number,
                      struct depth_overlay *overlay)
{
    struct pixel px = {0, 0};
    const struct lens *l = &picture->lens;
    const bool inside =
        project_point(l, point, &px) && px.x >= 0 && px.y >= 0 && px.x <= l->width - 1 && px.y <= l->height - 1;
    overlay->inside[number] = inside;
    for (int i = 0; i < QUAD; i++) {
        const double x = number % OVERLAY_POINTS + i % 2, y = number / OVERLAY_POINTS + i / 2;
        const double values[SEEN_FLOATS] = {2 * x / OVERLAY_POINTS - 1,
                                            2 * y / OVERLAY_GROUPS_MAX - 1,
                                            0,
                                            0,
                                            px.x,
                                            px.y,
                                            inside ? clip_depth(point.z) : -1,
                                            0};
        for (int k = 0; k < SEEN_FLOATS; k++)
            overlay->point_vertices[QUAD * number + i][k] = (float)values[k];
    }
}

static void ask_points(struct depth_overlay *depth_overlay, const struct overlay_picture *picture,
                       const struct overlay *overlay)
{
    depth_overlay->groups = overlay->group_count < OVERLAY_GROUPS_MAX ? overlay->group_count : OVERLAY_GROUPS_MAX;
    const int count = depth_overlay->groups * OVERLAY_POINTS;
    for (int i = 0; i < count; i++)
        put_point(picture, overlay->groups[i / OVERLAY_POINTS].point[i % OVERLAY_POINTS], i, depth_overlay);
    gpu_mesh_write_vertices(depth_overlay->points, 0, depth_overlay->point_vertices[0], SEEN_FLOATS * QUAD * count);
    gpu_draw(&(struct gpu_job){.target = depth_overlay->answers,
                               .program = depth_overlay->programs[picture->room ? SEEN_ROOM : SEEN],
                               .mesh = depth_overlay->points,
                               .textures = {picture->actor, picture->room},
                               .count = QUAD_CORNERS * count});
}

void depth_overlay_draw(struct depth_overlay *depth_overlay, struct gpu_target *target,
                        const struct overlay_picture *picture, const struct overlay *overlay)
{
    if (overlay->stroke_count)
        draw_strokes(depth_overlay, target, picture, overlay);
    if (overlay->group_count)
        ask_points(depth_overlay, picture, overlay);
}

enum status depth_overlay_read(struct depth_overlay *overlay, float share[OVERLAY_GROUPS_MAX], int *count)
{
    uint8_t rgba[4 * POINTS_MAX];
    *count = overlay->groups;
    if (!overlay->groups)
        return OK;
    const enum status status = gpu_target_read(overlay->answers, rgba);
    for (int g = 0; g < overlay->groups && status == OK; g++) {
        int inside = 0, seen = 0;
        for (int i = g * OVERLAY_POINTS; i < (g + 1) * OVERLAY_POINTS; i++)
            if (overlay->inside[i]) {
                inside++;
                seen += rgba[4 * i];
            }
        share[g] = inside ? (float)seen / (255.0F * (float)inside) : 1;
    }
    return status;
}
