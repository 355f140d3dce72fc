#include "surround/depth/depth_seeds.h"

#include "base/clamp.h"
#include "base/memory.h"
#include "surround/picture/fast_angle.h"

#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- watershed

enum { LEVELS = 64, STEP = 4 /* parts of a pixel that distances count in */ };

struct flood {
    const struct surround_picture *p;
    int32_t *label, *next;
    uint16_t *distance;
    int32_t head[LEVELS], tail[LEVELS];
    int lowest, highest;
};

static void push_pixel(struct flood *flood, int level, int32_t pixel)
{
    flood->next[pixel] = -1;
    if (flood->head[level] < 0)
        flood->head[level] = pixel;
    else
        flood->next[flood->tail[level]] = pixel;
    flood->tail[level] = pixel;
    if (level < flood->lowest)
        flood->lowest = level;
}

static int edge_between(const uint8_t *rgb, int32_t a, int32_t b)
{
    int max = 0;
    for (int c = 0; c < 3; c++) {
        const int d = abs((int)rgb[3 * (size_t)a + (size_t)c] - (int)rgb[3 * (size_t)b + (size_t)c]);
        max = d > max ? d : max;
    }
    return max;
}

// Noise of a JPEG is no edge: differences below 4 are level 0; above, 3 to a level.
static int level_of(int edge)
{
    const int level = edge < 4 ? 0 : (edge - 1) / 3;
    return level < LEVELS ? level : LEVELS - 1;
}

static void spread_flood(struct flood *flood, int32_t from, int level, int max)
{
    const int w = flood->p->width, h = flood->p->height, u = from % w, v = from / w;
    const int row_step = flood->p->panorama ? (int)(STEP * flood->p->ray_table[2 * (w + v)] + 1)
                                            : STEP; // sine of the angle from the zenith
    for (int k = 0; k < 4; k++) {
        const int x = surround_picture_column(flood->p, u + (k == 0) - (k == 1)), y = v + (k == 2) - (k == 3);
        if (x < 0 || x >= w || y < 0 || y >= h)
            continue;
        const int32_t to = y * w + x;
        if (flood->label[to] != WATERSHED_FREE)
            continue;
        const int distance = flood->distance[from] + (k < 2 ? row_step : STEP);
        if (distance > max)
            continue;
        const int edge = level_of(edge_between(flood->p->rgb, from, to));
        if (edge > flood->highest)
            continue;
        flood->label[to] = flood->label[from];
        flood->distance[to] = (uint16_t)distance;
        push_pixel(flood, edge > level ? edge : level, to);
    }
}

enum status watershed_grow(const struct surround_picture *picture, int reach, int max_edge, int32_t *label)
{
    const size_t pixels = (size_t)picture->width * (size_t)picture->height;
    struct flood f = {.p = picture, .label = label, .lowest = LEVELS, .highest = level_of(max_edge)};
    f.next = malloc(pixels * sizeof *f.next);
    f.distance = calloc(pixels, sizeof *f.distance);
    enum status status = f.next && f.distance ? OK : fail(ERR_MEMORY, "no memory for a picture's segments");
    memset(f.head, 0xff, sizeof f.head);
    for (size_t i = 0; status == OK && i < pixels; i++)
        if (label[i] >= 0)
            push_pixel(&f, 0, (int32_t)i);
    while (status == OK && f.lowest < LEVELS) {
        const int level = f.lowest;
        const int32_t pixel = f.head[level];
        if (pixel < 0) {
            f.lowest++;
            continue;
        }
        f.head[level] = f.next[pixel];
        spread_flood(&f, pixel, level, reach * STEP);
    }
    free(f.next);
    free(f.distance);
    return status;
}

// ---------------------------------------------------------------- point colors

// Chosen by hand. So many nearest pictures are asked, and so many must agree; levels that a channel may differ by.
enum { ASKED = 5, AGREEING = 3, ALIKE_COLOR = 40 };
// A gain is measured over points within this, from so many; the histogram's bins of a ratio, each 1 / PER_ONE.
#define NEAR_M 10.0f
enum { FEWEST = 200, BINS = 256, PER_ONE = 64, DARKEST = 12, BRIGHTEST = 243 };

