// View-dependent texture: each pixel's colour from the pictures that saw its point from the smallest angle, sharp and
// unoccluded, blended so that weights fade out before a picture leaves the blend (Buehler et al. 2001, unstructured
// lumigraph rendering, section 4).
#include "reenact/surround/view/view_layers.h"

#include "reenact/surround/picture/fast_angle.h"

#include <stdlib.h>
#include <string.h>

enum { TILE = 16, TILE_PICTURES = 8, MOST_BLENDED = 4 };
#define COST_HIDDEN 1e9f

struct texture {
    struct surround_view *view;
    const struct surround_picture *const *pictures;
    int count;
    const struct view_options *how;
    float pixel_angle; // of the view, radians
};

// A point of the surface with the way from it to the view.
struct shaded {
    double world[3];
    float to_view[3], distance2; // metres, squared
    float pixel_m;               // size of the view's pixel there
};

static struct shaded shaded_point(const struct texture *t, int x, int y, float inverse_z)
{
    struct shaded s;
    const struct vec3 *v = &t->view->world_from_view.translation;
    surround_view_point(t->view, x, y, inverse_z, s.world);
    s.to_view[0] = (float)(v->x - s.world[0]);
    s.to_view[1] = (float)(v->y - s.world[1]);
    s.to_view[2] = (float)(v->z - s.world[2]);
    s.distance2 = s.to_view[0] * s.to_view[0] + s.to_view[1] * s.to_view[1] + s.to_view[2] * s.to_view[2];
    s.pixel_m = t->pixel_angle * sqrtf(s.distance2) + 1e-9f;
    return s;
}

static float angle_of_pixel(const struct surround_picture *p)
{
    return p->panorama ? 6.2831853f / (float)p->width : (float)(1 / p->lens.fx);
}

