#include "base/threads.h"
#include "tests/world/actor.h"
#include "tests/world/numbers.h"

#include <stdlib.h>
#include <string.h>

enum { TILE = 16, SIDE = ACTOR_SIDE }; // pixels of a tile's side; samples of a pixel's side
_Static_assert(SIDE *SIDE <= ROOM_SAMPLES, "a pixel's samples fit");

struct job {
    const struct world *w;
    const struct world_shot *shot;
    struct world_image *out;
    struct actor *actor;          // NULL: no actor
    double rotation_matrix[3][3]; // world_from_camera
    struct vec3 eye;
    int tiles_across, bands;
    uint32_t *boxes;              // bands x tiles_across: the boxes a tile may see
    struct pixel_corner *corners; // for each band two rows of width + 1; NULL where there is a view
    struct still_view *view;      // of this camera; NULL: everything is computed
};

static struct vec3 ray_at(const struct job *j, double x, double y)
{
    struct vec3 d = lens_ray(&j->shot->lens, (struct pixel){x, y});
    return v3(j->rotation_matrix[0][0] * d.x + j->rotation_matrix[0][1] * d.y + j->rotation_matrix[0][2],
              j->rotation_matrix[1][0] * d.x + j->rotation_matrix[1][1] * d.y + j->rotation_matrix[1][2],
              j->rotation_matrix[2][0] * d.x + j->rotation_matrix[2][1] * d.y + j->rotation_matrix[2][2]);
}

// Marks the tiles that a box's projection may cover; all of them when it reaches behind the camera.
static void mark_box(struct job *j, int box)
{
    const struct lens *l = &j->shot->lens;
    const struct room_box *b = &j->w->scene.boxes[box];
    struct pose camera_from_world = pose_inverse(j->shot->world_from_camera);
    double x0 = 1e9, x1 = -1e9, y0 = 1e9, y1 = -1e9;
    for (int i = 0; i < 8; i++) {
        struct vec3 p = v3(i & 1 ? b->high.x : b->low.x, i & 2 ? b->high.y : b->low.y, i & 4 ? b->high.z : b->low.z);
        p = pose_apply(camera_from_world, p);
        if (p.z < 0.05) {
            x0 = y0 = -1e9;
            x1 = y1 = 1e9;
            break;
        }
        // Far outside the image the distortion polynomial is invalid: clamp before.
        struct vec3 q = v3(least(most(p.x / p.z, -1.5), 1.5), least(most(p.y / p.z, -1.5), 1.5), 1);
        struct pixel px = lens_project(l, q);
        x0 = least(x0, px.x), x1 = most(x1, px.x);
        y0 = least(y0, px.y), y1 = most(y1, px.y);
    }
    double margin = 2 + 0.02 * l->width; // edges bend a little
    int tx0 = (int)most(0, (x0 - margin) / TILE), tx1 = (int)least(j->tiles_across - 1, (x1 + margin) / TILE);
    int ty0 = (int)most(0, (y0 - margin) / TILE), ty1 = (int)least(j->bands - 1, (y1 + margin) / TILE);
    for (int y = ty0; y <= ty1; y++)
        for (int x = tx0; x <= tx1; x++)
            j->boxes[y * j->tiles_across + x] |= 1u << box;
}

static void tone(const float linear[3], uint8_t rgb[3])
{
    for (int c = 0; c < 3; c++) {
        float x = linear[c];
        if (x > 0.6f) // highlights are compressed instead of clipped
            x = 1 - 0.4f * expf(-(x - 0.6f) / 0.4f);
        rgb[c] = linear_to_srgb(x);
    }
}

// Radiance from a point of the room towards the camera.
static void shade(const struct job *j, const struct hit *h, int decal, struct vec3 at, struct footprint foot,
                  float color[3])
{
    const struct world_scene *s = &j->w->scene;
    const struct room_surface *f = &s->surfaces[h->surface];
    float albedo[3], light[3];
    float glow = scene_albedo(s, (struct surface_point){h->surface, decal, h->u, h->v}, foot, albedo);
    scene_light(f, h->u, h->v, light);
    if (j->actor && actor_shades(j->actor, h->surface, h->u, h->v, 0)) {
        float lost[3], ambient;
        actor_shadow(j->actor, at, f->normal, lost, &ambient);
        for (int c = 0; c < 3; c++)
            light[c] = maxf(light[c] - lost[c], 0.1f * light[c]) * ambient;
    }
    for (int c = 0; c < 3; c++)
        color[c] = albedo[c] * (glow > 0 ? glow : light[c]);
}