void point_colors_free(struct point_colors *colors)
{
    free(colors->rgb);
    *colors = (struct point_colors){0};
}

// Points hide each other: the distance of the nearest in each of a picture's coarse cells.
enum { CELLS_ACROSS = 256, CELLS_DOWN = 128 };
#define HIDDEN 1.15f // farther than the cell's nearest by this factor

static float *cell_of(float *nearest, const struct surround_picture *picture, const struct picture_point *at)
{
    int x = (int)((at->u + 0.5f) * CELLS_ACROSS / (float)picture->width);
    int y = (int)((at->v + 0.5f) * CELLS_DOWN / (float)picture->height);
    x = clamp_int(x, 0, CELLS_ACROSS - 1);
    y = clamp_int(y, 0, CELLS_DOWN - 1);
    return &nearest[y * CELLS_ACROSS + x];
}

static void find_nearest(const struct surround_picture *picture, const struct world_points *points, float *nearest)
{
    for (int i = 0; i < CELLS_ACROSS * CELLS_DOWN; i++)
        nearest[i] = 1e9f;
    for (int i = 0; i < points->count; i++) {
        const double world[3] = {points->xyz[i][0], points->xyz[i][1], points->xyz[i][2]};
        struct picture_point at;
        if (!surround_picture_project(picture, world, &at))
            continue;
        float *cell = cell_of(nearest, picture, &at);
        *cell = at.distance < *cell ? at.distance : *cell;
    }
}

static const uint8_t *pixel_at(const struct surround_picture *picture, const struct picture_point *at)
{
    const int u = clamp_int((int)floorf(at->u + 0.5f), 0, picture->width - 1);
    const int v = clamp_int((int)floorf(at->v + 0.5f), 0, picture->height - 1);
    return picture->rgb + 3 * ((size_t)v * (size_t)picture->width + (size_t)u);
}

static bool are_colors_alike(const uint8_t *a, const uint8_t *b)
{
    for (int c = 0; c < 3; c++)
        if (abs((int)a[c] - (int)b[c]) > ALIKE_COLOR)
            return false;
    return true;
}

struct seen_color {
    float distance;
    uint8_t rgb[3];
};

// The colours in the nearest pictures to which no other point hides the point, nearest first; returns how many.
static int ask_pictures(const double world[3], const struct surround_picture *pictures, int count, float *nearest,
                        struct seen_color *out)
{
    int n = 0;
    for (int i = 0; i < count; i++) {
        const struct surround_picture *p = &pictures[i];
        const struct vec3 to = v3_sub(v3(world[0], world[1], world[2]), p->world_from_camera.translation);
        const float distance = (float)v3_length(to);
        struct picture_point at;
        if ((n == ASKED && out[n - 1].distance <= distance) || !surround_picture_project(p, world, &at) ||
            at.distance > HIDDEN * *cell_of(nearest + (size_t)i * CELLS_ACROSS * CELLS_DOWN, p, &at))
            continue;
        int k = n < ASKED ? n++ : n - 1;
        for (; k > 0 && out[k - 1].distance > distance; k--)
            out[k] = out[k - 1];
        out[k].distance = distance;
        const uint8_t *rgb = pixel_at(p, &at);
        for (int c = 0; c < 3; c++) {
            const float value = rgb[c] * p->gain[c];
            out[k].rgb[c] = (uint8_t)(value < 255 ? value : 255);
        }
    }
    return n;
}

