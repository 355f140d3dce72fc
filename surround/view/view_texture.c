// View-dependent texture: each pixel's colour from the pictures that saw its point from the smallest angle, sharp and
// unoccluded, blended so that weights fade out before a picture leaves the blend (Buehler et al. 2001, unstructured
// lumigraph rendering, section 4).
#include "surround/view/view_layers.h"

#include "base/clamp.h"
#include "surround/picture/picture_lanes.h"

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

// Four points of the surface with the ways from them to the view; of lanes without a point the numbers mean nothing.
struct shaded {
    four_doubles world[3];
    four to_view[3], distance2; // metres, squared
    four pixel_m;               // size of the view's pixel there
    four_ints known;            // has a point
};

static void shade_points(const struct texture *t, const int at[4][2], struct shaded *s)
{
    const struct vec3 *v = &t->view->world_from_view.translation;
    for (int l = 0; l < 4; l++) {
        const float inverse_z = t->view->inverse_z[(size_t)at[l][1] * (size_t)t->view->lens.width + (size_t)at[l][0]];
        double world[3];
        s->known[l] = -(inverse_z >= 0);
        surround_view_point(t->view, at[l][0], at[l][1], inverse_z, world);
        for (int i = 0; i < 3; i++)
            s->world[i][l] = world[i];
    }
    s->to_view[0] = __builtin_convertvector(v->x - s->world[0], four);
    s->to_view[1] = __builtin_convertvector(v->y - s->world[1], four);
    s->to_view[2] = __builtin_convertvector(v->z - s->world[2], four);
    s->distance2 = s->to_view[0] * s->to_view[0] + s->to_view[1] * s->to_view[1] + s->to_view[2] * s->to_view[2];
    s->pixel_m = t->pixel_angle * four_sqrt(s->distance2) + 1e-9f;
}

static float angle_of_pixel(const struct surround_picture *p)
{
    return p->panorama ? 6.2831853f / (float)p->width : (float)(1 / p->lens.fx);
}

// Of the ways to the view and to a picture: their product's length squared, their dot product, the latter's length
// squared.
struct ways {
    four across2, along, length2;
};

