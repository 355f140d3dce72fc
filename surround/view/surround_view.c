#include "surround/view/surround_view.h"

#include "base/clamp.h"
#include "base/memory.h"
#include "surround/picture/picture_lanes.h"
#include "surround/view/view_layers.h"

#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- view splat

// The plain coloured point cloud.

static void splat_pixel(struct surround_view *view, const struct surround_picture *picture, int u, int v)
{
    const size_t i = (size_t)v * (size_t)picture->width + (size_t)u;
    const struct vec3 c = picture->world_from_camera.translation, e = view->world_from_view.translation;
    float ray[3];
    double q[3], d[3];
    if (!(picture->inverse[i] > 1e-4f))
        return;
    surround_picture_ray(picture, u, v, ray);
    for (int k = 0; k < 3; k++)
        d[k] = (picture->axes[k][0] * (double)ray[0] + picture->axes[k][1] * (double)ray[1] +
                picture->axes[k][2] * (double)ray[2]) /
               (double)picture->inverse[i];
    const double w[3] = {d[0] + c.x - e.x, d[1] + c.y - e.y, d[2] + c.z - e.z};
    for (int k = 0; k < 3; k++)
        q[k] = view->axes[0][k] * w[0] + view->axes[1][k] * w[1] + view->axes[2][k] * w[2];
    if (q[2] < 0.05)
        return;
    const double fx = view->lens.fx * q[0] / q[2] + view->lens.cx, fy = view->lens.fy * q[1] / q[2] + view->lens.cy;
    if (!(fx > -1 && fy > -1 && fx < view->lens.width && fy < view->lens.height))
        return;
    const int x = (int)floor(fx), y = (int)floor(fy);
    for (int k = 0; k < 4; k++) {
        const int px = x + (k & 1), py = y + (k >> 1);
        if (px < 0 || py < 0 || px >= view->lens.width || py >= view->lens.height)
            continue;
        const size_t at = (size_t)py * (size_t)view->lens.width + (size_t)px;
        if (view->inverse_z[at] >= (float)(1 / q[2]))
            continue;
        view->inverse_z[at] = (float)(1 / q[2]);
        view->source[at] = SOURCE_SEEN;
        memcpy(view->rgb + 3 * at, picture->rgb + 3 * i, 3);
    }
}

void surround_view_splat(struct surround_view *view, struct pose world_from_view,
                         const struct surround_picture *const *pictures, int count)
{
    const size_t pixels = (size_t)view->lens.width * (size_t)view->lens.height;
    view->world_from_view = world_from_view;
    quat_to_matrix(world_from_view.rotation, view->axes);
    memset(view->rgb, 128, pixels * 3);
    memset(view->source, SOURCE_UNSEEN, pixels);
    for (size_t i = 0; i < pixels; i++)
        view->inverse_z[i] = DEPTH_UNKNOWN;
    for (int i = 0; i < count; i++)
        for (int v = 0; v < pictures[i]->height; v++)
            for (int u = 0; u < pictures[i]->width; u++)
                splat_pixel(view, pictures[i], u, v);
}

// ---------------------------------------------------------------- view texture

// View-dependent texture: each pixel's colour from the pictures that saw its point from the smallest angle, sharp and
// unoccluded, blended so that weights fade out before a picture leaves the blend (Buehler et al. 2001, unstructured
// lumigraph rendering, section 4).

enum { TILE = 16, TILE_PICTURES = 8, MAX_BLENDED = 4 };
#define COST_HIDDEN 1e9f

struct texture {
    struct surround_view *view;
    const struct surround_picture *const *pictures;
    int count;
    const struct view_options *options;
    float pixel_angle; // of the view, radians
};

// Four points of the surface with the ways from them to the view; of lanes without a point the numbers mean nothing.
struct shaded {
    four_doubles world[3];
    four to_view[3], distance2; // metres, squared
    four pixel_m;               // size of the view's pixel there
    four_ints known;            // has a point
};