// The colour that the most others are like, and of those the one least apart from all.
static void choose_color(const struct seen_color *list, int count, uint8_t rgb[4])
{
    int max = AGREEING, min = 1 << 30;
    memset(rgb, 0, 4);
    for (int i = 0; i < count; i++) {
        int agree = 0, apart = 0;
        for (int k = 0; k < count; k++) {
            agree += are_colors_alike(list[i].rgb, list[k].rgb);
            for (int c = 0; c < 3; c++)
                apart += abs((int)list[i].rgb[c] - (int)list[k].rgb[c]);
        }
        if (agree < max || (agree == max && apart >= min))
            continue;
        max = agree;
        min = apart;
        memcpy(rgb, list[i].rgb, 3);
        rgb[3] = 255;
    }
}

enum status point_colors_make(struct point_colors *colors, const struct world_points *points,
                              const struct surround_picture *pictures, int count)
{
    const size_t wanted = (size_t)points->count;
    if (wanted + 1 > colors->capacity) {
        uint8_t(*rgb)[4] = realloc(colors->rgb, (wanted + wanted / 4 + 1) * sizeof *rgb);
        if (!rgb)
            return fail(ERR_MEMORY, "no memory for the points' colours");
        colors->rgb = rgb;
        colors->capacity = wanted + wanted / 4 + 1;
    }
    float *nearest = malloc(((size_t)count * CELLS_ACROSS * CELLS_DOWN + 1) * sizeof *nearest);
    if (!nearest)
        return fail(ERR_MEMORY, "no memory for the points' colours");
    for (int i = 0; i < count; i++)
        find_nearest(&pictures[i], points, nearest + (size_t)i * CELLS_ACROSS * CELLS_DOWN);
    for (int i = 0; i < points->count; i++) {
        const double world[3] = {points->xyz[i][0], points->xyz[i][1], points->xyz[i][2]};
        struct seen_color list[ASKED];
        choose_color(list, ask_pictures(world, pictures, count, nearest, list), colors->rgb[i]);
    }
    free(nearest);
    return OK;
}

// What a picture's colours are to be multiplied by to be like the points' (its exposure): the median over the points
// within a few metres, which it mostly sees.
static void point_colors_gain(const struct surround_picture *picture, const struct world_points *points, float gain[3])
{
    int histogram[3][BINS] = {{0}}, n = 0;
    for (int i = 0; i < points->count; i++) {
        const double world[3] = {points->xyz[i][0], points->xyz[i][1], points->xyz[i][2]};
        const uint8_t *rgb = points->rgb[i];
        struct picture_point at;
        if (!rgb[3] || !surround_picture_project(picture, world, &at) || at.distance > NEAR_M)
            continue;
        const uint8_t *pixel = pixel_at(picture, &at);
        bool usable = true;
        for (int c = 0; c < 3; c++)
            usable = usable && pixel[c] > DARKEST && pixel[c] < BRIGHTEST && rgb[c] > DARKEST && rgb[c] < BRIGHTEST;
        if (!usable)
            continue;
        for (int c = 0; c < 3; c++) {
            const int bin = (int)(PER_ONE * (float)rgb[c] / (float)pixel[c]);
            histogram[c][bin < BINS ? bin : BINS - 1]++;
        }
        n++;
    }
    for (int c = 0; c < 3; c++) {
        int bin = 0;
        for (int sum = histogram[c][0]; 2 * sum < n && bin + 1 < BINS;)
            sum += histogram[c][++bin];
        gain[c] = n < FEWEST ? picture->gain[c] : ((float)bin + 0.5f) / PER_ONE;
    }
}

// Whether any of the 3 x 3 pixels around (u, v), times gain, has a point's colour. Of a point without one: true.
static bool point_color_agrees(const struct surround_picture *picture, int u, int v, const float gain[3],
                               const uint8_t rgb[4])
{
    if (!rgb[3])
        return true;
    for (int k = 0; k < 9; k++) {
        const int x = surround_picture_column(picture, u + k % 3 - 1), y = v + k / 3 - 1;
        if (x < 0 || x >= picture->width || y < 0 || y >= picture->height)
            continue;
        const uint8_t *pixel = picture->rgb + 3 * ((size_t)y * (size_t)picture->width + (size_t)x);
        bool agrees = true;
        for (int c = 0; c < 3 && agrees; c++) {
            const float value = pixel[c] * gain[c];
            agrees = fabsf((value < 255 ? value : 255) - rgb[c]) <= ALIKE_COLOR;
        }
        if (agrees)
            return true;
    }
    return false;
}