// a x b and, returned, a . b of the ways to the view and to the picture. *length2: b's.
static float compare_ways(const struct shaded *s, const struct surround_picture *p, float cross[3], float *length2)
{
    const struct vec3 *c = &p->world_from_camera.translation;
    const float *a = s->to_view;
    const float b[3] = {(float)(c->x - s->world[0]), (float)(c->y - s->world[1]), (float)(c->z - s->world[2])};
    cross[0] = a[1] * b[2] - a[2] * b[1];
    cross[1] = a[2] * b[0] - a[0] * b[2];
    cross[2] = a[0] * b[1] - a[1] * b[0];
    *length2 = b[0] * b[0] + b[1] * b[1] + b[2] * b[2];
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

// Angle between the view's and the picture's ray, and resolution short of the view's, in radians.
static float cost_of(const struct texture *t, const struct surround_picture *p, const struct shaded *s, float distance)
{
    float cross[3], length2;
    const float along = compare_ways(s, p, cross, &length2);
    const float angle = fast_atan2(sqrtf(cross[0] * cross[0] + cross[1] * cross[1] + cross[2] * cross[2]), along);
    // Size of the picture's pixel at the point over that of the view's
    const float coarse = angle_of_pixel(p) * distance / s->pixel_m;
    return angle + (float)t->how->resolution_cost * (coarse > 0.5f ? coarse - 0.5f : 0);
}

// Whether cost_of surely is `limit` or more, from bounds that cost less: an angle is larger than its sine. The slack is
// for rounding and for fast_atan2's error of 1e-5.
static bool costs_more(const struct texture *t, const struct surround_picture *p, const struct shaded *s, float limit)
{
    float cross[3], length2;
    const float along = compare_ways(s, p, cross, &length2);
    const float coarse = angle_of_pixel(p) * sqrtf(length2) / s->pixel_m * 0.9999f;
    const float left = limit + 1e-4f - (float)t->how->resolution_cost * (coarse > 0.5f ? coarse - 0.5f : 0);
    if (left <= 0 || (along < 0 && left < 1.5f))
        return true;
    return cross[0] * cross[0] + cross[1] * cross[1] + cross[2] * cross[2] >
           left * left * s->distance2 * length2 * 1.0001f;
}

struct choice {
    int picture;
    float cost;
    struct picture_point at;
};

static void insert(struct choice *list, int *count, int most, const struct choice *one)
{
    if (*count == most && list[most - 1].cost <= one->cost)
        return;
    int at = *count < most ? (*count)++ : most - 1;
    for (; at > 0 && list[at - 1].cost > one->cost; at--)
        list[at] = list[at - 1];
    list[at] = *one;
}

// How much of the 2 x 2 pixels around a point are of the point's surface, 0..1.
static float share_seen(const struct surround_picture *p, const struct picture_point *at, float apart)
{
    const int u = (int)floorf(at->u), v = (int)floorf(at->v);
    const float fu = at->u - (float)u, fv = at->v - (float)v, wanted = 1 / at->distance;
    float sum = 0;
    for (int k = 0; k < 4; k++) {
        int x = u + (k & 1), y = v + (k >> 1);
        if (p->panorama)
            x = x < 0 ? x + p->width : x >= p->width ? x - p->width : x;
        x = x < 0 ? 0 : x >= p->width ? p->width - 1 : x;
        y = y < 0 ? 0 : y >= p->height ? p->height - 1 : y;
        const float inverse = p->inverse[(size_t)y * (size_t)p->width + (size_t)x];
        if (fabsf(inverse - wanted) <= apart * wanted + 2e-4f)
            sum += (k & 1 ? fu : 1 - fu) * (k >> 1 ? fv : 1 - fv);
    }
    return sum;
}

// The pictures that may serve a tile: the best for any of five of its pixels.
static int tile_pictures(const struct texture *t, int x0, int y0, int out[])
{
    const int w = t->view->lens.width, h = t->view->lens.height;
    const int x1 = x0 + TILE - 1 < w ? x0 + TILE - 1 : w - 1, y1 = y0 + TILE - 1 < h ? y0 + TILE - 1 : h - 1;
    const int at[5][2] = {{(x0 + x1) / 2, (y0 + y1) / 2}, {x0, y0}, {x1, y0}, {x0, y1}, {x1, y1}};
    bool taken[SURROUND_MOST_LAYERS * 4] = {0};
    int count = 0;
    for (int k = 0; k < 5; k++) {
        const float inverse_z = t->view->inverse_z[(size_t)at[k][1] * (size_t)w + (size_t)at[k][0]];
        struct choice list[TILE_PICTURES];
        int n = 0;
        if (inverse_z < 0)
            continue;
        const struct shaded s = shaded_point(t, at[k][0], at[k][1], inverse_z);
        for (int i = 0; i < t->count; i++) {
            struct choice one = {.picture = i};
            if (!surround_picture_project(t->pictures[i], s.world, &one.at))
                continue;
            one.cost = cost_of(t, t->pictures[i], &s, one.at.distance);
            if (picture_sight(t->pictures[i], &one.at, 0.05f) != SIGHT_SEEN)
                one.cost += 10;
            insert(list, &n, TILE_PICTURES, &one);
        }
        for (int i = 0; i < n; i++)
            if (!taken[list[i].picture] && count < 2 * TILE_PICTURES) {
                taken[list[i].picture] = true;
                out[count++] = list[i].picture;
            }
    }
    return count;
}

static void blend(const struct texture *t, struct choice *list, int count, uint8_t rgb[3])
{
    const int blended = count > t->how->texture_pictures ? t->how->texture_pictures : count;
    // The cost at which a picture's weight is 0: that of the next one
    const float end = count > blended ? list[blended].cost : list[blended - 1].cost * 1.5f + 0.02f;
    float sum[3] = {0}, weights = 0;
    for (int i = 0; i < blended; i++) {
        const float fade = 1 - list[i].cost / (end + 1e-6f);
        const float weight = (fade > 0.001f ? fade : 0.001f) / (list[i].cost + 0.02f);
        float color[3];
        surround_picture_sample(t->pictures[list[i].picture], list[i].at.u, list[i].at.v, color);
        for (int c = 0; c < 3; c++)
            sum[c] += weight * color[c];
        weights += weight;
    }
    for (int c = 0; c < 3; c++)
        rgb[c] = (uint8_t)(sum[c] / weights + 0.5f);
}

static void shade(const struct texture *t, int x, int y, const int *pictures, int count)
{
    struct surround_view *view = t->view;
    const size_t i = (size_t)y * (size_t)view->lens.width + (size_t)x;
    struct choice list[MOST_BLENDED + 1];
    const int most = t->how->texture_pictures + 1;
    int n = 0;
    view->source[i] = view->inverse_z[i] < 0 ? SOURCE_UNSEEN : SOURCE_SEEN;
    if (view->inverse_z[i] < 0)
        return;
    const struct shaded s = shaded_point(t, x, y, view->inverse_z[i]);
    for (int k = -1; k < count; k++) {
        struct choice one = {.picture = k < 0 ? view->first[i] : pictures[k]};
        if (k >= 0 && one.picture == view->first[i])
            continue;
        const struct surround_picture *p = t->pictures[one.picture];
        if (n == most && costs_more(t, p, &s, list[most - 1].cost))
            continue;
        float camera[3];
        one.at.distance = surround_picture_distance(p, s.world, camera);
        one.cost = cost_of(t, p, &s, one.at.distance);
        if (n == most && list[most - 1].cost <= one.cost) // what follows only adds to the cost
            continue;
        if (!surround_picture_find(p, camera, &one.at))
            continue;
        const float seen = share_seen(p, &one.at, 0.04f);
        if (seen < 0.5f) // by what made the geometry, as a last resort
            one.cost += k < 0 ? 100 : COST_HIDDEN;
        else
            one.cost += 0.3f * (1 - seen);
        if (one.cost < COST_HIDDEN)
            insert(list, &n, most, &one);
    }
    while (n > 1 && list[n - 1].cost >= 100)
        n--;
    if (n)
        blend(t, list, n, view->rgb + 3 * i);
    else
        view->source[i] = SOURCE_UNSEEN;
}

// Grey with slanting stripes: not to be taken for a picture.
static void hatch(struct surround_view *view)
{
    for (int y = 0; y < view->lens.height; y++)
        for (int x = 0; x < view->lens.width; x++) {
            const size_t i = (size_t)y * (size_t)view->lens.width + (size_t)x;
            if (view->source[i] == SOURCE_UNSEEN)
                memset(view->rgb + 3 * i, (x + y) / 6 % 2 ? 96 : 128, 3);
        }
}

enum status view_texture(struct surround_view *view, const struct surround_picture *const *pictures, int count,
                         const struct view_options *how)
{
    struct texture t = {view, pictures, count, how, (float)(1 / view->lens.fx)};
    for (int y0 = 0; y0 < view->lens.height; y0 += TILE)
        for (int x0 = 0; x0 < view->lens.width; x0 += TILE) {
            int chosen[2 * TILE_PICTURES];
            const int n = tile_pictures(&t, x0, y0, chosen);
            for (int y = y0; y < y0 + TILE && y < view->lens.height; y++)
                for (int x = x0; x < x0 + TILE && x < view->lens.width; x++)
                    shade(&t, x, y, chosen, n);
        }
    hatch(view);
    return OK;
}
