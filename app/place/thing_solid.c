#include "app/place/thing_solid.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

// A box is as deep as this share of its smaller side: only its front is known. Chosen by hand.
static const double DEPTH_SHARE = 0.4, LEAST_M = 0.05;
static const float BOX_COLOR[4] = {0.18F, 0.62F, 0.58F, 1};

static float to_srgb(float linear) { return powf(linear, 1 / 2.2F); } // factors of glTF are linear

static enum status open_picture(struct thing_solid *s, struct gpu *gpu, int part, const struct image *picture)
{
    if (!picture->width || picture->width > gpu_max_size(gpu) || picture->height > gpu_max_size(gpu))
        return OK;
    const struct gpu_texture_layout how = {GPU_RGB8, picture->width, picture->height, GPU_LINEAR};
    return gpu_texture_open(&s->pictures[part], gpu, &how, picture->rgb);
}

static enum status add_part(struct thing_solid *s, struct gpu *gpu, const struct solid_vertex *v, int count)
{
    uint32_t *corners = malloc(sizeof *corners * (size_t)(count + 1));
    for (int i = 0; i < count && corners; i++)
        corners[i] = (uint32_t)i;
    const enum status status = corners ? solid_mesh_open(&s->parts[s->count], gpu, v, count, corners, count)
                                       : fail(ERR_MEMORY, "no memory for a thing's body");
    free(corners);
    s->count += status == OK;
    return status;
}

// glTF's y is up and its front looks along z; the thing's y is down, its z away from the viewer, its origin in the
// middle of the front. Its height in the list is believed more than the model's.
static enum status open_model(struct thing_solid *s, struct gpu *gpu, const struct place_thing *t)
{
    const struct glb_model *m = &t->model;
    const double high = (double)m->high[1] - (double)m->low[1];
    const float scale = (float)(t->height_m > 0 && high > 1e-6 ? t->height_m / high : 1);
    const float middle[3] = {(m->low[0] + m->high[0]) / 2, (m->low[1] + m->high[1]) / 2, m->high[2]};
    struct solid_vertex *v = malloc(sizeof *v * (size_t)m->corner_count);
    enum status status = v ? OK : fail(ERR_MEMORY, "no memory for a thing's model");
    for (int i = 0; i < m->part_count && status == OK; i++) {
        const struct glb_part *p = &m->parts[i];
        for (int k = 0; k < p->count; k++) {
            const struct glb_corner *c = &m->corners[p->first + k];
            v[k] =
                (struct solid_vertex){.at = {scale * (c->at[0] - middle[0]), -scale * (c->at[1] - middle[1]),
                                             -scale * (c->at[2] - middle[2])},
                                      .normal = {c->normal[0], -c->normal[1], -c->normal[2]},
                                      .u = c->uv[0],
                                      .v = c->uv[1],
                                      .color = {to_srgb(p->color[0]), to_srgb(p->color[1]), to_srgb(p->color[2]), 1}};
        }
        s->two_sided[s->count] = p->two_sided;
        status = open_picture(s, gpu, s->count, &p->picture);
        if (status == OK)
            status = add_part(s, gpu, v, p->count);
    }
    free(v);
    const double w = (double)scale * ((double)m->high[0] - (double)m->low[0]) / 2, h = (double)scale * high / 2;
    s->low = v3(-w, -h, 0);
    s->high = v3(w, h, (double)scale * ((double)m->high[2] - (double)m->low[2]));
    s->is_model = true;
    return status;
}

// The face of a box on side `axis`, +1 or -1: six corners, counter-clockwise from outside.
static void put_face(struct solid_vertex *v, const float half[3], int axis, int sign)
{
    static const int order[6] = {0, 1, 2, 0, 2, 3};
    const int u = (axis + 1) % 3, w = (axis + 2) % 3;
    for (int i = 0; i < 6; i++) {
        const int k = sign > 0 ? order[i] : order[5 - i];
        float at[3];
        at[axis] = (float)sign * half[axis];
        at[u] = (k == 1 || k == 2 ? 1.0F : -1.0F) * half[u];
        at[w] = (k >= 2 ? 1.0F : -1.0F) * half[w];
        v[i] = (struct solid_vertex){.at = {at[0], at[1], at[2] + half[2]}, .color = {1, 1, 1, 1}};
        v[i].normal[axis] = (float)sign;
        v[i].u = at[0] / (2 * half[0]) + 0.5F;
        v[i].v = at[1] / (2 * half[1]) + 0.5F;
    }
}