// ---------------------------------------------------------------- depth seeds

enum { NEIGHBOURS = 40, ENOUGH = 14, WIDEST = 20, TRIPLES = 8 };
// For what hides a point: a wider window, since the near surface may be the sparser one. Of 20 to 400 seeds in it, 50
// made the small world's silhouettes best; wider ones hide what stands beside.
enum { HIDING_NEIGHBOURS = 160, HIDING_ENOUGH = 50, ALIKE = 40 /* most difference of a colour's channel */ };

// Points within this share of a pixel's nearest are one surface and are averaged: the nearest alone of many noisy ones
// would be too near.
#define ONE_SURFACE 0.04f

static void add_point(struct seed *seed, const struct seed *one)
{
    if (seed->weight > 0 && one->inverse < seed->inverse * (1 - ONE_SURFACE))
        return;
    if (seed->weight <= 0 || one->inverse > seed->inverse * (1 + ONE_SURFACE)) {
        *seed = *one;
        return;
    }
    seed->weight += one->weight;
    const float share = one->weight / seed->weight;
    for (int k = 0; k < 3; k++)
        seed->ray[k] += share * (one->ray[k] - seed->ray[k]);
    seed->inverse += share * (one->inverse - seed->inverse);
}

static void project_points(struct depth_seeds *seeds, const struct surround_picture *picture,
                           const struct world_points *points, const struct depth_options *options)
{
    const struct vec3 t = picture->world_from_camera.translation;
    float gain[3] = {1, 1, 1};
    if (points->rgb)
        point_colors_gain(picture, points, gain);
    for (int i = 0; i < points->count; i++) {
        const double world[3] = {points->xyz[i][0], points->xyz[i][1], points->xyz[i][2]};
        struct picture_point at;
        if (!surround_picture_project(picture, world, &at) ||
            !(at.distance > options->nearest_m && at.distance < options->farthest_m))
            continue;
        const int u = (int)floorf(at.u + 0.5f), v = (int)floorf(at.v + 0.5f);
        if (u < 0 || v < 0 || u >= picture->width || v >= picture->height ||
            (points->rgb && !point_color_agrees(picture, u, v, gain, points->rgb[i])))
            continue;
        int32_t *slot = &seeds->at[(size_t)v * (size_t)picture->width + (size_t)u];
        if (*slot < 0) {
            *slot = seeds->count++;
            seeds->list[*slot].weight = 0;
        }
        struct seed one = {
            .u = u, .v = v, .inverse = 1 / at.distance, .weight = points->weight ? points->weight[i] : 1};
        const double d[3] = {world[0] - t.x, world[1] - t.y, world[2] - t.z};
        for (int k = 0; k < 3; k++)
            one.ray[k] = (float)(picture->axes[0][k] * d[0] + picture->axes[1][k] * d[1] + picture->axes[2][k] * d[2]) *
                         one.inverse;
        add_point(&seeds->list[*slot], &one);
    }
    for (int i = 0; i < seeds->count; i++)
        seeds->list[i].weight = sqrtf(seeds->list[i].weight);
}

static void sum_area(struct depth_seeds *seeds, int width, int height)
{
    memset(seeds->before, 0, ((size_t)width + 1) * sizeof *seeds->before);
    for (int v = 0; v < height; v++) {
        const int32_t *above = seeds->before + (size_t)v * (size_t)(width + 1);
        int32_t *row = seeds->before + (size_t)(v + 1) * (size_t)(width + 1), sum = 0;
        row[0] = 0;
        for (int u = 0; u < width; u++) {
            sum += seeds->at[(size_t)v * (size_t)width + (size_t)u] >= 0;
            row[u + 1] = above[u + 1] + sum;
        }
    }
}

