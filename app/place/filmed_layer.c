#include "app/place/filmed_layer.h"

#include <stdlib.h>
#include <string.h>

// The grid over the picture that is bent: pixels from vertex to vertex; neighbours whose inverse depth differs by more
// than this share of the nearer one's lie on two surfaces, between which the picture is open. Chosen by hand.
enum { GRID_PX = 4, MOST_VERTICES = 60000 };
static const float OPEN = 0.08F;
// The flat picture lies this far behind the bent one, metres: the slits that a movement opens at silhouettes have the
// background's colours until the next picture. Nearer to the picture's viewpoint than STILL_M it is shown flat.
static const double BEHIND_M = 50, STILL_M = 1e-6;

struct filmed_layer {
    struct gpu *gpu;
    struct gpu_target *target;
    int width, height;
    struct gpu_texture *texture; // the picture
    struct solid_mesh *mesh, *flat;
    struct solid_vertex *vertices; // MOST_VERTICES
    uint16_t *corners;             // 6 * MOST_VERTICES
    int64_t number;                // of the picture that was uploaded
    int64_t drawn_number;          // what the target shows
    struct lens drawn_lens;
    struct pose drawn_pose;
};

enum status filmed_layer_open(struct filmed_layer **out, struct gpu *gpu)
{
    struct filmed_layer *f = *out = calloc(1, sizeof *f);
    if (!f)
        return fail(ERR_MEMORY, "out of memory");
    f->gpu = gpu;
    f->vertices = malloc(sizeof *f->vertices * MOST_VERTICES);
    f->corners = malloc(sizeof *f->corners * 6 * MOST_VERTICES);
    if (f->vertices && f->corners)
        return OK;
    filmed_layer_close(out);
    return fail(ERR_MEMORY, "out of memory");
}

void filmed_layer_close(struct filmed_layer **out)
{
    struct filmed_layer *f = *out;
    if (!f)
        return;
    gpu_target_close(&f->target);
    gpu_texture_close(&f->texture);
    solid_mesh_close(&f->mesh);
    solid_mesh_close(&f->flat);
    free(f->vertices);
    free(f->corners);
    free(f);
    *out = NULL;
}

static void put_vertex(struct solid_vertex *v, const struct room_picture *p, int x, int y)
{
    const float inverse = p->inverse_z[(size_t)y * (size_t)p->lens.width + (size_t)x];
    const double z = inverse > 1e-3F ? 1 / (double)inverse : 1;
    const struct vec3 world = pose_apply(p->world_from_view, v3_scale(lens_ray(&p->lens, (struct pixel){x, y}), z));
    *v = (struct solid_vertex){.at = {(float)world.x, (float)world.y, (float)world.z},
                               .u = ((float)x + 0.5F) / (float)p->lens.width,
                               .v = ((float)y + 0.5F) / (float)p->lens.height,
                               .color = {1, 1, 1, 1}};
}

static bool closed(const float inverse[3])
{
    float low = inverse[0], high = inverse[0];
    for (int k = 1; k < 3; k++) {
        low = fminf(low, inverse[k]);
        high = fmaxf(high, inverse[k]);
    }
    return low > 1e-3F && high - low < OPEN * high;
}

// The picture as a surface: *vertices and *corners used.
static void bend(struct filmed_layer *f, const struct room_picture *p, int *vertex_count, int *corner_count)
{
    int step = GRID_PX, columns, rows;
    do {
        columns = (p->lens.width - 2) / step + 2;
        rows = (p->lens.height - 2) / step + 2;
        step++;
    } while (columns * rows > MOST_VERTICES);
    step--;
    *corner_count = 0;
    *vertex_count = columns * rows;
    for (int r = 0; r < rows; r++)
        for (int c = 0; c < columns; c++) {
            const int x = c * step < p->lens.width ? c * step : p->lens.width - 1;
            const int y = r * step < p->lens.height ? r * step : p->lens.height - 1;
            put_vertex(&f->vertices[r * columns + c], p, x, y);
        }
    for (int r = 0; r + 1 < rows; r++)
        for (int c = 0; c + 1 < columns; c++) {
            const int i = r * columns + c,
                      quad[2][3] = {{i, i + columns, i + 1}, {i + 1, i + columns, i + columns + 1}};
            for (int t = 0; t < 2; t++) {
                float inverse[3];
                for (int k = 0; k < 3; k++) {
                    const int rc = quad[t][k] / columns * step, cc = quad[t][k] % columns * step;
                    const int y = rc < p->lens.height ? rc : p->lens.height - 1;
                    const int x = cc < p->lens.width ? cc : p->lens.width - 1;
                    inverse[k] = p->inverse_z[(size_t)y * (size_t)p->lens.width + (size_t)x];
                }
                for (int k = 0; k < 3 && closed(inverse); k++)
                    f->corners[(*corner_count)++] = (uint16_t)quad[t][k];
            }
        }
}

