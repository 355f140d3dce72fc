#include "surround/view/exposure.h"

#include "surround/view/view_layers.h"
#include "base/portable_math.h"

#include <stddef.h>
#include <stdlib.h>

// Chosen by hand: points looked at; fewest that make a ratio; levels that are neither dark nor saturated; the pull to
// 1, as a standard deviation of the gain's logarithm; so many neighbouring points count as one; sweeps of the solver.
enum { GRID = 40, FEWEST = 40, DARKEST = 12, BRIGHTEST = 243, COMPARED = 4, ALIKE = 4, SWEEPS = 200 };
#define SIGMA_GAIN 0.5
#define SIGMA_PAIR 0.004 // a ratio is never better than this
#define NEAR_M     0.05  // pictures nearer to a view than this count alike; as far as poses may be off

void exposure_free(struct exposure *e)
{
    free(e->pairs);
    free(e->log_gain);
    *e = (struct exposure){0};
}

static enum status grow(struct exposure *e, int pictures)
{
    if (pictures > e->picture_room) {
        const int room = pictures * 2 + 16;
        double(*gains)[3] = realloc(e->log_gain, (size_t)room * sizeof *gains);
        if (!gains)
            return fail(ERR_MEMORY, "out of memory");
        e->log_gain = gains;
        e->picture_room = room;
    }
    for (; e->picture_count < pictures; e->picture_count++)
        for (int c = 0; c < 3; c++)
            e->log_gain[e->picture_count][c] = 0;
    if (e->pair_count + COMPARED > e->pair_room) {
        const int room = e->pair_room * 2 + 64;
        struct exposure_pair *pairs = realloc(e->pairs, (size_t)room * sizeof *pairs);
        if (!pairs)
            return fail(ERR_MEMORY, "out of memory");
        e->pairs = pairs;
        e->pair_room = room;
    }
    return OK;
}

// Mean of 3 x 3 pixels. False: at the edge, dark or saturated.
static bool mean_colour(const struct surround_picture *p, float u, float v, double out[3])
{
    const int x = (int)floorf(u + 0.5f), y = (int)floorf(v + 0.5f);
    if (x < 1 || y < 1 || x + 1 >= p->width || y + 1 >= p->height)
        return false;
    int sum[3] = {0};
    for (int k = 0; k < 9; k++) {
        const size_t at = (size_t)(y + k / 3 - 1) * (size_t)p->width + (size_t)(x + k % 3 - 1);
        for (size_t c = 0; c < 3; c++) {
            const int value = p->rgb[3 * at + c];
            if (value < DARKEST || value > BRIGHTEST)
                return false;
            sum[c] += value;
        }
    }
    for (int c = 0; c < 3; c++)
        out[c] = sum[c] / 9.0;
    return true;
}