struct window {
    int u0, u1, v0, v1;
};

// Around a pixel, as wide as needed for `enough` seeds; near a panorama's poles wider than tall.
static struct window window_of(const struct depth_seeds *seeds, const struct surround_picture *picture, int u, int v,
                               int enough)
{
    struct window w = {0};
    for (int r = 2; r <= WIDEST; r += r < 6 ? 1 : 3) {
        int across = r;
        if (picture->panorama) {
            const float sine = picture->ray_table[2 * (picture->width + v)];
            across = (int)((float)r / (sine > 0.2f ? sine : 0.2f));
        }
        w = (struct window){u - across < 0 ? 0 : u - across,
                            u + across >= picture->width ? picture->width - 1 : u + across, v - r < 0 ? 0 : v - r,
                            v + r >= picture->height ? picture->height - 1 : v + r};
        const size_t line = (size_t)picture->width + 1;
        const int32_t *top = seeds->before + (size_t)w.v0 * line, *bottom = seeds->before + (size_t)(w.v1 + 1) * line;
        if (bottom[w.u1 + 1] - bottom[w.u0] - top[w.u1 + 1] + top[w.u0] >= enough)
            break;
    }
    return w;
}

static int gather_seeds(const struct depth_seeds *seeds, const struct surround_picture *picture,
                        const struct window *window, int max, int *out)
{
    int n = 0;
    for (int v = window->v0; v <= window->v1; v++)
        for (int u = window->u0; u <= window->u1; u++) {
            const int32_t i = seeds->at[(size_t)v * (size_t)picture->width + (size_t)u];
            if (i >= 0 && n < max)
                out[n++] = i;
        }
    return n;
}

#define OWN_APART 2.5f // a point may be so many tolerances off its own plane, if its neighbours say so

static float dot(const float a[3], const float b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

// x of m x = b by Cramer's rule; false: singular.
static bool solve_linear(const double m[3][3], const double b[3], float x[3])
{
    double minor[3][3];
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            const int a = (i + 1) % 3, c = (i + 2) % 3, d = (j + 1) % 3, e = (j + 2) % 3;
            minor[i][j] = m[a][d] * m[c][e] - m[a][e] * m[c][d];
        }
    const double det = m[0][0] * minor[0][0] + m[0][1] * minor[0][1] + m[0][2] * minor[0][2];
    if (!(fabs(det) > 1e-14))
        return false;
    for (int j = 0; j < 3; j++)
        x[j] = (float)((minor[0][j] * b[0] + minor[1][j] * b[1] + minor[2][j] * b[2]) / det);
    return true;
}

// The seeds about one that its plane is fitted to, with their weights.
struct neighbours {
    int at[NEIGHBOURS], count;
    float weight[NEIGHBOURS];
};

// A seed of another colour may be of another surface, and at the edge of a thin one most are: together they would have
// a plane that joins both. The one value that was tried.
#define OTHER_COLOR 0.25f

static void find_neighbours(const struct depth_seeds *seeds, const struct surround_picture *picture,
                            const struct seed *seed, struct neighbours *out)
{
    const struct window w = window_of(seeds, picture, seed->u, seed->v, ENOUGH);
    const uint8_t *own = picture->rgb + 3 * ((size_t)seed->v * (size_t)picture->width + (size_t)seed->u);
    out->count = gather_seeds(seeds, picture, &w, NEIGHBOURS, out->at);
    for (int i = 0; i < out->count; i++) {
        const struct seed *o = &seeds->list[out->at[i]];
        const uint8_t *rgb = picture->rgb + 3 * ((size_t)o->v * (size_t)picture->width + (size_t)o->u);
        bool other = false;
        for (int c = 0; c < 3; c++)
            other |= abs((int)own[c] - (int)rgb[c]) > ALIKE;
        out->weight[i] = other && seeds->sparse ? OTHER_COLOR * o->weight : o->weight;
    }
}

