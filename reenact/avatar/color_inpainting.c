#include "reenact/avatar/color_inpainting.h"

#include "base/parallel.h"

#include <stdlib.h>
#include <string.h>

enum { WITNESSES = 1000, PASSES = 4, THREADS = 2, STRETCH = 4096 };

static const double OTHER_HALF_M = 0.03; // a mirror image lies this near
static const double LEVEL_M = 0.05;      // what lies higher or lower along the part says nothing,
static const float BESIDE_M = 0.03F;     // and what lies this far round it a quarter of what is right there
static const float ODD = 0.1F;           // a colour so far from the others counts a quarter; of 0 to 1

// ---------------------------------------------------------------- the nearest

// The points that somebody saw, by their height in the rest pose, for those near a place are asked for often.
struct shelves {
    double low; // height of the first
    int count;
    int32_t *first; // of each shelf's points, and behind the last
    int32_t *points;
};

static const double SHELF_M = 0.01;

static int shelf_of(const struct shelves *s, double height)
{
    double at = floor((height - s->low) / SHELF_M);
    return at < 0 ? 0 : at >= s->count ? s->count - 1 : (int)at;
}

static enum status shelves_open(struct shelves *s, const struct surface *surface, const uint8_t *filled)
{
    double low = INFINITY, high = -INFINITY;
    for (int i = 0; i < surface->point_count; i++) {
        low = fmin(low, surface->points[i].y);
        high = fmax(high, surface->points[i].y);
    }
    *s = (struct shelves){.low = low, .count = (int)fmin(fmax((high - low) / SHELF_M, 0), 1e6) + 1};
    assert(s->count > 0);
    s->first = calloc((size_t)s->count + 1, sizeof *s->first);
    s->points = malloc(sizeof *s->points * (size_t)surface->point_count);
    if (!s->first || !s->points) {
        free(s->first);
        free(s->points);
        return fail(ERR_MEMORY, "out of memory");
    }
    for (int i = 0; i < surface->point_count; i++)
        s->first[shelf_of(s, surface->points[i].y)] += !filled[i];
    for (int k = 1; k <= s->count; k++)
        s->first[k] += s->first[k - 1];
    for (int i = surface->point_count - 1; i >= 0; i--)
        if (!filled[i])
            s->points[--s->first[shelf_of(s, surface->points[i].y)]] = i;
    return OK;
}

// The lowest-numbered of the nearest; -1: none is nearer than `within`.
static int nearest_seen(const struct shelves *s, const struct surface *surface, struct vec3 p, double within)
{
    int best = -1, middle = shelf_of(s, p.y);
    double least = within * within;
    for (int away = 0; away < s->count; away++) {
        double beside = fmax(away - 1, 0) * SHELF_M; // at least so far off is what lies on such a shelf
        if (beside * beside > least)
            break;
        for (int side = away ? -1 : 1; side <= 1; side += 2) {
            int k = middle + side * away;
            if (k < 0 || k >= s->count)
                continue;
            for (int at = s->first[k]; at < s->first[k + 1]; at++) {
                int i = s->points[at];
                struct vec3 d = v3_sub(surface->points[i], p);
                double d2 = v3_dot(d, d);
                if (d2 < least || (d2 == least && best > i))
                    least = d2, best = i;
            }
        }
    }
    return best;
}

// ---------------------------------------------------------------- all round a part

// A point that somebody saw of a part.
struct witness {
    double along;                  // the part, from its beginning, metres
    float at[3], color[3], time_s; // color: roots of the linear
    int32_t number;
};

// Of each bone at most WITNESSES, evenly spread over what was seen of it and sorted along it.
struct witnesses {
    struct witness of[BONE_COUNT][WITNESSES];
    int count[BONE_COUNT];
};

static int by_along(const void *a, const void *b)
{
    const struct witness *x = a, *y = b;
    if (x->along != y->along)
        return x->along < y->along ? -1 : 1;
    return (x->number > y->number) - (x->number < y->number);
}

// How far along the part; hair and face lie in rings about where a skull looks, not about its neck.
static double along_bone(const struct rest *rest, int bone, struct vec3 p)
{
    const struct part_frame *f = &rest->frame[bone];
    return v3_dot(v3_sub(p, f->origin), bone == BONE_SKULL ? f->y : f->z);
}

static struct witness witness_of(const struct coat *coat, int i, struct vec3 p, double along)
{
    const float *c = coat->color[i];
    return (struct witness){.along = along,
                            .at = {(float)p.x, (float)p.y, (float)p.z},
                            .color = {sqrtf(c[0]), sqrtf(c[1]), sqrtf(c[2])},
                            .time_s = coat->time_s[i],
                            .number = i};
}

static void find_witnesses(struct witnesses *w, const struct coat *coat, const struct surface *surface,
                           const struct skin *skins, const struct rest *rest)
{
    int seen[BONE_COUNT] = {0}, at[BONE_COUNT] = {0};
    for (int i = 0; i < surface->point_count; i++)
        seen[skins[i].bone[0]] += !coat->filled[i];
    for (int i = 0; i < surface->point_count; i++) {
        const int b = skins[i].bone[0];
        if (coat->filled[i] || at[b]++ % (seen[b] / WITNESSES + 1))
            continue;
        const struct vec3 p = surface->points[i];
        w->of[b][w->count[b]++] = witness_of(coat, i, p, along_bone(rest, b, p));
    }
    for (int b = 0; b < BONE_COUNT; b++)
        qsort(w->of[b], (size_t)w->count[b], sizeof *w->of[b], by_along);
}