static void shade_points(const struct texture *texture, const int at[4][2], struct shaded *shaded)
{
    const struct vec3 *v = &texture->view->world_from_view.translation;
    for (int l = 0; l < 4; l++) {
        const float inverse_z =
            texture->view->inverse_z[(size_t)at[l][1] * (size_t)texture->view->lens.width + (size_t)at[l][0]];
        double world[3];
        shaded->known[l] = -(inverse_z >= 0);
        surround_view_point(texture->view, at[l][0], at[l][1], inverse_z, world);
        for (int i = 0; i < 3; i++)
            shaded->world[i][l] = world[i];
    }
    shaded->to_view[0] = __builtin_convertvector(v->x - shaded->world[0], four);
    shaded->to_view[1] = __builtin_convertvector(v->y - shaded->world[1], four);
    shaded->to_view[2] = __builtin_convertvector(v->z - shaded->world[2], four);
    shaded->distance2 = shaded->to_view[0] * shaded->to_view[0] + shaded->to_view[1] * shaded->to_view[1] +
                        shaded->to_view[2] * shaded->to_view[2];
    shaded->pixel_m = texture->pixel_angle * four_sqrt(shaded->distance2) + 1e-9f;
}

static float angle_of_pixel(const struct surround_picture *picture)
{
    return picture->panorama ? 6.2831853f / (float)picture->width : (float)(1 / picture->lens.fx);
}

// Of the ways to the view and to a picture: their product's length squared, their dot product, the latter's length
// squared.
struct ways {
    four across2, along, length2;
};

static struct ways compare_ways(const struct shaded *shaded, const struct surround_picture *picture)
{
    const struct vec3 *c = &picture->world_from_camera.translation;
    const four *a = shaded->to_view;
    const four b[3] = {__builtin_convertvector(c->x - shaded->world[0], four),
                       __builtin_convertvector(c->y - shaded->world[1], four),
                       __builtin_convertvector(c->z - shaded->world[2], four)};
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
static four cost_of(const struct surround_picture *picture, const struct shaded *shaded, const struct ways *ways,
                    four distance)
{
    const four angle = four_atan2(four_sqrt(ways->across2), ways->along);
    return angle + cost_of_coarse(angle_of_pixel(picture) * distance / shaded->pixel_m);
}

// Whether cost_of surely is `limit` or more, from bounds that cost less: an angle is larger than its sine. The slack is
// for rounding and for four_atan2's error of 1e-5.
static four_ints costs_more(const struct surround_picture *picture, const struct shaded *shaded,
                            const struct ways *ways, four limit)
{
    const four coarse = angle_of_pixel(picture) * four_sqrt(ways->length2) / shaded->pixel_m * 0.9999f;
    const four left = limit + 1e-4f - cost_of_coarse(coarse);
    return (left <= 0) | ((ways->along < 0) & (left < 1.5f)) |
           (ways->across2 > left * left * shaded->distance2 * ways->length2 * 1.0001f);
}

struct choice {
    int picture;
    float cost;
    struct picture_point at;
};

static void insert_choice(struct choice *list, int *count, int max, const struct choice *one)
{
    if (*count == max && list[max - 1].cost <= one->cost)
        return;
    int at = *count < max ? (*count)++ : max - 1;
    for (; at > 0 && list[at - 1].cost > one->cost; at--)
        list[at] = list[at - 1];
    list[at] = *one;
}

// How much of the 2 x 2 pixels around a point are of the point's surface, 0..1.
static float share_seen(const struct surround_picture *picture, const struct picture_point *at, float apart)
{
    const int u = floor_of(at->u), v = floor_of(at->v);
    const float fu = at->u - (float)u, fv = at->v - (float)v, wanted = 1 / at->distance;
    float sum = 0;
    for (int k = 0; k < 4; k++) {
        const int x = clamp_int(surround_picture_column(picture, u + (k & 1)), 0, picture->width - 1);
        const int y = clamp_int(v + (k >> 1), 0, picture->height - 1);
        const float inverse = picture->inverse[(size_t)y * (size_t)picture->width + (size_t)x];
        if (fabsf(inverse - wanted) <= apart * wanted + 2e-4f)
            sum += (k & 1 ? fu : 1 - fu) * (k >> 1 ? fv : 1 - fv);
    }
    return sum;
}

// The best pictures for each of four points.
static void best_pictures(const struct texture *texture, const int at[4][2], struct choice list[4][TILE_PICTURES],
                          int count[4])
{
    struct shaded s;
    shade_points(texture, at, &s);
    memset(count, 0, 4 * sizeof *count);
    for (int i = 0; i < texture->count && four_any(s.known); i++) {
        const struct surround_picture *p = texture->pictures[i];
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
            insert_choice(list[l], &count[l], TILE_PICTURES, &one);
        }
    }
}