static float plane_support(const struct depth_seeds *seeds, const struct neighbours *near, const float plane[3],
                           float tolerance)
{
    float sum = 0;
    for (int i = 0; i < near->count; i++) {
        const struct seed *seed = &seeds->list[near->at[i]];
        const float e = (dot(plane, seed->ray) - seed->inverse) / (tolerance * seed->inverse);
        sum += e * e < 1 ? (1 - e * e) * near->weight[i] : 0;
    }
    return sum;
}

static bool plane_of_three(const struct seed *a, const struct seed *b, const struct seed *c, float plane[3])
{
    double m[3][3], w[3] = {a->inverse, b->inverse, c->inverse};
    for (int k = 0; k < 3; k++) {
        m[0][k] = a->ray[k];
        m[1][k] = b->ray[k];
        m[2][k] = c->ray[k];
    }
    return solve_linear((const double(*)[3])m, w, plane);
}

// Least squares over those within the tolerance, twice; a weak pull towards the plane given keeps it regular.
static void polish_plane(const struct depth_seeds *seeds, const struct neighbours *near, float tolerance,
                         float plane[3])
{
    for (int pass = 0; pass < 2; pass++) {
        double m[3][3] = {{0}}, b[3] = {0}, sum = 0;
        for (int i = 0; i < near->count; i++) {
            const struct seed *seed = &seeds->list[near->at[i]];
            const float e = (dot(plane, seed->ray) - seed->inverse) / (tolerance * seed->inverse);
            const double weight = e * e < 1 ? (double)(1 - e * e) * (double)((1 - e * e) * near->weight[i]) : 0;
            sum += weight;
            for (int j = 0; j < 3; j++) {
                b[j] += weight * seed->ray[j] * seed->inverse;
                for (int k = 0; k < 3; k++)
                    m[j][k] += weight * seed->ray[j] * seed->ray[k];
            }
        }
        for (int j = 0; j < 3; j++) {
            m[j][j] += 1e-6 * sum + 1e-12;
            b[j] += (1e-6 * sum + 1e-12) * plane[j];
        }
        float better[3];
        if (solve_linear((const double(*)[3])m, b, better))
            memcpy(plane, better, sizeof better);
    }
}

// The plane that most neighbours lie on, of those through the seed: level, facing the camera, through two neighbours,
// or the plane of the seed before it (RANSAC, Fischler and Bolles 1981, with fixed samples).
static void fit_plane(struct depth_seeds *seeds, const struct surround_picture *picture, int index, float tolerance)
{
    struct seed *seed = &seeds->list[index];
    struct neighbours near;
    find_neighbours(seeds, picture, seed, &near);
    const uint32_t n = (uint32_t)near.count;
    float best = -1, candidate[3];
    uint32_t random = 2463534242u + (uint32_t)index * 2654435761u;
    for (int c = 0; c < TRIPLES + 3; c++) {
        if (c == 0)
            for (int k = 0; k < 3; k++)
                candidate[k] = seed->ray[k] * seed->inverse;
        else if (c == 1) {
            const float height = dot(seeds->up, seed->ray);
            if (fabsf(height) < 1e-3f)
                continue;
            for (int k = 0; k < 3; k++)
                candidate[k] = seeds->up[k] * seed->inverse / height;
        } else if (c == 2) {
            if (index == 0)
                continue;
            memcpy(candidate, seeds->list[index - 1].plane, sizeof candidate);
        } else {
            random ^= random << 13, random ^= random >> 17, random ^= random << 5; // xorshift (Marsaglia 2003)
            if (n < 3 || !plane_of_three(seed, &seeds->list[near.at[random % n]],
                                         &seeds->list[near.at[(random >> 12) % n]], candidate))
                continue;
        }
        const float own = (dot(candidate, seed->ray) - seed->inverse) / (tolerance * seed->inverse);
        if (own * own > OWN_APART * OWN_APART)
            continue;
        const float score = plane_support(seeds, &near, candidate, tolerance) + (c == 1 ? 0.5f * seed->weight : 0);
        if (score > best) {
            best = score;
            memcpy(seed->plane, candidate, sizeof candidate);
        }
    }
    float polished[3];
    memcpy(polished, seed->plane, sizeof polished);
    polish_plane(seeds, &near, tolerance, polished);
    const float own = (dot(polished, seed->ray) - seed->inverse) / (tolerance * seed->inverse);
    if (own * own <= OWN_APART * OWN_APART)
        memcpy(seed->plane, polished, sizeof polished);
}