static enum status upload_texture(struct filmed_layer *f, const struct room_picture *p)
{
    const struct gpu_texture_layout how = {GPU_RGBA8, p->lens.width, p->lens.height, GPU_LINEAR};
    return gpu_texture_put(&f->texture, f->gpu, &how, p->rgba);
}

// The whole picture on the plane z = 1 of its camera.
static enum status open_flat(struct filmed_layer *f, const struct room_picture *p)
{
    static const uint32_t corners[6] = {0, 2, 1, 1, 2, 3};
    struct solid_vertex v[4];
    for (int i = 0; i < 4; i++) {
        const int right = i & 1, low = i >> 1;
        const struct pixel px = {right ? p->lens.width - 0.5 : -0.5, low ? p->lens.height - 0.5 : -0.5};
        const struct vec3 at = lens_ray(&p->lens, px);
        v[i] = (struct solid_vertex){
            .at = {(float)at.x, (float)at.y, (float)at.z}, .u = (float)right, .v = (float)low, .color = {1, 1, 1, 1}};
    }
    solid_mesh_close(&f->flat);
    return solid_mesh_open(&f->flat, f->gpu, v, 4, corners, 6);
}

static enum status upload(struct filmed_layer *f, const struct room_picture *p)
{
    int vertices, corners;
    enum status status = upload_texture(f, p);
    if (status == OK)
        status = open_flat(f, p);
    if (status != OK)
        return status;
    bend(f, p, &vertices, &corners);
    if (!f->mesh) { // of the largest size, once
        uint32_t *all = malloc(sizeof *all * 6 * MOST_VERTICES);
        for (int i = 0; i < 6 * MOST_VERTICES && all; i++)
            all[i] = (uint32_t)(i % MOST_VERTICES);
        for (int i = vertices; i < MOST_VERTICES; i++)
            f->vertices[i] = (struct solid_vertex){.u = 0};
        status = all ? solid_mesh_open(&f->mesh, f->gpu, f->vertices, MOST_VERTICES, all, 6 * MOST_VERTICES)
                     : fail(ERR_MEMORY, "out of memory");
        free(all);
        if (status != OK)
            return status;
    }
    solid_mesh_write(f->mesh, f->vertices, vertices, f->corners, corners);
    f->number = p->number;
    return OK;
}

static bool same_pose(const struct pose *a, const struct pose *b)
{
    return pose_angle(*a, *b) < 1e-9 && v3_distance(a->translation, b->translation) < 1e-9;
}

enum status filmed_layer_draw(struct filmed_layer *f, struct solid_renderer *r, const struct room_picture *p,
                              const struct lens *lens, struct pose world_from_camera, const struct gpu_texture **out)
{
    enum status status = OK;
    if (f->target && p->number == f->drawn_number && lens_equal(lens, &f->drawn_lens) &&
        same_pose(&f->drawn_pose, &world_from_camera)) {
        *out = gpu_target_texture(f->target);
        return OK;
    }
    if (!f->target || f->width != lens->width || f->height != lens->height) {
        gpu_target_close(&f->target);
        f->width = lens->width;
        f->height = lens->height;
        status = gpu_target_open(&f->target, f->gpu, lens->width, lens->height);
    }
    if (status == OK && p->number != f->number)
        status = upload(f, p);
    if (status != OK)
        return status;
    const struct solid_view view = {f->target, *lens, world_from_camera};
    const bool still = v3_distance(p->world_from_view.translation, world_from_camera.translation) < STILL_M;
    const struct solid_look flat = {p->world_from_view, still ? 1 : BEHIND_M, f->texture, false};
    const struct solid_look bent = {POSE_IDENTITY, 1, f->texture, false};
    gpu_target_clear(f->target);
    solid_renderer_draw(r, &view, f->flat, &flat);
    if (!still)
        solid_renderer_draw(r, &view, f->mesh, &bent);
    f->drawn_number = p->number;
    f->drawn_lens = *lens;
    f->drawn_pose = world_from_camera;
    *out = gpu_target_texture(f->target);
    return OK;
}