// The pictures that may serve a tile: the best for any of five of its pixels.
static int tile_pictures(const struct texture *texture, int x0, int y0, int out[])
{
    const int w = texture->view->lens.width, h = texture->view->lens.height;
    const int x1 = x0 + TILE - 1 < w ? x0 + TILE - 1 : w - 1, y1 = y0 + TILE - 1 < h ? y0 + TILE - 1 : h - 1;
    const int at[5][2] = {{(x0 + x1) / 2, (y0 + y1) / 2}, {x0, y0}, {x1, y0}, {x0, y1}, {x1, y1}};
    bool taken[SURROUND_MAX_LAYERS * 4] = {0};
    struct choice list[8][TILE_PICTURES];
    int n[8], count = 0;
    best_pictures(texture, at, list, n);
    best_pictures(texture, (const int[4][2]){{x1, y1}, {x1, y1}, {x1, y1}, {x1, y1}}, list + 4, n + 4);
    for (int k = 0; k < 5; k++)
        for (int i = 0; i < n[k]; i++)
            if (!taken[list[k][i].picture] && count < 2 * TILE_PICTURES) {
                taken[list[k][i].picture] = true;
                out[count++] = list[k][i].picture;
            }
    return count;
}

static void blend_pictures(const struct texture *texture, struct choice *list, int count, uint8_t rgb[3])
{
    const int blended = count > texture->options->texture_pictures ? texture->options->texture_pictures : count;
    // The cost at which a picture's weight is 0: that of the next one
    const float end = count > blended ? list[blended].cost : list[blended - 1].cost * 1.5f + 0.02f;
    float sum[3] = {0}, weights = 0;
    for (int i = 0; i < blended; i++) {
        const float fade = 1 - list[i].cost / (end + 1e-6f);
        const float weight = (fade > 0.001f ? fade : 0.001f) / (list[i].cost + 0.02f);
        float color[3];
        surround_picture_sample(texture->pictures[list[i].picture], list[i].at.u, list[i].at.v, color);
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
    struct choice list[4][MAX_BLENDED + 1];
    int count[4];
    four limit; // a picture that costs as much is not chosen
};

// Whether a picture is among the best of the lanes asked. last_resort: it made the geometry.
static void ask_picture(const struct texture *texture, struct shading *shading, int picture, four_ints asked,
                        bool last_resort)
{
    const struct surround_picture *p = texture->pictures[picture];
    const struct ways ways = compare_ways(&shading->points, p);
    const int max = texture->options->texture_pictures + 1;
    struct four_points at;
    four camera[3];
    asked &= ~costs_more(p, &shading->points, &ways, shading->limit);
    if (!four_any(asked))
        return;
    surround_picture_distances(p, shading->points.world, camera, &at);
    const four cost = cost_of(p, &shading->points, &ways, at.distance);
    asked &= cost < shading->limit; // what follows only adds to the cost
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
            insert_choice(shading->list[l], &shading->count[l], max, &one);
        if (shading->count[l] == max)
            shading->limit[l] = shading->list[l][max - 1].cost;
    }
}

