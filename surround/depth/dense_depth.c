#include "surround/depth/dense_depth.h"

#include "base/memory.h"
#include "surround/depth/depth_seeds.h"
#include "surround/picture/fast_angle.h"
#include "surround/picture/surround_picture.h"

#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- large planes

// Walls, the sides of boxes and the floor as large planes: a picture's seeds vote for upright planes and for heights
// (Hough transform, Duda and Hart 1972, over the normals' azimuth and the distance); each peak is fitted by least
// squares, and the seeds that lie on it take its plane in place of their own, noisier one. Walls that are continued
// beyond what was measured are then straight, and the same from every picture. Pure but for memory.

// Chosen on the rover set: a bin is 3 degrees by 5 cm; fewest seeds and least length of a plane.
enum { AZIMUTHS = 120, DISTANCES = 240, MAX_PLANES = 40, FEWEST_SEEDS = 60, PASSES = 3 };
#define BIN_M   0.05f
#define BIN_RAD (6.2831853f / AZIMUTHS)
#define LONG_M  0.4f
#define APART   0.3f // radians: most between a seed's own normal and the plane's

struct upright_seed {
    float x, y;    // metres, level axes about the camera
    float azimuth; // of the own plane's normal, from the camera; -pi..pi
    float away;    // distance of the own plane
    float weight;
    int seed, bin; // bin: -1: taken
};

struct hough {
    struct depth_seeds *s;
    float level[2][3]; // two level unit vectors
    struct upright_seed *list;
    int count;
    float *votes; // AZIMUTHS * DISTANCES
};

