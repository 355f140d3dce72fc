#include "surround/depth/large_planes.h"

#include "surround/picture/fast_angle.h"

#include <stdlib.h>

// Chosen on the rover set: a bin is 3 degrees by 5 cm; fewest seeds and least length of a plane.
enum { AZIMUTHS = 120, DISTANCES = 240, MOST_PLANES = 40, FEWEST_SEEDS = 60, PASSES = 3 };
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
static void set_level(struct hough *h)
{
    const float *up = h->s->up;
    const float from[3] = {fabsf(up[2]) < 0.8f ? 0 : 1, 0, fabsf(up[2]) < 0.8f ? 1 : 0};
    const float along = dot(from, up);
    float length = 0;
    for (int k = 0; k < 3; k++) {
        h->level[0][k] = from[k] - along * up[k];
        length += h->level[0][k] * h->level[0][k];
    }
    for (int k = 0; k < 3; k++)
        h->level[0][k] /= sqrtf(length);
    for (int k = 0; k < 3; k++) {
        const int a = (k + 1) % 3, b = (k + 2) % 3;
        h->level[1][k] = up[a] * h->level[0][b] - up[b] * h->level[0][a];
    }
}

static int bin_of(float azimuth, float away)
{
    const int a = (int)((azimuth + 3.1415927f) / BIN_RAD), d = (int)(away / BIN_M);
    if (d >= DISTANCES)
        return -1;
    return (a >= AZIMUTHS ? 0 : a) * DISTANCES + d;
}

static void add_votes(struct hough *h)
{
    for (int i = 0; i < h->s->count; i++) {
        const struct seed *seed = &h->s->list[i];
        const float size2 = dot(seed->plane, seed->plane), along = dot(seed->plane, h->s->up);
        if (seed->hidden || !(size2 > 1e-6f) || along * along > 0.25f * size2) // more than 30 degrees from upright
            continue;
        const float x = dot(seed->plane, h->level[0]), y = dot(seed->plane, h->level[1]);
        struct upright_seed one = {.x = dot(seed->ray, h->level[0]) / seed->inverse,
                                   .y = dot(seed->ray, h->level[1]) / seed->inverse,
                                   .azimuth = fast_atan2(y, x),
                                   .weight = seed->weight,
                                   .seed = i};
        const float flat = sqrtf(x * x + y * y);
        one.away = (x * one.x + y * one.y) / flat; // of an upright plane through the point
        one.bin = one.away > 0 ? bin_of(one.azimuth, one.away) : -1;
        if (one.bin < 0)
            continue;
        h->votes[one.bin] += one.weight;
        h->list[h->count++] = one;
    }
}

// The best 3 x 3 bins' middle; -1: none has votes.
static int best_bin(const float *votes)
{
    int best = -1;
    float most = 0;
    for (int a = 0; a < AZIMUTHS; a++)
        for (int d = 0; d < DISTANCES; d++) {
            float sum = 0;
            for (int i = -1; i <= 1; i++)
                for (int j = d > 0 ? -1 : 0; j <= (d + 1 < DISTANCES ? 1 : 0); j++)
                    sum += votes[(a + i + AZIMUTHS) % AZIMUTHS * DISTANCES + d + j];
            if (sum > most) {
                most = sum;
                best = a * DISTANCES + d;
            }
        }
    return best;
}

static float turned(float a)
{
    if (a > 3.1415927f)
        return a - 6.2831853f;
    return a < -3.1415927f ? a + 6.2831853f : a;
}

struct line {
    float c, s, away, azimuth; // c x + s y = away
};

static float tolerance_at(const struct upright_seed *u) { return 0.015f + 0.006f * sqrtf(u->x * u->x + u->y * u->y); }

static bool on_line(const struct line *l, const struct upright_seed *u, float slack)
{
    return u->bin >= 0 && fabsf(l->c * u->x + l->s * u->y - l->away) < slack * tolerance_at(u) &&
           fabsf(turned(u->azimuth - l->azimuth)) < APART;
}

// Total least squares in the plan, over what is near, three times. False: too few or too short.
static bool fit_line(const struct hough *h, struct line *l)
{
    for (int pass = 0; pass < PASSES; pass++) {
        double w = 0, x = 0, y = 0, xx = 0, xy = 0, yy = 0;
        float least = 1e9f, most = -1e9f;
        int n = 0;
        for (int i = 0; i < h->count; i++) {
            const struct upright_seed *u = &h->list[i];
            if (!on_line(l, u, pass ? 1 : 3))
                continue;
            const float along = l->c * u->y - l->s * u->x;
            least = along < least ? along : least;
            most = along > most ? along : most;
            const double k = u->weight;
            w += k, x += k * u->x, y += k * u->y;
            xx += k * u->x * u->x, xy += k * u->x * u->y, yy += k * u->y * u->y;
            n++;
        }
        if (n < FEWEST_SEEDS || most - least < LONG_M)
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
        *l = (struct line){(float)(c / length), (float)(s / length), (float)((c * x + s * y) / length), 0};
        l->azimuth = fast_atan2(l->s, l->c);
    }
    return l->away > 0.05f;
}

static void take(struct hough *h, const struct line *l)
{
    for (int i = 0; i < h->count; i++) {
        struct upright_seed *u = &h->list[i];
        if (!on_line(l, u, 1))
            continue;
        struct seed *seed = &h->s->list[u->seed];
        h->votes[u->bin] -= u->weight;
        u->bin = -1;
        for (int k = 0; k < 3; k++)
            seed->plane[k] = (l->c * h->level[0][k] + l->s * h->level[1][k]) / l->away;
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
static bool start_line(const struct hough *h, int bin, struct line *l)
{
    float c = 0, s = 0, away = 0, weights = 0;
    for (int pass = 0; pass < 2; pass++) {
        for (int i = 0; i < h->count; i++) {
            const struct upright_seed *u = &h->list[i];
            if (u->bin < 0 || !is_beside(bin, u->bin))
                continue;
            const float *plane = h->s->list[u->seed].plane;
            const float x = dot(plane, h->level[0]), y = dot(plane, h->level[1]);
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
    *l = (struct line){c, s, away / weights, fast_atan2(s, c)};
    return weights > 0;
}

static void clear_votes(struct hough *h, int bin)
{
    for (int i = 0; i < h->count; i++)
        if (h->list[i].bin >= 0 && is_beside(bin, h->list[i].bin)) {
            h->votes[h->list[i].bin] = 0;
            h->list[i].bin = -1;
        }
    h->votes[bin] = 0;
}

enum status large_planes_snap(struct depth_seeds *s)
{
    struct hough h = {.s = s,
                      .list = malloc(((size_t)s->count + 1) * sizeof *h.list),
                      .votes = calloc((size_t)AZIMUTHS * DISTANCES, sizeof *h.votes)};
    if (h.list && h.votes) {
        set_level(&h);
        add_votes(&h);
    }
    const bool good = h.list && h.votes;
    for (int n = 0, bin; good && n < MOST_PLANES && (bin = best_bin(h.votes)) >= 0; n++) {
        struct line line;
        const bool fits = start_line(&h, bin, &line) && fit_line(&h, &line);
        if (fits)
            take(&h, &line);
        else
            clear_votes(&h, bin);
    }
    free(h.list);
    free(h.votes);
    return good ? OK : fail(ERR_MEMORY, "out of memory");
}