// Pixels x to x + 3 of a row, of those beyond `end` none.
static void shade_pixels(const struct texture *texture, int x, int end, int y, const int *pictures, int count)
{
    struct surround_view *view = texture->view;
    const size_t row = (size_t)y * (size_t)view->lens.width;
    struct shading s = {.limit = FOUR(COST_HIDDEN)};
    int at[4][2];
    four_ints first;
    for (int l = 0; l < 4; l++) {
        at[l][0] = x + l < end ? x + l : end - 1;
        at[l][1] = y;
        first[l] = view->first[row + (size_t)at[l][0]];
    }
    shade_points(texture, (const int(*)[2])at, &s.points);
    four_ints left = s.points.known;
    for (int l = 0; l < 4; l++)
        if (left[l]) {
            const four_ints same = left & (first == first[l]);
            ask_picture(texture, &s, first[l], same, true);
            left &= ~same;
        }
    for (int k = 0; k < count && four_any(s.points.known); k++)
        ask_picture(texture, &s, pictures[k], s.points.known & (first != pictures[k]), false);
    for (int l = 0; l < 4 && x + l < end; l++) {
        const size_t i = row + (size_t)(x + l);
        int n = s.count[l];
        while (n > 1 && s.list[l][n - 1].cost >= 100)
            n--;
        view->source[i] = n ? SOURCE_SEEN : SOURCE_UNSEEN;
        if (n)
            blend_pictures(texture, s.list[l], n, view->rgb + 3 * i);
    }
}

// Grey with slanting stripes: not to be taken for a picture.
static void hatch_unseen(struct surround_view *view)
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
                    shade_pixels(&t, x, end, y, chosen, n);
        }
    hatch_unseen(view);
    return OK;
}

// ---------------------------------------------------------------- view warp

// View-dependent geometry: the surface that one picture's depth spans, drawn into a view's depth.

enum { BLOCK = 16 };

struct warp {
    const struct surround_view *view;
    const struct surround_picture *p;
    float *inverse_z;
    float turn[3][3]; // view axes from the picture's
    float shift[3];   // the picture's place in the view's axes
    float fx, fy, cx, cy;
};

struct vertex {
    float x, y, inverse_z; // pixels of the view; 1 / z
    int32_t ahead;         // else the others mean nothing
};

// In units of the ray, so that the infinitely far needs no exception: q = turn ray + inverse shift, 1 / z = inverse /
// q.z
static struct vertex project_ray(const struct warp *warp, const float ray[3], float inverse)
{
    float q[3];
    for (int i = 0; i < 3; i++)
        q[i] = warp->turn[i][0] * ray[0] + warp->turn[i][1] * ray[1] + warp->turn[i][2] * ray[2] +
               inverse * warp->shift[i];
    struct vertex out = {.ahead = q[2] > 1e-4f};
    if (!out.ahead)
        return out;
    const float scale = 1 / q[2];
    out.x = warp->fx * q[0] * scale + warp->cx;
    out.y = warp->fy * q[1] * scale + warp->cy;
    out.inverse_z = inverse * scale;
    return out;
}

// The same of four pixels of a row.
static void project_four(const struct warp *warp, const four ray[3], four inverse, struct vertex out[4])
{
    four q[3];
    for (int i = 0; i < 3; i++)
        q[i] = warp->turn[i][0] * ray[0] + warp->turn[i][1] * ray[1] + warp->turn[i][2] * ray[2] +
               inverse * warp->shift[i];
    const four scale = 1 / q[2];
    const four x = warp->fx * q[0] * scale + warp->cx, y = warp->fy * q[1] * scale + warp->cy,
               inverse_z = inverse * scale;
    const four ahead = (four)(q[2] > 1e-4f);
    // Transposed
    const four xy[2] = {__builtin_shufflevector(x, y, 0, 4, 1, 5), __builtin_shufflevector(x, y, 2, 6, 3, 7)};
    const four za[2] = {__builtin_shufflevector(inverse_z, ahead, 0, 4, 1, 5),
                        __builtin_shufflevector(inverse_z, ahead, 2, 6, 3, 7)};
    for (int k = 0; k < 2; k++) {
        const four first = __builtin_shufflevector(xy[k], za[k], 0, 1, 4, 5);
        const four second = __builtin_shufflevector(xy[k], za[k], 2, 3, 6, 7);
        memcpy(&out[2 * k], &first, sizeof first);
        memcpy(&out[2 * k + 1], &second, sizeof second);
    }
}

