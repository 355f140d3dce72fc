#include "reenact/avatar/vertex_color.h"

#include "base/parallel.h"
#include "reenact/avatar/color_inpainting.h"

#include <stdlib.h>
#include <string.h>

enum { KEPT = 16, ROUNDS = 8, RIM_PX = 1, THREADS = 2, STRETCH = 4096 };

static const double LEAST_FACING = 0.25; // cosine towards the camera
static const double NEAR_M = 0.05;       // the reading that vouches for a place lies this near
static const float ODD = 0.06F;          // a colour so far from the others counts a quarter
static const float STEADY = 0.02F;       // of the light's terms, against being read from too few sides

// One frame's word about one point.
struct word {
    float weight, rgb[3], normal[3], time_s; // linear; world axes
};

struct coat_maker {
    const struct rest *rest;
    const struct surface *surface;
    const struct skin *skins;
    struct calibration calibration;
    struct pose depth_from_color;
    struct word (*words)[KEPT]; // of each point; the unused have weight 0
    float linear[256];
};

enum status coat_open(struct coat_maker **out, const struct rest *rest, const struct surface *surface,
                      const struct skin *skins, const struct calibration *calibration)
{
    struct coat_maker *m = *out = calloc(1, sizeof *m);
    if (!m)
        return fail(ERR_MEMORY, "out of memory");
    m->rest = rest;
    m->surface = surface;
    m->skins = skins;
    m->calibration = *calibration;
    m->depth_from_color = calibration->registered ? POSE_IDENTITY : pose_inverse(calibration->color_from_depth);
    m->words = calloc((size_t)surface->point_count, sizeof *m->words);
    for (int i = 0; i < 256; i++)
        m->linear[i] = (float)(i / 255.0 * i / 255.0); // near enough to sRGB's curve, and undone by a root
    if (m->words)
        return OK;
    coat_close(out);
    return fail(ERR_MEMORY, "out of memory");
}

void coat_close(struct coat_maker **m)
{
    if (!*m)
        return;
    free((*m)->words);
    free(*m);
    *m = NULL;
}

// ---------------------------------------------------------------- gathering

static void keep(struct word words[KEPT], const struct word *word)
{
    int weakest = 0;
    for (int i = 1; i < KEPT; i++)
        if (words[i].weight < words[weakest].weight)
            weakest = i;
    if (word->weight > words[weakest].weight)
        words[weakest] = *word;
}

// Does the depth picture vouch that the point `p` (depth camera's axes) of `part` is what is seen there?
static bool vouched(const struct coat_maker *m, const struct sight *s, struct vec3 p, enum part part)
{
    if (!(p.z > 0.05))
        return false;
    struct pixel px = lens_project(&m->calibration.depth, p);
    int x = (int)floor(px.x + 0.5), y = (int)floor(px.y + 0.5);
    if (x < 0 || y < 0 || x >= s->width || y >= s->height)
        return false;
    int i = y * s->width + x;
    if (s->edge[i] < RIM_PX || s->part[i] >= PART_COUNT || !bones_meet(s->part[i], (int)part) ||
        fabs(s->depth[i] * 1e-3 - p.z) > NEAR_M)
        return false;
    return true;
}

static bool read_color(const struct coat_maker *m, const uint8_t *rgb, struct vec3 p, float out[3])
{
    const struct lens *lens = &m->calibration.color;
    struct pixel px = lens_project(lens, p);
    int x = (int)floor(px.x), y = (int)floor(px.y);
    if (x < 0 || y < 0 || x + 1 >= lens->width || y + 1 >= lens->height)
        return false;
    float u = (float)(px.x - x), v = (float)(px.y - y);
    const uint8_t *a = rgb + 3 * (y * lens->width + x), *b = a + 3 * lens->width;
    for (int c = 0; c < 3; c++)
        out[c] = (m->linear[a[c]] * (1 - u) + m->linear[a[c + 3]] * u) * (1 - v) +
                 (m->linear[b[c]] * (1 - u) + m->linear[b[c + 3]] * u) * v;
    return true;
}

// What one frame says, to one stretch of the points after the other.
struct addition {
    struct coat_maker *maker;
    const struct sight *sight;
    const uint8_t *rgb;
    const struct posture *posture;
    const struct warp *warp;
    struct pose world_from_camera;
    double time_s;
};