static struct footprint footprint_of(const struct pixel_corner *top, const struct pixel_corner *low, float scale)
{
    return (struct footprint){
        scale * 0.5f * (float)(top[1].hit.u - top[0].hit.u + low[1].hit.u - low[0].hit.u),
        scale * 0.5f * (float)(top[1].hit.v - top[0].hit.v + low[1].hit.v - low[0].hit.v),
        scale * 0.5f * (float)(low[0].hit.u - top[0].hit.u + low[1].hit.u - top[1].hit.u),
        scale * 0.5f * (float)(low[0].hit.v - top[0].hit.v + low[1].hit.v - top[1].hit.v),
    };
}

// The ray through (a, b) of a pixel, 0..1 from its upper left corner.
static struct vec3 ray_inside(const struct pixel_corner *top, const struct pixel_corner *low, double a, double b)
{
    return v3_mix(v3_mix(top[0].ray, top[1].ray, a), v3_mix(low[0].ray, low[1].ray, a), b);
}

// How far u and v run over a sample at a hit, from the rays' differentials.
static struct footprint footprint_at(const struct job *j, const struct hit *h, struct vec3 ray,
                                     const struct pixel_corner *top, const struct pixel_corner *low, float scale)
{
    const struct room_surface *f = &j->w->scene.surfaces[h->surface];
    double against = v3_dot(ray, f->normal);
    struct vec3 d[2] = {v3_sub(top[1].ray, top[0].ray), v3_sub(low[0].ray, top[0].ray)};
    float out[4];
    for (int i = 0; i < 2; i++) {
        // moving the ray by d moves the hit by t (d - ray (d.n) / (ray.n))
        struct vec3 m = v3_scale(v3_sub(d[i], v3_scale(ray, v3_dot(d[i], f->normal) / against)), h->distance);
        out[2 * i] = scale * (float)v3_dot(m, f->u);
        out[2 * i + 1] = scale * (float)v3_dot(m, f->v);
    }
    return (struct footprint){out[0], out[1], out[2], out[3]};
}

static bool same_thing(const struct pixel_corner *a, const struct pixel_corner *b)
{
    return a->hit.surface == b->hit.surface && a->decal == b->decal;
}

static struct room_sample sample_of(const struct hit *h)
{
    return (struct room_sample){(float)h->u, (float)h->v, h->surface};
}

// One pixel of the room: one sample where it shows one surface, else SIDE x SIDE. Returns how many.
static int room_color(const struct job *j, const struct pixel_corner *top, const struct pixel_corner *low,
                      uint32_t boxes, float color[3], struct room_sample samples[ROOM_SAMPLES])
{
    const struct world_scene *s = &j->w->scene;
    bool one = same_thing(&top[0], &top[1]) && same_thing(&top[0], &low[0]) && same_thing(&top[0], &low[1]) &&
               !(top[0].decal >= 0 && s->decals[top[0].decal].tag);
    if (one) {
        struct hit h = top[0].hit;
        struct vec3 ray = ray_inside(top, low, 0.5, 0.5);
        const struct room_surface *f = &s->surfaces[h.surface];
        h.distance = v3_dot(v3_sub(f->corner, j->eye), f->normal) / v3_dot(ray, f->normal);
        struct vec3 at = v3_add(j->eye, v3_scale(ray, h.distance)), in = v3_sub(at, f->corner);
        h.u = v3_dot(in, f->u);
        h.v = v3_dot(in, f->v);
        shade(j, &h, top[0].decal, at, footprint_of(top, low, 1), color);
        samples[0] = sample_of(&h);
        return 1;
    }
    float sum[3] = {0};
    for (int i = 0; i < SIDE * SIDE; i++) {
        struct vec3 ray = ray_inside(top, low, (i % SIDE + 0.5) / SIDE, (i / SIDE + 0.5) / SIDE);
        struct hit h = scene_hit(s, j->eye, ray, boxes);
        float part[3];
        shade(j, &h, scene_decal(s, h.surface, h.u, h.v), v3_add(j->eye, v3_scale(ray, h.distance)),
              footprint_at(j, &h, ray, top, low, 1.0f / SIDE), part);
        samples[i] = sample_of(&h);
        for (int c = 0; c < 3; c++)
            sum[c] += part[c];
    }
    for (int c = 0; c < 3; c++)
        color[c] = sum[c] / (SIDE * SIDE);
    return SIDE * SIDE;
}

// Whether the figure's shadow may reach a pixel of the view. True also where rounding leaves it open.
static bool is_shaded(const struct job *j, int band, size_t at)
{
    const struct room_sample *s = still_view_samples(j->view, band, at);
    for (int i = 0; i < j->view->sample_count[at]; i++)
        if (actor_shades(j->actor, s[i].surface, (double)s[i].u, (double)s[i].v, ROOM_SAMPLE_ROUNDING))
            return true;
    return false;
}