// libm's fminf is a call.
static float min_float(float a, float b) { return a < b ? a : b; }
static float max_float(float a, float b) { return a > b ? a : b; }

// The pixels from `low` to `high` that are within the view; none: *first > *last.
static void pixel_span(float low, float high, int size, int *first, int *last)
{
    if (!(high >= 0 && low <= (float)(size - 1))) {
        *first = 0;
        *last = -1;
        return;
    }
    *last = high < (float)(size - 1) ? (int)high : size - 1;
    *first = low > 0 ? (int)low : 0;
    *first += low > (float)*first;
}

static void draw_triangle(const struct warp *warp, const struct vertex *a, const struct vertex *b,
                          const struct vertex *c)
{
    const int width = warp->view->lens.width;
    const float area = (b->x - a->x) * (c->y - a->y) - (b->y - a->y) * (c->x - a->x);
    if (!(area > 1e-8f)) // its back, or nothing
        return;
    int x0, x1, y0, y1;
    pixel_span(min_float(a->x, min_float(b->x, c->x)), max_float(a->x, max_float(b->x, c->x)), width, &x0, &x1);
    pixel_span(min_float(a->y, min_float(b->y, c->y)), max_float(a->y, max_float(b->y, c->y)), warp->view->lens.height,
               &y0, &y1);
    if (x0 > x1 || y0 > y1)
        return;
    const float scale = 1 / area, slack = -1e-4f * area; // neighbours share their edge's pixels
    const float bx = (c->y - a->y) * scale, by = -(c->x - a->x) * scale;
    const float cx = -(b->y - a->y) * scale, cy = (b->x - a->x) * scale;
    for (int y = y0; y <= y1; y++)
        for (int x = x0; x <= x1; x++) {
            const float dx = (float)x - a->x, dy = (float)y - a->y;
            const float wb = bx * dx + by * dy, wc = cx * dx + cy * dy;
            if (wb < slack || wc < slack || wb + wc > 1 - slack)
                continue;
            const float value = a->inverse_z + wb * (b->inverse_z - a->inverse_z) + wc * (c->inverse_z - a->inverse_z);
            float *out = &warp->inverse_z[(size_t)y * (size_t)width + (size_t)x];
            *out = value > *out ? value : *out;
        }
}

static void draw_quad(const struct warp *warp, const struct vertex vertex[4])
{
    if (!vertex[0].ahead || !vertex[1].ahead || !vertex[2].ahead || !vertex[3].ahead)
        return;
    int first, last;
    pixel_span(min_float(min_float(vertex[0].x, vertex[1].x), min_float(vertex[2].x, vertex[3].x)),
               max_float(max_float(vertex[0].x, vertex[1].x), max_float(vertex[2].x, vertex[3].x)),
               warp->view->lens.width, &first, &last);
    if (first > last) // between two columns of pixels
        return;
    pixel_span(min_float(min_float(vertex[0].y, vertex[1].y), min_float(vertex[2].y, vertex[3].y)),
               max_float(max_float(vertex[0].y, vertex[1].y), max_float(vertex[2].y, vertex[3].y)),
               warp->view->lens.height, &first, &last);
    if (first > last)
        return;
    draw_triangle(warp, &vertex[0], &vertex[1], &vertex[2]);
    draw_triangle(warp, &vertex[1], &vertex[3], &vertex[2]);
}

// Where four pixels are not one surface, each covers its own quarter between their centres.
static void draw_quarters(const struct warp *warp, const float rays[4][3], const float inverse[4])
{
    for (int k = 0; k < 4; k++) {
        if (inverse[k] < 0)
            continue;
        struct vertex v[4];
        for (int c = 0; c < 4; c++) {
            // Corner c of the quarter: half way from pixel k towards pixel c's column and row
            const int across = (k & 1) != (c & 1) ? k ^ 1 : k, down = (k >> 1) != (c >> 1) ? k ^ 2 : k;
            float ray[3];
            for (int i = 0; i < 3; i++)
                ray[i] = rays[k][i] + 0.5f * (rays[across][i] - rays[k][i]) + 0.5f * (rays[down][i] - rays[k][i]);
            v[c] = project_ray(warp, ray, inverse[k]);
        }
        draw_quad(warp, v);
    }
}