// Whether the picture has, on the mean of the way from one seed to another, a colour.
static bool has_color(const struct surround_picture *picture, const struct seed *a, const struct seed *b,
                      const float color[3])
{
    const int du = b->u - a->u, dv = b->v - a->v, steps = abs(du) > abs(dv) ? abs(du) : abs(dv);
    int sum[3] = {0};
    for (int i = 0; i < steps; i++) {
        const int u = a->u + (2 * i * du + (du < 0 ? -steps : steps)) / (2 * steps);
        const int v = a->v + (2 * i * dv + (dv < 0 ? -steps : steps)) / (2 * steps);
        const uint8_t *y = picture->rgb + 3 * ((size_t)v * (size_t)picture->width + (size_t)u);
        for (int c = 0; c < 3; c++)
            sum[c] += y[c];
    }
    for (int c = 0; c < 3; c++)
        if (fabsf((float)sum[c] / (float)steps - color[c]) > ALIKE)
            return false;
    return true;
}

static bool are_seeds_alike(const struct surround_picture *picture, const struct seed *a, const struct seed *b)
{
    const uint8_t *x = picture->rgb + 3 * ((size_t)a->v * (size_t)picture->width + (size_t)a->u);
    const uint8_t *y = picture->rgb + 3 * ((size_t)b->v * (size_t)picture->width + (size_t)b->u);
    for (int c = 0; c < 3; c++)
        if (abs((int)x[c] - (int)y[c]) > ALIKE)
            return false;
    return true;
}

// Of dense points: in three of the four quarters around it a surface of the colour that the picture has here passes in
// front; near: those that do, but for their colour.
static bool is_surrounded(const struct depth_seeds *seeds, const struct surround_picture *picture,
                          const struct seed *seed, const int *near, int count)
{
    bool in_front[4] = {0};
    for (int i = 0; i < count; i++) {
        const struct seed *o = &seeds->list[near[i]];
        if (are_seeds_alike(picture, seed, o))
            in_front[(o->u > seed->u) + 2 * (o->v > seed->v)] = true;
    }
    return in_front[0] + in_front[1] + in_front[2] + in_front[3] >= 3;
}

enum { SECTORS = 16 };

// Hidden: on opposite sides of it a surface passes in front whose mean colour the picture has between.
// (Between the posts of a fence the picture has another colour than at the posts.)
static bool is_hidden(const struct depth_seeds *seeds, const struct surround_picture *picture, const struct seed *seed)
{
    const struct window w = window_of(seeds, picture, seed->u, seed->v, HIDING_ENOUGH);
    int near[HIDING_NEIGHBOURS], front = 0;
    bool in_front[SECTORS] = {0};
    float color[3] = {0};
    const int n = gather_seeds(seeds, picture, &w, HIDING_NEIGHBOURS, near);
    for (int i = 0; i < n; i++) {
        const struct seed *o = &seeds->list[near[i]];
        if (!(o->inverse > 1.05f * seed->inverse && dot(o->plane, seed->ray) > 1.05f * seed->inverse))
            continue;
        near[front++] = near[i];
        for (int c = 0; c < 3; c++)
            color[c] += picture->rgb[3 * ((size_t)o->v * (size_t)picture->width + (size_t)o->u) + (size_t)c];
    }
    if (!seeds->sparse)
        return is_surrounded(seeds, picture, seed, near, front);
    for (int c = 0; c < 3; c++)
        color[c] /= (float)(front + !front);
    for (int i = 0; i < front; i++) {
        const struct seed *o = &seeds->list[near[i]];
        const float angle = fast_atan2((float)(o->v - seed->v), (float)(o->u - seed->u));
        const int sector = floor_of(angle * (float)(SECTORS / 6.2831853) + SECTORS) % SECTORS;
        if (in_front[sector] || !has_color(picture, seed, o, color))
            continue;
        in_front[sector] = true;
        for (int k = -1; k <= 1; k++)
            if (in_front[(sector + SECTORS / 2 + k) % SECTORS])
                return true;
    }
    return false;
}