// The first that is no lower than that.
static int first_from(const struct witness *w, int count, double along)
{
    int low = 0, high = count;
    while (low < high) {
        int middle = low + (high - low) / 2;
        if (w[middle].along < along)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

// How much what was seen there says about p, by how far it is along the part and round it.
static float said_by(const struct witness *w, struct vec3 p, double along)
{
    const float off = (float)((w->along - along) / LEVEL_M), level = 1 - off * off;
    const float d[3] = {w->at[0] - (float)p.x, w->at[1] - (float)p.y, w->at[2] - (float)p.z};
    const float beside = 1 + (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]) / (BESIDE_M * BESIDE_M);
    return level * level / (beside * beside);
}

// Whose colours differ from the mean counts less, and the mean is taken again.
static void agreed_color(const struct witness *w, const float *said, int count, float color[3])
{
    float trust[WITNESSES];
    memcpy(trust, said, sizeof *trust * (size_t)count);
    for (int pass = 0; pass < PASSES; pass++) {
        float sum[3] = {0}, total = 0;
        for (int k = 0; k < count; k++) {
            for (int c = 0; c < 3; c++)
                sum[c] += trust[k] * w[k].color[c];
            total += trust[k];
        }
        for (int c = 0; c < 3; c++)
            color[c] = sum[c] / total;
        for (int k = 0; k < count; k++) {
            float off2 = 0;
            for (int c = 0; c < 3; c++)
                off2 += (w[k].color[c] - color[c]) * (w[k].color[c] - color[c]);
            const float alike = 1 + off2 / (ODD * ODD);
            trust[k] = said[k] / (alike * alike);
        }
    }
}

// False: nothing was seen of the part at that height.
static bool fill_from_round(const struct witnesses *all, int bone, struct vec3 p, double along, float color[3],
                            float *time_s)
{
    const struct witness *w = all->of[bone];
    const int last = all->count[bone] - 1;
    if (last < 0)
        return false;
    along = fmin(fmax(along, w[0].along + LEVEL_M / 2), fmax(w[last].along - LEVEL_M / 2, w[0].along));
    const int first = first_from(w, all->count[bone], along - LEVEL_M);
    float said[WITNESSES], most = 0;
    int count = 0;
    for (int k = first; k <= last && w[k].along < along + LEVEL_M; k++) {
        said[count] = said_by(&w[k], p, along);
        if (said[count] > most)
            most = said[count], *time_s = w[k].time_s;
        count++;
    }
    if (!(most > 0))
        return false;
    agreed_color(&w[first], said, count, color);
    for (int c = 0; c < 3; c++)
        color[c] *= color[c];
    return true;
}

// ---------------------------------------------------------------- each point

struct filling {
    const struct surface *surface;
    const struct skin *skins;
    const struct rest *rest;
    struct shelves shelves;
    struct witnesses *witnesses;
    struct coat *coat;
};

static void fill_as(struct coat *c, int i, int from)
{
    if (from < 0)
        return;
    memcpy(c->color[i], c->color[from], sizeof c->color[i]);
    c->time_s[i] = c->time_s[from];
}

// What was seen of the body's other half where p is on this; -1: nothing, or as much was seen beside p.
static int twin_of(const struct filling *f, struct vec3 p)
{
    const struct vec3 mirrored = {-p.x, p.y, p.z};
    const int twin = nearest_seen(&f->shelves, f->surface, mirrored, OTHER_HALF_M);
    if (twin < 0)
        return -1;
    const double beside_m = 2 * v3_distance(f->surface->points[twin], mirrored);
    return nearest_seen(&f->shelves, f->surface, p, beside_m) < 0 ? twin : -1;
}

// Only what nobody saw is written, and only what somebody saw is read.
static void fill_stretch(void *context, int stretch)
{
    const struct filling *f = context;
    struct coat *c = f->coat;
    for (int i = stretch * STRETCH; i < (stretch + 1) * STRETCH && i < f->surface->point_count; i++) {
        if (!c->filled[i])
            continue;
        const struct vec3 p = f->surface->points[i];
        const int bone = f->skins[i].bone[0];
        const int twin = twin_of(f, p);
        if (twin >= 0)
            fill_as(c, i, twin);
        else if (!fill_from_round(f->witnesses, bone, p, along_bone(f->rest, bone, p), c->color[i], &c->time_s[i]))
            fill_as(c, i, nearest_seen(&f->shelves, f->surface, p, INFINITY));
    }
}

enum status coat_fill(struct coat *coat, const struct surface *surface, const struct skin *skins,
                      const struct rest *rest)
{
    struct filling f = {
        .surface = surface, .skins = skins, .rest = rest, .coat = coat, .witnesses = calloc(1, sizeof *f.witnesses)};
    enum status status =
        f.witnesses ? shelves_open(&f.shelves, surface, coat->filled) : fail(ERR_MEMORY, "out of memory");
    if (status == OK) {
        find_witnesses(f.witnesses, coat, surface, skins, rest);
        parallel(THREADS, (surface->point_count + STRETCH - 1) / STRETCH, fill_stretch, &f);
        free(f.shelves.first);
        free(f.shelves.points);
    }
    free(f.witnesses);
    return status;
}