// A cell that is not one surface.
static void draw_cell(const struct warp *warp, int u, int v)
{
    const struct surround_picture *p = warp->p;
    const int right = u + 1 < p->width ? u + 1 : 0, columns[4] = {u, right, u, right};
    float rays[4][3], inverse[4];
    int known = 0;
    for (int k = 0; k < 4; k++) {
        inverse[k] = p->inverse[(size_t)(v + (k >> 1)) * (size_t)p->width + (size_t)columns[k]];
        known += inverse[k] >= 0;
    }
    if (!known)
        return;
    for (int k = 0; k < 4; k++)
        surround_picture_ray(p, columns[k], v + (k >> 1), rays[k]);
    draw_quarters(warp, (const float(*)[3])rays, inverse);
}

// The pixels of a block with its last column and row, each projected once; then cell by cell. A cell that is joined is
// known.
static void draw_block(const struct warp *warp, int u0, int v0, int u1, int v1)
{
    const struct surround_picture *p = warp->p;
    struct vertex vertices[BLOCK + 1][BLOCK + 4];
    for (int v = v0; v <= v1; v++) {
        const float *row = p->inverse + (size_t)v * (size_t)p->width;
        int u = u0;
        for (; u < u1 && u + 4 <= p->width; u += 4) {
            four rays[3], inverse;
            memcpy(&inverse, row + u, sizeof inverse);
            surround_picture_rays(p, u, v, rays);
            project_four(warp, rays, inverse, &vertices[v - v0][u - u0]);
        }
        for (; u <= u1; u++) {
            const int column = u < p->width ? u : 0;
            float ray[3];
            surround_picture_ray(p, column, v, ray);
            vertices[v - v0][u - u0] = project_ray(warp, ray, row[column]);
        }
    }
    for (int v = v0; v < v1; v++)
        for (int u = u0; u < u1; u++) {
            const struct vertex *above = &vertices[v - v0][u - u0], *below = &vertices[v - v0 + 1][u - u0];
            if (p->joined[(size_t)v * (size_t)p->width + (size_t)u] & JOINED_DIAGONAL)
                draw_quad(warp, (struct vertex[4]){above[0], above[1], below[0], below[1]});
            else
                draw_cell(warp, u, v);
        }
}

// The range of a block's inverse depths; of one without any *nearest is negative.
static void range_of(const struct surround_picture *picture, const int from[2], const int to[2], float *farthest,
                     float *nearest)
{
    four low = FOUR(1e9f), high = FOUR(-1.0f);
    for (int v = from[1]; v <= to[1]; v++) {
        const float *row = picture->inverse + (size_t)v * (size_t)picture->width;
        int u = from[0];
        for (; u + 3 <= to[0] && u + 4 <= picture->width; u += 4) {
            four inverse;
            memcpy(&inverse, row + u, sizeof inverse);
            high = FOUR_SELECT(inverse > high, inverse, high);
            low = FOUR_SELECT((inverse < low) & (inverse >= 0), inverse, low);
        }
        for (; u <= to[0]; u++) {
            const float inverse = row[u < picture->width ? u : 0];
            high[0] = max_float(inverse, high[0]);
            low[0] = inverse >= 0 && inverse < low[0] ? inverse : low[0];
        }
    }
    *farthest = min_float(min_float(low[0], low[1]), min_float(low[2], low[3]));
    *nearest = max_float(max_float(high[0], high[1]), max_float(high[2], high[3]));
}