// Whether a plane was fitted among seeds that turned out to be hidden.
static bool is_misled(const struct depth_seeds *seeds, const struct surround_picture *picture, const struct seed *seed)
{
    const struct window w = window_of(seeds, picture, seed->u, seed->v, ENOUGH);
    int near[NEIGHBOURS];
    const int n = gather_seeds(seeds, picture, &w, NEIGHBOURS, near);
    bool misled = false;
    for (int i = 0; i < n && !misled; i++)
        misled = seeds->list[near[i]].hidden;
    return misled && !seed->hidden;
}

// Fits planes again, now among visible seeds only. ERR_MEMORY.
static enum status fit_visible(struct depth_seeds *seeds, const struct surround_picture *picture, float tolerance)
{
    bool *misled = malloc((size_t)seeds->count + 1);
    if (!misled)
        return fail(ERR_MEMORY, "no memory for a picture's depth");
    for (int i = 0; i < seeds->count; i++)
        misled[i] = is_misled(seeds, picture, &seeds->list[i]);
    for (int i = 0; i < seeds->count; i++)
        if (seeds->list[i].hidden)
            seeds->at[(size_t)seeds->list[i].v * (size_t)picture->width + (size_t)seeds->list[i].u] = -1;
    sum_area(seeds, picture->width, picture->height);
    for (int i = 0; i < seeds->count; i++)
        if (misled[i])
            fit_plane(seeds, picture, i, tolerance);
    free(misled);
    return OK;
}

static void set_up(struct depth_seeds *seeds, const struct surround_picture *picture)
{
    for (int k = 0; k < 3; k++)
        seeds->up[k] = (float)picture->axes[2][k];
}

enum status depth_seeds_make(struct depth_seeds *seeds, const struct surround_picture *picture,
                             const struct world_points *points, const struct depth_options *how)
{
    const size_t pixels = (size_t)picture->width * (size_t)picture->height;
    const size_t max = (size_t)points->count < pixels ? (size_t)points->count : pixels;
    *seeds = (struct depth_seeds){
        .list = malloc((max + 1) * sizeof *seeds->list),
        .at = alloc_cache_aligned(pixels * sizeof *seeds->at),
        .before = alloc_cache_aligned((size_t)(picture->width + 1) * (size_t)(picture->height + 1) * 4)};
    if (!seeds->list || !seeds->at || !seeds->before) {
        depth_seeds_free(seeds);
        return fail(ERR_MEMORY, "no memory for a picture's depth");
    }
    memset(seeds->at, 0xff, pixels * sizeof *seeds->at);
    set_up(seeds, picture);
    seeds->sparse = how->sparse;
    project_points(seeds, picture, points, how);
    sum_area(seeds, picture->width, picture->height);
    for (int i = 0; i < seeds->count; i++)
        fit_plane(seeds, picture, i, (float)how->tolerance);
    for (int i = 0; i < seeds->count; i++)
        seeds->list[i].hidden = is_hidden(seeds, picture, &seeds->list[i]);
    const enum status status = !seeds->sparse ? OK : fit_visible(seeds, picture, (float)how->tolerance);
    if (status != OK)
        depth_seeds_free(seeds);
    return status;
}

void depth_seeds_free(struct depth_seeds *seeds)
{
    free(seeds->list);
    free(seeds->at);
    free(seeds->before);
    *seeds = (struct depth_seeds){0};
}