static float dot(const float a[3], const float b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

// Two level axes: across up from the camera's ahead or, looking straight up or down, from its right.
static void set_level(struct hough *hough)
{
    const float *up = hough->s->up;
    const float from[3] = {fabsf(up[2]) < 0.8f ? 0 : 1, 0, fabsf(up[2]) < 0.8f ? 1 : 0};
    const float along = dot(from, up);
    float length = 0;
    for (int k = 0; k < 3; k++) {
        hough->level[0][k] = from[k] - along * up[k];
        length += hough->level[0][k] * hough->level[0][k];
    }
    for (int k = 0; k < 3; k++)
        hough->level[0][k] /= sqrtf(length);
    for (int k = 0; k < 3; k++) {
        const int a = (k + 1) % 3, b = (k + 2) % 3;
        hough->level[1][k] = up[a] * hough->level[0][b] - up[b] * hough->level[0][a];
    }
}

static int bin_of(float azimuth, float away)
{
    const int a = (int)((azimuth + 3.1415927f) / BIN_RAD), d = (int)(away / BIN_M);
    if (d >= DISTANCES)
        return -1;
    return (a >= AZIMUTHS ? 0 : a) * DISTANCES + d;
}

static void add_votes(struct hough *hough)
{
    for (int i = 0; i < hough->s->count; i++) {
        const struct seed *seed = &hough->s->list[i];
        const float size2 = dot(seed->plane, seed->plane), along = dot(seed->plane, hough->s->up);
        if (seed->hidden || !(size2 > 1e-6f) || along * along > 0.25f * size2) // more than 30 degrees from upright
            continue;
        const float x = dot(seed->plane, hough->level[0]), y = dot(seed->plane, hough->level[1]);
        struct upright_seed one = {.x = dot(seed->ray, hough->level[0]) / seed->inverse,
                                   .y = dot(seed->ray, hough->level[1]) / seed->inverse,
                                   .azimuth = fast_atan2(y, x),
                                   .weight = seed->weight,
                                   .seed = i};
        const float flat = sqrtf(x * x + y * y);
        one.away = (x * one.x + y * one.y) / flat; // of an upright plane through the point
        one.bin = one.away > 0 ? bin_of(one.azimuth, one.away) : -1;
        if (one.bin < 0)
            continue;
        hough->votes[one.bin] += one.weight;
        hough->list[hough->count++] = one;
    }
}

// The best 3 x 3 bins' middle; -1: none has votes.
static int best_bin(const float *votes)
{
    int best = -1;
    float max = 0;
    for (int a = 0; a < AZIMUTHS; a++)
        for (int d = 0; d < DISTANCES; d++) {
            float sum = 0;
            for (int i = -1; i <= 1; i++)
                for (int j = d > 0 ? -1 : 0; j <= (d + 1 < DISTANCES ? 1 : 0); j++)
                    sum += votes[(a + i + AZIMUTHS) % AZIMUTHS * DISTANCES + d + j];
            if (sum > max) {
                max = sum;
                best = a * DISTANCES + d;
            }
        }
    return best;
}

static float wrap_angle(float a)
{
    if (a > 3.1415927f)
        return a - 6.2831853f;
    return a < -3.1415927f ? a + 6.2831853f : a;
}

struct line {
    float c, s, away, azimuth; // c x + s y = away
};

static float tolerance_at(const struct upright_seed *seed)
{
    return 0.015f + 0.006f * sqrtf(seed->x * seed->x + seed->y * seed->y);
}

static bool on_line(const struct line *line, const struct upright_seed *seed, float slack)
{
    return seed->bin >= 0 && fabsf(line->c * seed->x + line->s * seed->y - line->away) < slack * tolerance_at(seed) &&
           fabsf(wrap_angle(seed->azimuth - line->azimuth)) < APART;
}

// Total least squares in the plan, over what is near, three times. False: too few or too short.
static bool fit_line(const struct hough *hough, struct line *line)
{
    for (int pass = 0; pass < PASSES; pass++) {
        double w = 0, x = 0, y = 0, xx = 0, xy = 0, yy = 0;
        float min = 1e9f, max = -1e9f;
        int n = 0;
        for (int i = 0; i < hough->count; i++) {
            const struct upright_seed *u = &hough->list[i];
            if (!on_line(line, u, pass ? 1 : 3))
                continue;
            const float along = line->c * u->y - line->s * u->x;
            min = along < min ? along : min;
            max = along > max ? along : max;
            const double k = u->weight;
            w += k, x += k * u->x, y += k * u->y;
            xx += k * u->x * u->x, xy += k * u->x * u->y, yy += k * u->y * u->y;
            n++;
        }
        if (n < FEWEST_SEEDS || max - min < LONG_M)
            return false;
        x /= w, y /= w;
        const double a = xx / w - x * x, b = xy / w - x * y, d = yy / w - y * y;
        // The normal belongs to the smaller eigenvalue
        const double smaller = 0.5 * (a + d) - sqrt(0.25 * (a - d) * (a - d) + b * b);
        double c = b, s = smaller - a;
        if (c * c + s * s < 1e-12)
            c = smaller - d, s = b;
        double length = sqrt(c * c + s * s);
        if (!(length > 0))
            return false;
        if (c * x + s * y < 0)
            length = -length;
        *line = (struct line){(float)(c / length), (float)(s / length), (float)((c * x + s * y) / length), 0};
        line->azimuth = fast_atan2(line->s, line->c);
    }
    return line->away > 0.05f;
}

static void assign_line_plane(struct hough *hough, const struct line *line)
{
    for (int i = 0; i < hough->count; i++) {
        struct upright_seed *u = &hough->list[i];
        if (!on_line(line, u, 1))
            continue;
        struct seed *seed = &hough->s->list[u->seed];
        hough->votes[u->bin] -= u->weight;
        u->bin = -1;
        for (int k = 0; k < 3; k++)
            seed->plane[k] = (line->c * hough->level[0][k] + line->s * hough->level[1][k]) / line->away;
        const float inverse = dot(seed->plane, seed->ray);
        if (inverse > 0.9f * seed->inverse && inverse < 1.1f * seed->inverse)
            seed->inverse = inverse;
    }
}

static bool is_beside(int bin, int other)
{
    const int turns = abs(bin / DISTANCES - other / DISTANCES);
    return (turns <= 1 || turns == AZIMUTHS - 1) && abs(bin % DISTANCES - other % DISTANCES) <= 1;
}

// The mean plane of a bin and those beside it.
static bool start_line(const struct hough *hough, int bin, struct line *line)
{
    float c = 0, s = 0, away = 0, weights = 0;
    for (int pass = 0; pass < 2; pass++) {
        for (int i = 0; i < hough->count; i++) {
            const struct upright_seed *u = &hough->list[i];
            if (u->bin < 0 || !is_beside(bin, u->bin))
                continue;
            const float *plane = hough->s->list[u->seed].plane;
            const float x = dot(plane, hough->level[0]), y = dot(plane, hough->level[1]);
            if (pass) {
                away += u->weight * (c * u->x + s * u->y);
                weights += u->weight;
            } else {
                const float flat = u->weight / sqrtf(x * x + y * y);
                c += flat * x;
                s += flat * y;
            }
        }
        const float length = sqrtf(c * c + s * s);
        if (!(length > 0))
            return false;
        c /= length;
        s /= length;
    }
    *line = (struct line){c, s, away / weights, fast_atan2(s, c)};
    return weights > 0;
}

static void clear_votes(struct hough *hough, int bin)
{
    for (int i = 0; i < hough->count; i++)
        if (hough->list[i].bin >= 0 && is_beside(bin, hough->list[i].bin)) {
            hough->votes[hough->list[i].bin] = 0;
            hough->list[i].bin = -1;
        }
    hough->votes[bin] = 0;
}

// Needs the seeds' planes. ERR_MEMORY.
static enum status large_planes_snap(struct depth_seeds *seeds)
{
    struct hough h = {.s = seeds,
                      .list = malloc(((size_t)seeds->count + 1) * sizeof *h.list),
                      .votes = calloc((size_t)AZIMUTHS * DISTANCES, sizeof *h.votes)};
    if (h.list && h.votes) {
        set_level(&h);
        add_votes(&h);
    }
    const bool good = h.list && h.votes;
    for (int n = 0, bin; good && n < MAX_PLANES && (bin = best_bin(h.votes)) >= 0; n++) {
        struct line line;
        const bool fits = start_line(&h, bin, &line) && fit_line(&h, &line);
        if (fits)
            assign_line_plane(&h, &line);
        else
            clear_votes(&h, bin);
    }
    free(h.list);
    free(h.votes);
    return good ? OK : fail(ERR_MEMORY, "no memory for the planes of a picture");
}

// ---------------------------------------------------------------- dense depth

struct depth_options depth_default_options(void)
{
    return (struct depth_options){
        .upright = true, .sparse = true, .reach = 24, .tolerance = 0.012, .nearest_m = 0.3, .farthest_m = 150};
}

// A pixel of the sky is reached from the top row without an edge, and coloured like the top.
enum { SKY_EDGE = 7, SKY_APART = 60 };
// Most difference of a channel between colours of one thing.
enum { OTHER_COLOR = 40 };
// No segment grows over an edge above this: what has no point of its own beyond it is continued from what stands below
// (a post taller than its points), not taken for what is beside it. The one value that was tried.
enum { MAX_EDGE = 30 };

static int color_distance(const uint8_t *a, const uint8_t *b)
{
    int max = 0;
    for (int c = 0; c < 3; c++) {
        const int d = abs((int)a[c] - (int)b[c]);
        max = d > max ? d : max;
    }
    return max;
}

static void bar_sky(const struct surround_picture *picture, int32_t *label, int32_t *stack)
{
    const int w = picture->width, h = picture->height;
    int n = 0;
    for (int u = 0; u < w; u++)
        stack[n++] = u, label[u] = WATERSHED_BARRED;
    while (n) {
        const int32_t from = stack[--n];
        const int u = from % w, v = from / w;
        for (int k = 0; k < 4; k++) {
            const int x = (u + (k == 0) - (k == 1) + w) % w, y = v + (k == 2) - (k == 3);
            if (y < 0 || y >= h)
                continue;
            const int32_t to = y * w + x;
            const uint8_t *color = picture->rgb + 3 * (size_t)to;
            if (label[to] != WATERSHED_FREE || color_distance(color, picture->rgb + 3 * (size_t)from) > SKY_EDGE ||
                color_distance(color, picture->rgb + 3 * (size_t)x) > SKY_APART)
                continue;
            label[to] = WATERSHED_BARRED;
            stack[n++] = to;
        }
    }
}

static void fill_segments(struct surround_picture *picture, const struct depth_seeds *seeds, const int32_t *label)
{
    for (int v = 0; v < picture->height; v++)
        for (int u = 0; u < picture->width; u++) {
            const size_t i = (size_t)v * (size_t)picture->width + (size_t)u;
            picture->inverse[i] = label[i] == WATERSHED_BARRED ? 0 : DEPTH_UNKNOWN;
            if (label[i] < 0)
                continue;
            const struct seed *seed = &seeds->list[label[i]];
            float ray[3];
            surround_picture_ray(picture, u, v, ray);
            const float inverse = dot(seed->plane, ray);
            picture->inverse[i] =
                inverse > 0.6f * seed->inverse && inverse < 1.6f * seed->inverse ? inverse : seed->inverse;
        }
}

// What stands upright: a plane whose normal is within 25 degrees of level.
static bool is_upright(const struct depth_seeds *seeds, const float plane[3])
{
    const float along = dot(plane, seeds->up);
    return along * along < 0.18f * dot(plane, plane);
}

static bool is_level(const struct depth_seeds *seeds, const float plane[3])
{
    const float along = dot(plane, seeds->up);
    return along * along > 0.8f * dot(plane, plane);
}

// Gives a free pixel a seed's plane, unless that does not meet its ray.
static bool assign_plane(struct surround_picture *picture, const struct depth_seeds *seeds, int32_t *label,
                         size_t pixel, int32_t seed)
{
    float ray[3];
    surround_picture_ray(picture, (int)(pixel % (size_t)picture->width), (int)(pixel / (size_t)picture->width), ray);
    const float inverse = dot(seeds->list[seed].plane, ray);
    if (!(inverse > 1e-4f && inverse < 10))
        return false;
    picture->inverse[pixel] = inverse;
    label[pixel] = seed;
    return true;
}

// The one of two seeds (negative: none) whose plane is the farther along a pixel's ray.
static int32_t farther_seed(const struct surround_picture *picture, const struct depth_seeds *seeds, size_t pixel,
                            int32_t a, int32_t b)
{
    float ray[3];
    if (a < 0 || b < 0)
        return a < 0 ? b : a;
    surround_picture_ray(picture, (int)(pixel % (size_t)picture->width), (int)(pixel / (size_t)picture->width), ray);
    const float x = dot(seeds->list[a].plane, ray), y = dot(seeds->list[b].plane, ray);
    if (x <= 0)
        return b;
    return y <= 0 || x < y ? a : b;
}

// Whether a seed's plane passes behind another's along a pixel's ray.
static bool is_behind(const struct surround_picture *picture, const struct depth_seeds *seeds, size_t pixel, int32_t a,
                      int32_t b)
{
    float ray[3];
    surround_picture_ray(picture, (int)(pixel % (size_t)picture->width), (int)(pixel / (size_t)picture->width), ray);
    const float x = dot(seeds->list[a].plane, ray), y = dot(seeds->list[b].plane, ray);
    return x > 0 && x < 0.92f * y;
}

// Continues a column's surfaces into its unknown pixels. Between two surfaces that both reach a pixel the farther is
// taken: nothing is put in front of what was seen.
static void fill_column(struct surround_picture *picture, const struct depth_seeds *seeds, int32_t *label,
                        const int32_t *segment, int u)
{
    const size_t w = (size_t)picture->width;
    for (int v = picture->height - 1; v >= 0; v--) {
        int32_t *at = label + (size_t)v * w + (size_t)u;
        if (*at != WATERSHED_FREE)
            continue;
        int top = v;
        while (top > 0 && label[(size_t)(top - 1) * w + (size_t)u] == WATERSHED_FREE)
            top--;
        int32_t below = v + 1 < picture->height ? at[w] : WATERSHED_FREE;
        int32_t above = top > 0 ? label[(size_t)(top - 1) * w + (size_t)u] : WATERSHED_FREE;
        if (below >= 0 && above < 0 && !is_upright(seeds, seeds->list[below].plane))
            below = WATERSHED_FREE;
        if (above >= 0 && below < 0 && !is_level(seeds, seeds->list[above].plane))
            above = WATERSHED_FREE;
        for (int y = top; y <= v && (below >= 0 || above >= 0); y++) {
            const size_t pixel = (size_t)y * w + (size_t)u;
            int32_t chosen = farther_seed(picture, seeds, pixel, below, above);
            // Above the top of something low the image has the colour of what stands behind it
            if (above < 0 && segment[pixel] >= 0 &&
                color_distance(picture->rgb + 3 * pixel, picture->rgb + 3 * ((size_t)(v + 1) * w + (size_t)u)) >
                    OTHER_COLOR &&
                is_behind(picture, seeds, pixel, segment[pixel], below))
                chosen = segment[pixel];
            assign_plane(picture, seeds, label, pixel, chosen);
        }
        v = top;
    }
}

// The segments grown over the whole image from what stands upright; WATERSHED_FREE where none reaches. NULL: no memory.
static int32_t *grow_upright(const struct surround_picture *picture, const struct depth_seeds *seeds,
                             const int32_t *label)
{
    const size_t pixels = (size_t)picture->width * (size_t)picture->height;
    int32_t *segment = alloc_cache_aligned(pixels * sizeof *segment);
    for (size_t i = 0; segment && i < pixels; i++)
        segment[i] = label[i] < 0 || is_upright(seeds, seeds->list[label[i]].plane) ? label[i] : WATERSHED_BARRED;
    if (segment && watershed_grow(picture, picture->width / 2, 255, segment) == OK)
        return segment;
    free(segment);
    return NULL;
}

// What is left between two surfaces of a row, or not far beside one.
static void fill_row(struct surround_picture *picture, const struct depth_seeds *seeds, int32_t *label, int v)
{
    const size_t row = (size_t)v * (size_t)picture->width;
    for (int u = 0; u < picture->width; u++) {
        if (label[row + (size_t)u] != WATERSHED_FREE)
            continue;
        int end = u;
        while (end + 1 < picture->width && label[row + (size_t)end + 1] == WATERSHED_FREE)
            end++;
        const int32_t left = u > 0 ? label[row + (size_t)u - 1] : WATERSHED_FREE;
        const int32_t right = end + 1 < picture->width ? label[row + (size_t)end + 1] : WATERSHED_FREE;
        for (int x = u; x <= end && (left >= 0 || right >= 0); x++) {
            const size_t pixel = row + (size_t)x;
            const bool between = left >= 0 && right >= 0;
            const int beside = left >= 0 ? x - u : end - x;
            if (between || beside <= picture->width / 64)
                assign_plane(picture, seeds, label, pixel, farther_seed(picture, seeds, pixel, left, right));
        }
        u = end;
    }
}

// Extrapolates the segments' surfaces into what no segment reaches, and marks it so.
static enum status extrapolate_surfaces(struct surround_picture *picture, const struct depth_seeds *seeds,
                                        int32_t *label)
{
    const size_t pixels = (size_t)picture->width * (size_t)picture->height;
    int32_t *segment = grow_upright(picture, seeds, label);
    bool *reached = malloc(pixels * sizeof *reached);
    if (!segment || !reached) {
        free(segment);
        free(reached);
        return fail(ERR_MEMORY, "no memory for a picture's depth");
    }
    for (size_t i = 0; i < pixels; i++)
        reached[i] = label[i] != WATERSHED_FREE;
    for (int u = 0; u < picture->width; u++)
        fill_column(picture, seeds, label, segment, u);
    free(segment);
    for (int v = 0; v < picture->height; v++)
        fill_row(picture, seeds, label, v);
    surround_picture_join(picture);
    for (size_t i = 0; i < pixels; i++)
        if (!reached[i])
            picture->joined[i] |= DEPTH_EXTRAPOLATED;
    free(reached);
    return OK;
}

static enum status make_depth(struct surround_picture *picture, const struct depth_seeds *seeds,
                              const struct depth_options *options, int32_t *label)
{
    const size_t pixels = (size_t)picture->width * (size_t)picture->height;
    memset(label, 0xff, pixels * sizeof *label);
    if (options->sky && picture->panorama) {
        int32_t *stack = malloc(pixels * sizeof *stack);
        if (!stack)
            return fail(ERR_MEMORY, "no memory for a picture's depth");
        bar_sky(picture, label, stack);
        free(stack);
    }
    for (int i = 0; i < seeds->count; i++)
        if (!seeds->list[i].hidden)
            label[(size_t)seeds->list[i].v * (size_t)picture->width + (size_t)seeds->list[i].u] = i;
    const int reach = picture->panorama ? (options->reach * picture->height + 512) / 1024 : options->reach;
    enum status status = watershed_grow(picture, reach, options->upright ? MAX_EDGE : 255, label);
    if (status != OK)
        return status;
    fill_segments(picture, seeds, label);
    if (options->upright)
        return extrapolate_surfaces(picture, seeds, label);
    surround_picture_join(picture);
    return OK;
}

enum status dense_depth_make(struct surround_picture *picture, const struct world_points *points,
                             const struct depth_options *how)
{
    const size_t pixels = (size_t)picture->width * (size_t)picture->height;
    surround_picture_free_mesh(picture);
    if (!picture->inverse)
        picture->inverse = alloc_cache_aligned(pixels * sizeof *picture->inverse);
    if (!picture->joined)
        picture->joined = alloc_cache_aligned(pixels);
    int32_t *label = alloc_cache_aligned(pixels * sizeof *label);
    struct depth_seeds seeds = {0};
    enum status status =
        picture->inverse && picture->joined && label ? OK : fail(ERR_MEMORY, "no memory for a picture's depth");
    if (status == OK)
        status = depth_seeds_make(&seeds, picture, points, how);
    if (status == OK && how->walls)
        status = large_planes_snap(&seeds);
    if (status == OK)
        status = make_depth(picture, &seeds, how, label);
    depth_seeds_free(&seeds);
    free(label);
    return status;
}