static void view_or_room_color(const struct job *j, int x, int y, const struct pixel_corner *top,
                               const struct pixel_corner *low, uint32_t boxes, float color[3])
{
    const size_t at = (size_t)y * (size_t)j->shot->lens.width + (size_t)x;
    struct room_sample samples[ROOM_SAMPLES];
    if (j->view && !(j->actor && is_shaded(j, y / TILE, at)))
        memcpy(color, j->view->color[at], sizeof j->view->color[at]);
    else
        room_color(j, top, low, boxes, color, samples);
}

static void color_pixel(const struct job *j, int x, int y, const struct pixel_corner *top,
                        const struct pixel_corner *low, uint32_t boxes)
{
    float room[3] = {0}, body[3];
    int seen = 0;
    double z_near, z_far;
    int cover = j->actor ? actor_cover(j->actor, x, y, &z_near, &z_far) : 0;
    if (cover) {
        double room_z[ACTOR_SAMPLES], nearest = least(least(top[0].hit.distance, top[1].hit.distance),
                                                      least(low[0].hit.distance, low[1].hit.distance));
        bool clear = z_far < nearest - 0.05;
        for (int i = 0; i < ACTOR_SAMPLES && !clear; i++)
            room_z[i] = scene_hit(&j->w->scene, j->eye,
                                  ray_inside(top, low, (i % SIDE + 0.5) / SIDE, (i / SIDE + 0.5) / SIDE), boxes)
                            .distance;
        actor_color(j->actor, x, y, clear ? NULL : room_z, body, &seen);
    }
    if (seen < ACTOR_SAMPLES)
        view_or_room_color(j, x, y, top, low, boxes, room);
    for (int c = 0; c < 3 && seen; c++)
        room[c] += (body[c] - room[c]) * (float)seen / ACTOR_SAMPLES;
    tone(room, j->out->color + ((size_t)y * (size_t)j->shot->lens.width + (size_t)x) * 3);
}

static void corner_row(const struct job *j, int band, int y, struct pixel_corner *row)
{
    const struct world_scene *s = &j->w->scene;
    for (int x = 0; x <= j->shot->lens.width; x++) {
        int tile = x / TILE < j->tiles_across ? x / TILE : j->tiles_across - 1;
        row[x].ray = ray_at(j, x - 0.5, y - 0.5);
        row[x].hit = scene_hit(s, j->eye, row[x].ray, j->boxes[band * j->tiles_across + tile]);
        row[x].decal = scene_decal(s, row[x].hit.surface, row[x].hit.u, row[x].hit.v);
    }
}

static double room_depth(const struct job *j, int x, int y, uint32_t boxes)
{
    return scene_hit(&j->w->scene, j->eye, ray_at(j, x, y), boxes).distance;
}

static void depth_pixel(const struct job *j, int x, int y, uint32_t boxes)
{
    size_t at = (size_t)y * (size_t)j->shot->lens.width + (size_t)x;
    double z = j->view ? j->view->depth[at] : room_depth(j, x, y, boxes);
    double body = j->actor ? actor_depth(j->actor, x, y) : 0;
    bool person = body > 0 && body < z;
    double mm = (person ? body : z) * 1000;
    if (j->out->depth)
        j->out->depth[at] = mm < 65535 ? (uint16_t)(mm + 0.5) : 0;
    if (j->out->mask)
        j->out->mask[at] = person;
}

static void draw_band(void *context, int band)
{
    struct job *j = context;
    int width = j->shot->lens.width, first = band * TILE, end = first + TILE;
    end = end < j->shot->lens.height ? end : j->shot->lens.height;
    if (j->actor)
        actor_draw_rows(j->actor, first, end);
    struct pixel_corner *rows[2] = {NULL, NULL};
    for (int i = 0; i < 2 && j->out->color && !j->view; i++)
        rows[i] = j->corners + (size_t)(2 * band + i) * (size_t)(width + 1);
    if (rows[0])
        corner_row(j, band, first, rows[first & 1]);
    for (int y = first; y < end; y++) {
        if (rows[0])
            corner_row(j, band, y + 1, rows[(y + 1) & 1]);
        const struct pixel_corner *top = j->view ? still_view_corners(j->view, band, y - first) : rows[y & 1],
                                  *low = j->view ? still_view_corners(j->view, band, y - first + 1) : rows[(y + 1) & 1];
        for (int x = 0; x < width; x++) {
            uint32_t boxes = j->boxes[band * j->tiles_across + x / TILE];
            if (j->out->color)
                color_pixel(j, x, y, top + x, low + x, boxes);
            if (j->out->depth || j->out->mask)
                depth_pixel(j, x, y, boxes);
        }
    }
}