static struct ways compare_ways(const struct shaded *s, const struct surround_picture *p)
{
    const struct vec3 *c = &p->world_from_camera.translation;
    const four *a = s->to_view;
    const four b[3] = {__builtin_convertvector(c->x - s->world[0], four),
                       __builtin_convertvector(c->y - s->world[1], four),
                       __builtin_convertvector(c->z - s->world[2], four)};
    const four cross[3] = {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
    return (struct ways){cross[0] * cross[0] + cross[1] * cross[1] + cross[2] * cross[2],
                         a[0] * b[0] + a[1] * b[1] + a[2] * b[2], b[0] * b[0] + b[1] * b[1] + b[2] * b[2]};
}

// What is lost where a picture's pixel is `coarse` of the view's.
static four cost_of_coarse(four coarse)
{
    return (float)VIEW_RESOLUTION_COST * FOUR_SELECT(coarse > 0.5f, coarse - 0.5f, FOUR(0.0f));
}

// Angle between the view's and the picture's ray, and resolution short of the view's, in radians.
static four cost_of(const struct surround_picture *p, const struct shaded *s, const struct ways *w, four distance)
{
    const four angle = four_atan2(four_sqrt(w->across2), w->along);
    return angle + cost_of_coarse(angle_of_pixel(p) * distance / s->pixel_m);
}

// Whether cost_of surely is `limit` or more, from bounds that cost less: an angle is larger than its sine. The slack is
// for rounding and for four_atan2's error of 1e-5.
static four_ints costs_more(const struct surround_picture *p, const struct shaded *s, const struct ways *w, four limit)
{
    const four coarse = angle_of_pixel(p) * four_sqrt(w->length2) / s->pixel_m * 0.9999f;
    const four left = limit + 1e-4f - cost_of_coarse(coarse);
    return (left <= 0) | ((w->along < 0) & (left < 1.5f)) |
           (w->across2 > left * left * s->distance2 * w->length2 * 1.0001f);
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
    const int u = floor_of(at->u), v = floor_of(at->v);
    const float fu = at->u - (float)u, fv = at->v - (float)v, wanted = 1 / at->distance;
    float sum = 0;
    for (int k = 0; k < 4; k++) {
        const int x = clamp_int(surround_picture_column(p, u + (k & 1)), 0, p->width - 1);
        const int y = clamp_int(v + (k >> 1), 0, p->height - 1);
        const float inverse = p->inverse[(size_t)y * (size_t)p->width + (size_t)x];
        if (fabsf(inverse - wanted) <= apart * wanted + 2e-4f)
            sum += (k & 1 ? fu : 1 - fu) * (k >> 1 ? fv : 1 - fv);
    }
    return sum;
}

// The best pictures for each of four points.
static void best_pictures(const struct texture *t, const int at[4][2], struct choice list[4][TILE_PICTURES],
                          int count[4])
{
    struct shaded s;
    shade_points(t, at, &s);
    memset(count, 0, 4 * sizeof *count);
    for (int i = 0; i < t->count && four_any(s.known); i++) {
        const struct surround_picture *p = t->pictures[i];
        struct four_points where;
        four camera[3];
        surround_picture_distances(p, s.world, camera, &where);
        surround_picture_find_four(p, camera, &where);
        const struct ways ways = compare_ways(&s, p);
        const four cost = cost_of(p, &s, &ways, where.distance);
        for (int l = 0; l < 4; l++) {
            struct choice one = {i, cost[l], {where.u[l], where.v[l], where.distance[l]}};
            if (!s.known[l] || !where.inside[l])
                continue;
            if (picture_sight(p, &one.at, 0.05f) != SIGHT_SEEN)
                one.cost += 10;
            insert(list[l], &count[l], TILE_PICTURES, &one);
        }
    }
}

// The pictures that may serve a tile: the best for any of five of its pixels.
static int tile_pictures(const struct texture *t, int x0, int y0, int out[])
{
    const int w = t->view->lens.width, h = t->view->lens.height;
    const int x1 = x0 + TILE - 1 < w ? x0 + TILE - 1 : w - 1, y1 = y0 + TILE - 1 < h ? y0 + TILE - 1 : h - 1;
    const int at[5][2] = {{(x0 + x1) / 2, (y0 + y1) / 2}, {x0, y0}, {x1, y0}, {x0, y1}, {x1, y1}};
    bool taken[SURROUND_MOST_LAYERS * 4] = {0};
    struct choice list[8][TILE_PICTURES];
    int n[8], count = 0;
    best_pictures(t, at, list, n);
    best_pictures(t, (const int[4][2]){{x1, y1}, {x1, y1}, {x1, y1}, {x1, y1}}, list + 4, n + 4);
    for (int k = 0; k < 5; k++)
        for (int i = 0; i < n[k]; i++)
            if (!taken[list[k][i].picture] && count < 2 * TILE_PICTURES) {
                taken[list[k][i].picture] = true;
                out[count++] = list[k][i].picture;
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

// Four pixels of a row with the pictures chosen for each so far.
struct shading {
    struct shaded points;
    struct choice list[4][MOST_BLENDED + 1];
    int count[4];
    four limit; // a picture that costs as much is not chosen
};

// Whether a picture is among the best of the lanes asked. last_resort: it made the geometry.
static void ask(const struct texture *t, struct shading *s, int picture, four_ints asked, bool last_resort)
{
    const struct surround_picture *p = t->pictures[picture];
    const struct ways ways = compare_ways(&s->points, p);
    const int most = t->how->texture_pictures + 1;
    struct four_points at;
    four camera[3];
    asked &= ~costs_more(p, &s->points, &ways, s->limit);
    if (!four_any(asked))
        return;
    surround_picture_distances(p, s->points.world, camera, &at);
    const four cost = cost_of(p, &s->points, &ways, at.distance);
    asked &= cost < s->limit; // what follows only adds to the cost
    if (!four_any(asked))
        return;
    surround_picture_find_four(p, camera, &at);
    asked &= at.inside;
    for (int l = 0; l < 4; l++) {
        struct choice one = {picture, cost[l], {at.u[l], at.v[l], at.distance[l]}};
        if (!asked[l])
            continue;
        const float seen = share_seen(p, &one.at, 0.04f);
        if (seen < 0.5f) // by what made the geometry, as a last resort
            one.cost += last_resort ? 100 : COST_HIDDEN;
        else
            one.cost += 0.3f * (1 - seen);
        if (one.cost < COST_HIDDEN)
            insert(s->list[l], &s->count[l], most, &one);
        if (s->count[l] == most)
            s->limit[l] = s->list[l][most - 1].cost;
    }
}

// Pixels x to x + 3 of a row, of those beyond `end` none.
static void shade(const struct texture *t, int x, int end, int y, const int *pictures, int count)
{
    struct surround_view *view = t->view;
    const size_t row = (size_t)y * (size_t)view->lens.width;
    struct shading s = {.limit = FOUR(COST_HIDDEN)};
    int at[4][2];
    four_ints first;
    for (int l = 0; l < 4; l++) {
        at[l][0] = x + l < end ? x + l : end - 1;
        at[l][1] = y;
        first[l] = view->first[row + (size_t)at[l][0]];
    }
    shade_points(t, (const int(*)[2])at, &s.points);
    four_ints left = s.points.known;
    for (int l = 0; l < 4; l++)
        if (left[l]) {
            const four_ints same = left & (first == first[l]);
            ask(t, &s, first[l], same, true);
            left &= ~same;
        }
    for (int k = 0; k < count && four_any(s.points.known); k++)
        ask(t, &s, pictures[k], s.points.known & (first != pictures[k]), false);
    for (int l = 0; l < 4 && x + l < end; l++) {
        const size_t i = row + (size_t)(x + l);
        int n = s.count[l];
        while (n > 1 && s.list[l][n - 1].cost >= 100)
            n--;
        view->source[i] = n ? SOURCE_SEEN : SOURCE_UNSEEN;
        if (n)
            blend(t, s.list[l], n, view->rgb + 3 * i);
    }
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
            const int end = x0 + TILE < view->lens.width ? x0 + TILE : view->lens.width;
            for (int y = y0; y < y0 + TILE && y < view->lens.height; y++)
                for (int x = x0; x < end; x += 4)
                    shade(&t, x, end, y, chosen, n);
        }
    hatch(view);
    return OK;
}
