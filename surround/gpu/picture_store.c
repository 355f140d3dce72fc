#include "surround/gpu/picture_store.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static void empty(struct stored_picture *p)
{
    for (int i = 0; i < p->count; i++)
        gpu_mesh_close(&p->pieces[i].mesh);
    free(p->pieces);
    *p = (struct stored_picture){0};
}

void picture_store_close(struct picture_store *s)
{
    for (int i = 0; i < s->layers && s->pictures; i++)
        empty(&s->pictures[i]);
    free(s->pictures);
    gpu_texture_close(&s->colors);
    gpu_texture_close(&s->depths);
    gpu_texture_close(&s->ranges);
    *s = (struct picture_store){.gpu = s->gpu, .now = s->now};
}

static enum status open_arrays(struct picture_store *s, int layers, int width, int height)
{
    picture_store_close(s);
    s->layers = layers;
    s->width = width;
    s->height = height;
    s->pictures = calloc((size_t)layers, sizeof *s->pictures);
    enum status status = s->pictures ? OK : fail(ERR_MEMORY, "out of memory");
    if (status == OK)
        status = gpu_texture_open_array(&s->colors, s->gpu,
                                        &(struct gpu_array_layout){GPU_ARRAY_RGB8, width, height, layers});
    if (status == OK)
        status = gpu_texture_open_array(&s->depths, s->gpu,
                                        &(struct gpu_array_layout){GPU_ARRAY_R16F, width, height, layers});
    const struct gpu_array_layout half = {GPU_ARRAY_RG16F, (width + 1) / 2, (height + 1) / 2, layers};
    if (status == OK)
        status = gpu_texture_open_array(&s->ranges, s->gpu, &half);
    if (status != OK)
        picture_store_close(s);
    return status;
}

enum status picture_store_fit(struct picture_store *s, const struct surround_picture *const *pictures, int count)
{
    int layers = s->layers ? s->layers : 1;
    s->now++;
    while (layers < count) // doubled, so that growing is rare
        layers *= 2;
    if (!count || (pictures[0]->width == s->width && pictures[0]->height == s->height && layers == s->layers))
        return OK;
    return open_arrays(s, layers, pictures[0]->width, pictures[0]->height);
}

int picture_store_find(struct picture_store *s, int64_t depth_number)
{
    assert(depth_number);
    for (int i = 0; i < s->layers; i++)
        if (s->pictures[i].depth_number == depth_number) {
            s->pictures[i].used = s->now;
            return i;
        }
    return -1;
}

// ---------------------------------------------------------------- putting in

// 1/m: has a sign in 16 bits, and counts as infinitely far in surround_surface.vert, whose tolerance is 1e-4.
#define LEAST_SIGNED 6.2e-5f

// The pixel's number; negative: it is outside.
static int64_t pixel_at(const struct surround_picture *p, int x, int y)
{
    x = surround_picture_column(p, x);
    return x < 0 || x >= p->width || y < 0 || y >= p->height ? -1 : (int64_t)y * p->width + x;
}

// Of each 2 x 2 pixels and those around them, so that it holds the 3 x 3 about each of the four.
static void fill_ranges(const struct surround_picture *p, float (*out)[2])
{
    for (int y = 0; y < p->height; y += 2)
        for (int x = 0; x < p->width; x += 2, out++) {
            float least = 6e4f, most = DEPTH_UNKNOWN; // the largest that 16 bits hold
            bool measured = false;
            for (int j = -1; j <= 2; j++)
                for (int i = -1; i <= 2; i++) {
                    const int64_t at = pixel_at(p, x + i, y + j);
                    if (at < 0 || p->inverse[at] < 0)
                        continue;
                    least = fminf(least, p->inverse[at]);
                    most = fmaxf(most, p->inverse[at]);
                    measured |= i >= 0 && i < 2 && j >= 0 && j < 2 && !(p->joined[at] & DEPTH_EXTRAPOLATED);
                }
            (*out)[0] = measured ? least : -fmaxf(least, LEAST_SIGNED);
            (*out)[1] = most;
        }
}

static enum status upload_images(struct picture_store *s, const struct surround_picture *p, int layer)
{
    const int across = (p->width + 1) / 2, down = (p->height + 1) / 2;
    float(*ranges)[2] = malloc(sizeof *ranges * (size_t)across * (size_t)down);
    if (!ranges)
        return fail(ERR_MEMORY, "out of memory");
    fill_ranges(p, ranges);
    gpu_texture_write_layer(s->colors, layer, p->width, p->height, p->rgb);
    gpu_texture_write_layer(s->depths, layer, p->width, p->height, p->inverse);
    gpu_texture_write_layer(s->ranges, layer, across, down, ranges);
    free(ranges);
    return OK;
}

static enum status upload_mesh(struct picture_store *s, const struct surround_mesh *mesh, struct stored_picture *to)
{
    enum status status = OK;
    if (!(to->pieces = calloc((size_t)mesh->count + 1, sizeof *to->pieces)))
        status = fail(ERR_MEMORY, "out of memory");
    for (int i = 0; i < mesh->count && status == OK; i++) {
        const struct surround_mesh_piece *from = &mesh->pieces[i];
        struct stored_piece *piece = &to->pieces[to->count];
        const struct gpu_mesh_data data = {from->vertices[0], 4, from->vertex_count, from->indices, from->index_count};
        status = gpu_mesh_open(&piece->mesh, s->gpu, &data);
        memcpy(piece->rays, from->rays, sizeof piece->rays);
        piece->least = from->least;
        piece->most = from->most;
        to->count += status == OK;
    }
    return status;
}

static enum status upload_surface(struct picture_store *s, const struct surround_picture *p, struct stored_picture *to)
{
    struct surround_mesh mesh;
    if (p->mesh)
        return upload_mesh(s, p->mesh, to);
    enum status status = surround_mesh_make(&mesh, p, surround_mesh_tolerance(p));
    if (status == OK)
        status = upload_mesh(s, &mesh, to);
    surround_mesh_free(&mesh);
    return status;
}

enum status picture_store_add(struct picture_store *s, const struct surround_picture *p, int *layer)
{
    int oldest = 0;
    for (int i = 1; i < s->layers; i++)
        if (s->pictures[i].used < s->pictures[oldest].used)
            oldest = i;
    struct stored_picture *to = &s->pictures[oldest];
    assert(to->used < s->now);
    empty(to);
    enum status status = upload_images(s, p, oldest);
    if (status == OK)
        status = upload_surface(s, p, to);
    if (status != OK) {
        empty(to);
        return status;
    }
    to->depth_number = p->depth_number;
    to->used = s->now;
    *layer = oldest;
    return OK;
}