static void add_stretch(void *context, int stretch)
{
    const struct addition *a = context;
    const struct coat_maker *m = a->maker;
    for (int i = stretch * STRETCH; i < (stretch + 1) * STRETCH && i < m->surface->point_count; i++) {
        struct vec3 p, n, rest = m->surface->points[i];
        rest = v3_add(rest, warp_at(a->warp, rest));
        skin_place(&m->skins[i], a->posture, rest, m->surface->normals[i], &p, &n);
        double facing = -v3_dot(n, v3_unit(p));
        struct word word = {.time_s = (float)a->time_s};
        if (!(p.z > 0.05) || facing < LEAST_FACING ||
            !vouched(m, a->sight, pose_apply(m->depth_from_color, p), bone_part(m->skins[i].bone[0])) ||
            !read_color(m, a->rgb, p, word.rgb))
            continue;
        struct vec3 world = quat_rotate(a->world_from_camera.rotation, n);
        word.normal[0] = (float)world.x, word.normal[1] = (float)world.y, word.normal[2] = (float)world.z;
        word.weight = (float)(facing * facing / (p.z * p.z));
        keep(m->words[i], &word);
    }
}

static int stretches(const struct coat_maker *m) { return (m->surface->point_count + STRETCH - 1) / STRETCH; }

void coat_add(struct coat_maker *m, const struct sight *sight, const uint8_t *rgb, const struct posture *posture,
              const struct warp *warp, struct pose world_from_camera, double time_s)
{
    struct addition a = {m, sight, rgb, posture, warp, world_from_camera, time_s};
    parallel(THREADS, stretches(m), add_stretch, &a);
}

// ---------------------------------------------------------------- light

static void harmonics(const float n[3], float y[LIGHT_TERMS])
{
    y[0] = 1;
    y[1] = n[0], y[2] = n[1], y[3] = n[2];
    y[4] = n[0] * n[1], y[5] = n[1] * n[2], y[6] = n[0] * n[2];
    y[7] = n[0] * n[0] - n[1] * n[1], y[8] = 3 * n[2] * n[2] - 1;
}

float light_on(const struct light *light, const float n[3])
{
    float y[LIGHT_TERMS], sum = 0;
    harmonics(n, y);
    for (int i = 0; i < LIGHT_TERMS; i++)
        sum += light->term[i] * y[i];
    return fminf(fmaxf(sum, LIGHT_LEAST), LIGHT_MOST);
}

// The light on each word's side of the surface.
static void light_words(const struct word words[KEPT], const struct light *light, float on[KEPT])
{
    for (int k = 0; k < KEPT; k++)
        on[k] = words[k].weight > 0 ? light_on(light, words[k].normal) : 1;
}

// The point's own colour in the mean light, each word counting `odd` of its weight; false: nobody saw it.
static bool own_color(const struct word words[KEPT], const float on[KEPT], const float odd[KEPT], float color[3])
{
    float sum[3] = {0}, total = 0;
    for (int k = 0; k < KEPT; k++) {
        if (!(words[k].weight > 0))
            continue;
        float w = words[k].weight * odd[k];
        for (int c = 0; c < 3; c++)
            sum[c] += w * on[k] * words[k].rgb[c];
        total += w * on[k] * on[k];
    }
    for (int c = 0; c < 3 && total > 0; c++)
        color[c] = sum[c] / total;
    return total > 0;
}

// Likewise, but words that differ from the others count less.
static bool robust_color(const struct word words[KEPT], const float on[KEPT], float color[3])
{
    enum { PASSES = 4 };
    float odd[KEPT];
    for (int k = 0; k < KEPT; k++)
        odd[k] = 1;
    for (int pass = 0; pass < PASSES; pass++) {
        if (!own_color(words, on, odd, color))
            return false;
        for (int k = 0; k < KEPT; k++) {
            float off = 0;
            for (int c = 0; c < 3 && words[k].weight > 0; c++)
                off += fabsf(sqrtf(words[k].rgb[c] / on[k]) - sqrtf(color[c]));
            odd[k] = 1 / (1 + off * off / (ODD * ODD));
            odd[k] *= odd[k];
        }
    }
    return true;
}

// Symmetric positive definite, in place.
static void solve(double a[LIGHT_TERMS][LIGHT_TERMS], double b[LIGHT_TERMS])
{
    for (int i = 0; i < LIGHT_TERMS; i++)
        for (int r = i + 1; r < LIGHT_TERMS; r++) {
            double f = a[r][i] / a[i][i];
            for (int c = i; c < LIGHT_TERMS; c++)
                a[r][c] -= f * a[i][c];
            b[r] -= f * b[i];
        }
    for (int i = LIGHT_TERMS - 1; i >= 0; i--) {
        for (int c = i + 1; c < LIGHT_TERMS; c++)
            b[i] -= a[i][c] * b[c];
        b[i] /= a[i][i];
    }
}

// What all words say of the light, in the least squares' normal equations: the lower half of the matrix.
struct saying {
    double a[LIGHT_TERMS][LIGHT_TERMS], b[LIGHT_TERMS], size;
};