// Whether a block of pixels may be in sight: not all of its corners, nearest and farthest, beyond one edge of the view.
static bool may_be_seen(const struct warp *warp, int u0, int v0, int u1, int v1)
{
    const struct surround_picture *p = warp->p;
    float farthest, nearest;
    range_of(p, (const int[2]){u0, v0}, (const int[2]){u1, v1}, &farthest, &nearest);
    if (nearest < 0)
        return false;
    int outside[5] = {0};
    const float margin = 0.1f; // the block bulges between its corners
    const float x0 = -(warp->cx + 1) / warp->fx - margin,
                x1 = ((float)warp->view->lens.width - warp->cx) / warp->fx + margin;
    const float y0 = -(warp->cy + 1) / warp->fy - margin,
                y1 = ((float)warp->view->lens.height - warp->cy) / warp->fy + margin;
    for (int k = 0; k < 8; k++) {
        float ray[3], q[3];
        surround_picture_ray(p, (k & 1 ? u1 : u0) % p->width, k & 2 ? v1 : v0, ray);
        for (int i = 0; i < 3; i++)
            q[i] = warp->turn[i][0] * ray[0] + warp->turn[i][1] * ray[1] + warp->turn[i][2] * ray[2] +
                   (k & 4 ? nearest : farthest) * warp->shift[i];
        outside[0] += q[2] < -margin;
        outside[1] += q[0] < x0 * q[2] - margin * (q[2] < 0);
        outside[2] += q[0] > x1 * q[2] + margin * (q[2] < 0);
        outside[3] += q[1] < y0 * q[2] - margin * (q[2] < 0);
        outside[4] += q[1] > y1 * q[2] + margin * (q[2] < 0);
    }
    for (int i = 0; i < 5; i++)
        if (outside[i] == 8)
            return false;
    return true;
}

void view_warp(const struct surround_view *view, const struct surround_picture *picture, float *inverse_z)
{
    struct warp w = {.view = view,
                     .p = picture,
                     .inverse_z = inverse_z,
                     .fx = (float)view->lens.fx,
                     .fy = (float)view->lens.fy,
                     .cx = (float)view->lens.cx,
                     .cy = (float)view->lens.cy};
    const struct vec3 away = v3_sub(picture->world_from_camera.translation, view->world_from_view.translation);
    const double d[3] = {away.x, away.y, away.z};
    for (int i = 0; i < 3; i++) {
        double shift = 0;
        for (int k = 0; k < 3; k++) {
            double sum = 0;
            for (int m = 0; m < 3; m++)
                sum += view->axes[m][i] * picture->axes[m][k];
            w.turn[i][k] = (float)sum;
            shift += view->axes[k][i] * d[k];
        }
        w.shift[i] = (float)shift;
    }
    for (size_t i = 0; i < (size_t)view->lens.width * (size_t)view->lens.height; i++)
        inverse_z[i] = DEPTH_UNKNOWN;
    const int columns =
        picture->panorama ? picture->width : picture->width - 1; // the last column of a panorama joins the first
    for (int v0 = 0; v0 < picture->height - 1; v0 += BLOCK)
        for (int u0 = 0; u0 < columns; u0 += BLOCK) {
            const int v1 = v0 + BLOCK < picture->height - 1 ? v0 + BLOCK : picture->height - 1;
            const int u1 = u0 + BLOCK < columns ? u0 + BLOCK : columns;
            if (!may_be_seen(&w, u0, v0, u1, v1))
                continue;
            draw_block(&w, u0, v0, u1, v1);
        }
}

// ---------------------------------------------------------------- surround view

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
    return fail(ERR_MEMORY, "no memory for a view of the surroundings");
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

enum status surround_view_rank(struct pose world_from_view, const struct surround_picture **pictures, int count)
{
    struct ranked *list = malloc((size_t)(count + 1) * sizeof *list);
    if (!list)
        return fail(ERR_MEMORY, "no memory for a view of the surroundings");
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
        return fail(ERR_MEMORY, "no memory for a view of the surroundings");
    for (int i = 0; i < layers; i++)
        view_warp(view, pictures[i], depth + (size_t)i * pixels);
    view_merge(view, pictures, depth, layers, how);
    free(depth);
    const int max_float = SURROUND_MAX_LAYERS * 4;
    return view_texture(view, pictures, count < max_float ? count : max_float, how);
}