// Fills the view's rows of a band.
static void fill_view(void *context, int band)
{
    struct job *j = context;
    struct still_view *v = j->view;
    const int width = v->lens.width, first = band * TILE,
              end = first + TILE < v->lens.height ? first + TILE : v->lens.height;
    corner_row(j, band, first, still_view_corners(v, band, 0));
    for (int y = first; y < end; y++) {
        const struct pixel_corner *top = still_view_corners(v, band, y - first);
        struct pixel_corner *low = still_view_corners(v, band, y - first + 1);
        corner_row(j, band, y + 1, low);
        for (int x = 0; x < width; x++) {
            const size_t at = (size_t)y * (size_t)width + (size_t)x;
            const uint32_t boxes = j->boxes[band * j->tiles_across + x / TILE];
            struct room_sample samples[ROOM_SAMPLES];
            still_view_add(v, band, at, samples, room_color(j, top + x, low + x, boxes, v->color[at], samples));
            v->depth[at] = room_depth(j, x, y, boxes);
        }
    }
}

// The kept view of the camera, or a new one where it pays; j->view stays NULL where there is none, or no memory.
static void find_view(struct job *j)
{
    bool known;
    struct still_views *views = j->w->views;
    j->view = still_views_find(views, &j->shot->lens, j->shot->world_from_camera, &known);
    if (j->view || !known || !j->out->color)
        return;
    j->view = still_view_make(&j->shot->lens, j->shot->world_from_camera, TILE);
    if (!j->view)
        return;
    parallel_for(j->w->options.threads, j->bands, fill_view, j);
    if (j->view->failed) {
        still_view_free(j->view);
        j->view = NULL;
    } else {
        still_views_keep(views, j->view);
    }
}

// With the views of cameras that stand still, or without.
static enum status render(const struct world *w, const struct world_shot *shot, struct world_image *out, bool views)
{
    enum status status = lens_check(&shot->lens, "small world's");
    if (status)
        return status;
    int width = shot->lens.width, height = shot->lens.height;
    struct job j = {.w = w, .shot = shot, .out = out, .eye = shot->world_from_camera.translation};
    quat_to_matrix(shot->world_from_camera.rotation, j.rotation_matrix);
    j.tiles_across = (width + TILE - 1) / TILE;
    j.bands = (height + TILE - 1) / TILE;
    j.boxes = calloc((size_t)j.tiles_across * (size_t)j.bands, sizeof *j.boxes);
    for (int i = 0; i < w->scene.box_count && j.boxes; i++)
        mark_box(&j, i);
    if (views && j.boxes)
        find_view(&j);
    if (out->color && !j.view)
        j.corners = malloc((size_t)(2 * j.bands) * (size_t)(width + 1) * sizeof *j.corners);
    if (!j.boxes || (out->color && !j.view && !j.corners))
        status = fail(ERR_MEMORY, "out of memory for an image of %d x %d", width, height);
    if (!status && shot->actor) {
        status = actor_open(&j.actor, w, shot->time_s, out->color != NULL);
        if (!status)
            status = actor_aim(j.actor, &shot->lens, shot->world_from_camera, out->color != NULL);
    }
    if (!status)
        parallel_for(w->options.threads, j.bands, draw_band, &j);
    actor_close(&j.actor);
    still_views_leave(w->views, j.view);
    free(j.boxes);
    free(j.corners);
    return status;
}

enum status world_render(const struct world *w, const struct world_shot *shot, struct world_image *out)
{
    return render(w, shot, out, true);
}

struct rolling {
    const struct world *w;
    const struct world_shot *shot;
    world_path *path;
    const void *context;
    double time_s;
    struct world_image *out;
    bool *done; // for each row
};

static void render_row(void *context, int y)
{
    const struct rolling *r = context;
    const struct world_image *out = r->out;
    size_t at = (size_t)y * (size_t)r->shot->lens.width;
    int height = r->shot->lens.height;
    double middle = (height - 1) / 2.0, rows = height > 1 ? height - 1 : 1;
    struct world_shot row = *r->shot;
    struct world_image part = {out->color ? out->color + 3 * at : NULL, out->depth ? out->depth + at : NULL,
                               out->mask ? out->mask + at : NULL};
    row.lens.height = 1;
    row.lens.cy -= y;
    row.world_from_camera = r->path(r->context, r->time_s + r->shot->lens.readout_s * (y - middle) / rows);
    r->done[y] = render(r->w, &row, &part, false) == OK;
}

enum status world_render_rolling(const struct world *w, const struct world_shot *shot, world_path *path,
                                 const void *context, double time_s, struct world_image *out)
{
    enum status status = lens_check(&shot->lens, "small world's");
    if (status != OK)
        return status;
    bool *done = calloc((size_t)shot->lens.height, sizeof *done), all = done != NULL;
    struct rolling r = {w, shot, path, context, time_s, out, done};
    if (done)
        parallel_for(w->options.threads, shot->lens.height, render_row, &r);
    for (int y = 0; y < shot->lens.height && all; y++)
        all = done[y];
    free(done);
    return all ? OK : fail(ERR_MEMORY, "no memory for an image that is read row by row");
}