// The points in stretches, each for itself: the same sums whoever works them out.
struct lighting {
    const struct coat_maker *maker;
    struct light light;
    struct saying *saying; // of each stretch
};

static void listen(struct saying *s, const struct word *w, float on, const float color[3])
{
    float y[LIGHT_TERMS];
    double bright = 0, seen = 0;
    for (int c = 0; c < 3; c++) {
        float off = w->rgb[c] - color[c] * on;
        double weight = (double)(w->weight / (1 + off * off / (ODD * ODD)));
        bright += weight * (double)(color[c] * color[c]);
        seen += weight * (double)(color[c] * w->rgb[c]);
    }
    harmonics(w->normal, y);
    for (int r = 0; r < LIGHT_TERMS; r++) {
        double by = bright * (double)y[r];
        for (int q = 0; q <= r; q++)
            s->a[r][q] += by * (double)y[q];
        s->b[r] += seen * (double)y[r];
    }
    s->size += bright;
}

static void light_stretch(void *context, int stretch)
{
    const struct lighting *l = context;
    const struct coat_maker *m = l->maker;
    struct saying *s = &l->saying[stretch];
    float on[KEPT], odd[KEPT], color[3];
    *s = (struct saying){0};
    for (int k = 0; k < KEPT; k++)
        odd[k] = 1;
    for (int i = stretch * STRETCH; i < (stretch + 1) * STRETCH && i < m->surface->point_count; i++) {
        const struct word *words = m->words[i];
        light_words(words, &l->light, on);
        if (!own_color(words, on, odd, color))
            continue;
        for (int k = 0; k < KEPT; k++)
            if (words[k].weight > 0)
                listen(s, &words[k], on[k], color);
    }
}

// One round: the points' colours in the light so far, then the light by these colours.
static void fit_light(struct lighting *l)
{
    struct saying all = {0};
    int count = stretches(l->maker);
    parallel(THREADS, count, light_stretch, l);
    for (int i = 0; i < count; i++) {
        for (int r = 0; r < LIGHT_TERMS; r++) {
            for (int q = 0; q <= r; q++)
                all.a[r][q] += l->saying[i].a[r][q];
            all.b[r] += l->saying[i].b[r];
        }
        all.size += l->saying[i].size;
    }
    if (!(all.size > 0))
        return;
    for (int r = 0; r < LIGHT_TERMS; r++) {
        for (int q = 0; q < r; q++)
            all.a[q][r] = all.a[r][q];
        all.a[r][r] += (double)STEADY * all.size;
    }
    all.b[0] += (double)STEADY * all.size; // towards even light
    solve(all.a, all.b);
    for (int r = 0; r < LIGHT_TERMS; r++)
        l->light.term[r] = (float)(all.b[r] / all.b[0]);
}

// ---------------------------------------------------------------- making

struct coloring {
    const struct coat_maker *maker;
    struct coat *coat;
};

static void color_stretch(void *context, int stretch)
{
    const struct coloring *g = context;
    const struct coat_maker *m = g->maker;
    struct coat *out = g->coat;
    float on[KEPT];
    for (int i = stretch * STRETCH; i < (stretch + 1) * STRETCH && i < m->surface->point_count; i++) {
        light_words(m->words[i], &out->light, on);
        out->filled[i] = !robust_color(m->words[i], on, out->color[i]);
        float best = 0;
        for (int k = 0; k < KEPT; k++)
            if (m->words[i][k].weight > best)
                best = m->words[i][k].weight, out->time_s[i] = m->words[i][k].time_s;
    }
}

enum status coat_make(struct coat_maker *m, struct coat *out)
{
    size_t count = (size_t)m->surface->point_count;
    struct lighting lighting = {.maker = m, .light = {{1}}};
    *out = (struct coat){.color = calloc(count, sizeof *out->color),
                         .time_s = calloc(count, sizeof *out->time_s),
                         .filled = calloc(count, 1)};
    lighting.saying = malloc(sizeof *lighting.saying * (size_t)stretches(m));
    if (!out->color || !out->time_s || !out->filled || !lighting.saying) {
        free(lighting.saying);
        coat_free(out);
        return fail(ERR_MEMORY, "out of memory");
    }
    for (int round = 0; round < ROUNDS; round++)
        fit_light(&lighting);
    free(lighting.saying);
    out->light = lighting.light;
    struct coloring coloring = {m, out};
    parallel(THREADS, stretches(m), color_stretch, &coloring);
    enum status status = coat_fill(out, m->surface, m->skins, m->rest);
    if (status != OK)
        coat_free(out);
    return status;
}

void coat_free(struct coat *c)
{
    free(c->color);
    free(c->time_s);
    free(c->filled);
    *c = (struct coat){0};
}