static enum status open_box(struct thing_solid *s, struct gpu *gpu, const struct place_thing *t)
{
    const double w = fmax(t->width_m, LEAST_M), h = fmax(t->height_m, LEAST_M), d = DEPTH_SHARE * fmin(w, h);
    const float half[3] = {(float)w / 2, (float)h / 2, (float)d / 2};
    struct solid_vertex front[6], rest[30];
    int count = 0;
    put_face(front, half, 2, -1); // towards the viewer
    for (int axis = 0; axis < 3; axis++)
        for (int sign = -1; sign <= 1; sign += 2)
            if (axis != 2 || sign > 0) {
                put_face(rest + count, half, axis, sign);
                count += 6;
            }
    for (int i = 0; i < 30; i++)
        memcpy(rest[i].color, BOX_COLOR, sizeof BOX_COLOR);
    for (int i = 0; i < 6 && !t->picture.width; i++)
        memcpy(front[i].color, BOX_COLOR, sizeof BOX_COLOR);
    s->low = v3(-w / 2, -h / 2, 0);
    s->high = v3(w / 2, h / 2, d);
    enum status status = open_picture(s, gpu, s->count, &t->picture);
    if (status == OK)
        status = add_part(s, gpu, front, 6);
    return status == OK ? add_part(s, gpu, rest, 30) : status;
}

enum status thing_solid_open(struct thing_solid *out, struct gpu *gpu, const struct place_thing *thing)
{
    *out = (struct thing_solid){0};
    const enum status status = thing->model.corner_count ? open_model(out, gpu, thing) : open_box(out, gpu, thing);
    if (status != OK)
        thing_solid_close(out);
    return status;
}

void thing_solid_close(struct thing_solid *s)
{
    for (int i = 0; i < GLB_MOST_PARTS; i++) {
        solid_mesh_close(&s->parts[i]);
        gpu_texture_close(&s->pictures[i]);
    }
    *s = (struct thing_solid){0};
}

void thing_solid_draw(const struct thing_solid *s, struct solid_renderer *r, const struct solid_view *view,
                      struct pose world_from_thing)
{
    for (int i = 0; i < s->count; i++)
        solid_renderer_draw(r, view, s->parts[i],
                            &(struct solid_look){world_from_thing, 1, s->pictures[i], !s->two_sided[i]});
}

void thing_solid_draw_turning(const struct thing_solid *s, struct solid_renderer *r, struct gpu_target *target,
                              double angle)
{
    const int width = gpu_target_width(target);
    const struct vec3 middle = v3_mix(s->low, s->high, 0.5);
    const double radius = fmax(v3_distance(s->low, s->high) / 2, 1e-3), away = 3.2 * radius;
    // Seen slightly from above; the camera's axes are the thing's: y down, z away.
    const struct quat tilt = quat_from_rotation_vector(v3(0.3, 0, 0)),
                      turn = quat_from_rotation_vector(v3(0, angle, 0));
    const struct quat both = quat_multiply(tilt, turn);
    const struct vec3 shifted = quat_rotate(both, middle);
    const struct pose camera_from_thing = {both, v3_sub(v3(0, 0, away), shifted)};
    // Metres are scaled so that a small thing is not nearer than the nearest depth that is drawn.
    const double scale = 1 / radius;
    const struct solid_view view = {target,
                                    {.width = width,
                                     .height = width,
                                     .fx = 1.4 * width,
                                     .fy = 1.4 * width,
                                     .cx = (width - 1) / 2.0,
                                     .cy = (width - 1) / 2.0},
                                    POSE_IDENTITY};
    gpu_target_clear(target);
    for (int i = 0; i < s->count; i++)
        solid_renderer_draw(
            r, &view, s->parts[i],
            &(struct solid_look){{camera_from_thing.rotation, v3_scale(camera_from_thing.translation, scale)},
                                 scale,
                                 s->pictures[i],
                                 !s->two_sided[i]});
}