static int rising(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double median(double *list, int count)
{
    qsort(list, (size_t)count, sizeof *list, rising);
    return list[count / 2];
}

static void measure(const struct surround_picture *a, const struct surround_picture *b, struct exposure_pair *out)
{
    double ratios[3][GRID * GRID];
    int n = 0;
    for (int i = 0; i < GRID * GRID; i++) {
        const int u = (2 * (i % GRID) + 1) * a->width / (2 * GRID), v = (2 * (i / GRID) + 1) * a->height / (2 * GRID);
        const float inverse = a->inverse[(size_t)v * (size_t)a->width + (size_t)u];
        double world[3], first[3], second[3];
        float ray[3];
        struct picture_point at;
        if (!(inverse > 1e-3f) || !mean_colour(a, (float)u, (float)v, first))
            continue;
        surround_picture_ray(a, u, v, ray);
        const double c[3] = {a->world_from_camera.translation.x, a->world_from_camera.translation.y,
                             a->world_from_camera.translation.z};
        for (int k = 0; k < 3; k++)
            world[k] = c[k] + (a->axes[k][0] * (double)ray[0] + a->axes[k][1] * (double)ray[1] +
                               a->axes[k][2] * (double)ray[2]) /
                                  (double)inverse;
        if (!surround_picture_project(b, world, &at) || picture_sight(b, &at, 0.03f) != SIGHT_SEEN ||
            !mean_colour(b, at.u, at.v, second))
            continue;
        for (int k = 0; k < 3; k++)
            ratios[k][n] = portable_log(second[k] / first[k]);
        n++;
    }
    if (n < FEWEST)
        return;
    out->measured = true;
    for (int k = 0; k < 3; k++) {
        const double middle = median(ratios[k], n);
        for (int i = 0; i < n; i++)
            ratios[k][i] = fabs(ratios[k][i] - middle);
        const double sigma = 1.4826 * median(ratios[k], n); // of a normal distribution from the median deviation
        // A median's variance is pi / 2 times the mean's
        out->log_ratio[k] = middle;
        out->information[k] = 1 / (1.5708 * sigma * sigma * ALIKE / n + SIGMA_PAIR * SIGMA_PAIR);
    }
}

static bool is_met(const struct exposure *e, int a, int b)
{
    for (int i = 0; i < e->pair_count; i++)
        if ((e->pairs[i].a == a && e->pairs[i].b == b) || (e->pairs[i].a == b && e->pairs[i].b == a))
            return true;
    return false;
}

static int count_of(const struct exposure *e, int picture)
{
    int n = 0;
    for (int i = 0; i < e->pair_count; i++)
        n += e->pairs[i].a == picture || e->pairs[i].b == picture;
    return n;
}

// The pairs of each picture as lists: next[2 * pair + side] follows in the list of the pair's a (side 0) or b (side 1).
struct pair_lists {
    int *first, *next; // -1 ends a list
};

static enum status list_pairs(const struct exposure *e, struct pair_lists *out)
{
    out->first = malloc(((size_t)e->picture_count + 1) * sizeof *out->first);
    out->next = malloc((2 * (size_t)e->pair_count + 1) * sizeof *out->next);
    if (!out->first || !out->next)
        return fail(ERR_MEMORY, "out of memory");
    for (int p = 0; p < e->picture_count; p++)
        out->first[p] = -1;
    for (int i = 0; i < 2 * e->pair_count; i++) {
        const int p = i & 1 ? e->pairs[i / 2].b : e->pairs[i / 2].a;
        if (!e->pairs[i / 2].measured)
            continue;
        out->next[i] = out->first[p];
        out->first[p] = i;
    }
    return OK;
}

// The sum of the logarithms of those that are compared with each other, directly or not, is made 0: the iteration comes
// to that only slowly. group: of picture_count, overwritten.
static void centre(struct exposure *e, int *group)
{
    for (int p = 0; p < e->picture_count; p++)
        group[p] = p;
    for (bool changed = true; changed;) {
        changed = false;
        for (int i = 0; i < e->pair_count; i++) {
            const struct exposure_pair *pair = &e->pairs[i];
            const int least = group[pair->a] < group[pair->b] ? group[pair->a] : group[pair->b];
            if (!pair->measured || group[pair->a] == group[pair->b])
                continue;
            group[pair->a] = group[pair->b] = least;
            changed = true;
        }
    }
    for (int g = 0; g < e->picture_count; g++)
        for (int c = 0; c < 3; c++) {
            double sum = 0;
            int count = 0;
            for (int p = g; p < e->picture_count; p++)
                if (group[p] == g) {
                    sum += e->log_gain[p][c];
                    count++;
                }
            for (int p = g; count && p < e->picture_count; p++)
                if (group[p] == g)
                    e->log_gain[p][c] -= sum / count;
        }
}

// Gauss and Seidel's iteration, from the gains there are.
static enum status solve(struct exposure *e)
{
    struct pair_lists lists = {0};
    const enum status status = list_pairs(e, &lists);
    for (int step = 0; status == OK && step < SWEEPS * e->picture_count; step++) {
        const int p = step % e->picture_count;
        double sum[3] = {0}, weights[3];
        for (int c = 0; c < 3; c++)
            weights[c] = 1 / (SIGMA_GAIN * SIGMA_GAIN);
        for (int i = lists.first[p]; i >= 0; i = lists.next[i]) {
            const struct exposure_pair *pair = &e->pairs[i / 2];
            for (int c = 0; c < 3; c++) {
                weights[c] += pair->information[c];
                sum[c] += pair->information[c] * (i & 1 ? e->log_gain[pair->a][c] - pair->log_ratio[c]
                                                        : e->log_gain[pair->b][c] + pair->log_ratio[c]);
            }
        }
        for (int c = 0; c < 3; c++)
            e->log_gain[p][c] = sum[c] / weights[c];
    }
    if (status == OK)
        centre(e, lists.first);
    free(lists.first);
    free(lists.next);
    return status;
}

// Compares a picture with the nearest others. Returns how many comparisons came.
static enum status compare(struct exposure *e, const struct surround_picture *all,
                           const struct surround_picture *const *some, int count, int one, int *added)
{
    const int a = (int)(some[one] - all);
    for (int reach = 1; reach < count && count_of(e, a) < COMPARED; reach++)
        for (int side = -1; side <= 1; side += 2) {
            const int other = one + side * reach;
            if (other < 0 || other >= count || count_of(e, a) >= COMPARED)
                continue;
            const int b = (int)(some[other] - all);
            const enum status status = grow(e, (a > b ? a : b) + 1);
            if (status != OK)
                return status;
            if (is_met(e, a, b))
                continue;
            struct exposure_pair *pair = &e->pairs[e->pair_count++];
            *pair = (struct exposure_pair){.a = a, .b = b};
            measure(some[one], some[other], pair);
            ++*added;
        }
    return OK;
}

enum status exposure_even(struct exposure *e, struct surround_picture *all, const struct surround_picture *const *some,
                          int count)
{
    int added = 0;
    enum status status = OK;
    for (int i = 0; i < count && status == OK; i++)
        status = compare(e, all, some, count, i, &added);
    if (status == OK && added)
        status = solve(e);
    for (int p = 0; status == OK && added && p < e->picture_count; p++)
        for (int c = 0; c < 3; c++)
            all[p].gain[c] = (float)portable_exp(e->log_gain[p][c]);
    return status;
}

void exposure_suit_view(const struct exposure *e, struct surround_picture *all,
                        const struct surround_picture *const *ranked, int count, int near, struct pose world_from_view)
{
    const double last = near < count ? surround_view_distance(world_from_view, ranked[near]) + NEAR_M : INFINITY;
    double own[3] = {0}, weights = 1e-12;
    for (int i = 0; i < near; i++) {
        const ptrdiff_t p = ranked[i] - all;
        const double away = surround_view_distance(world_from_view, ranked[i]) + NEAR_M;
        // Shepard's weights, 1968; where all are as far as the next, they count alike
        const double weight = 1 / (away * away) - (1 - 1e-6) / (last * last);
        if (p >= e->picture_count)
            continue;
        weights += weight;
        for (int c = 0; c < 3; c++)
            own[c] += weight * e->log_gain[p][c];
    }
    for (int p = 0; p < e->picture_count; p++)
        for (int c = 0; c < 3; c++)
            all[p].gain[c] = (float)portable_exp(e->log_gain[p][c] - own[c] / weights);
}
