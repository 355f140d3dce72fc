#include "surround/view/surround_view.h"

#include "surround/view/view_layers.h"
#include "base/memory.h"

#include <stdlib.h>
#include <string.h>

struct view_options view_default_options(void)
{
    return (struct view_options){.geometry_pictures = 6, .texture_pictures = 2, .depth_test = true, .apart = 0.04};
}

enum status surround_view_open(struct surround_view *view, const struct lens *lens)
{
    const size_t pixels = (size_t)lens->width * (size_t)lens->height;
    *view = (struct surround_view){.lens = *lens,
                                   .inverse_z = alloc_cache_aligned(pixels * sizeof *view->inverse_z),
                                   .first = alloc_cache_aligned(pixels * sizeof *view->first),
                                   .rgb = alloc_cache_aligned(pixels * 3),
                                   .source = alloc_cache_aligned(pixels)};
    if (view->inverse_z && view->first && view->rgb && view->source)
        return OK;
    surround_view_close(view);
    return fail(ERR_MEMORY, "out of memory");
}

void surround_view_close(struct surround_view *view)
{
    free(view->inverse_z);
    free(view->first);
    free(view->rgb);
    free(view->source);
    *view = (struct surround_view){0};
}

struct ranked {
    const struct surround_picture *picture;
    double distance;
};

static int by_distance(const void *a, const void *b)
{
    const struct ranked *x = a, *y = b;
    if (x->distance != y->distance)
        return x->distance < y->distance ? -1 : 1;
    return (x->picture->time_ns > y->picture->time_ns) - (x->picture->time_ns < y->picture->time_ns);
}

double surround_view_distance(struct pose world_from_view, const struct surround_picture *picture)
{
    const struct vec3 eye = world_from_view.translation, ahead = quat_rotate(world_from_view.rotation, v3(0, 0, 1));
    const struct vec3 focus = v3_add(eye, v3_scale(ahead, 3)), at = picture->world_from_camera.translation;
    const double distance = fmin(v3_distance(at, eye), v3_distance(at, focus));
    if (picture->panorama)
        return distance;
    const double(*axes)[3] = picture->axes;
    return distance + 1 - (axes[0][2] * ahead.x + axes[1][2] * ahead.y + axes[2][2] * ahead.z);
}

enum status surround_view_rank(struct pose world_from_view, const struct surround_picture **pictures, int count)
{
    struct ranked *list = malloc((size_t)(count + 1) * sizeof *list);
    if (!list)
        return fail(ERR_MEMORY, "out of memory");
    for (int i = 0; i < count; i++)
        list[i] = (struct ranked){pictures[i], surround_view_distance(world_from_view, pictures[i])};
    qsort(list, (size_t)count, sizeof *list, by_distance);
    for (int i = 0; i < count; i++)
        pictures[i] = list[i].picture;
    free(list);
    return OK;
}

enum status surround_view_draw(struct surround_view *view, struct pose world_from_view,
                               const struct surround_picture *const *pictures, int count,
                               const struct view_options *how)
{
    const size_t pixels = (size_t)view->lens.width * (size_t)view->lens.height;
    view->world_from_view = world_from_view;
    quat_to_matrix(world_from_view.rotation, view->axes);
    const int layers = count < how->geometry_pictures ? count : how->geometry_pictures;
    float *depth = alloc_cache_aligned(((size_t)layers * pixels + 1) * sizeof *depth);
    if (!depth)
        return fail(ERR_MEMORY, "out of memory");
    for (int i = 0; i < layers; i++)
        view_warp(view, pictures[i], depth + (size_t)i * pixels);
    view_merge(view, pictures, depth, layers, how);
    free(depth);
    const int most = SURROUND_MOST_LAYERS * 4;
    return view_texture(view, pictures, count < most ? count : most, how);
}
