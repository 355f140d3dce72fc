// Which of the layers' depths a pixel has, by the view-dependent depth test.
#include "surround/view/view_merge.h"

#include "base/clamp.h"
#include "base/portable_math.h"
#include "surround/picture/picture_lanes.h"
#include "surround/view/view_layers.h"

#include <stddef.h>
#include <stdlib.h>

// ---------------------------------------------------------------- exposure

// Chosen by hand: points looked at; fewest that make a ratio; levels that are neither dark nor saturated; the pull to
// 1, as a standard deviation of the gain's logarithm; so many neighbouring points count as one; sweeps of the solver.
enum { GRID = 40, FEWEST = 40, DARKEST = 12, BRIGHTEST = 243, COMPARED = 4, ALIKE = 4, SWEEPS = 200 };
#define SIGMA_GAIN 0.5
#define SIGMA_PAIR 0.004 // a ratio is never better than this
#define NEAR_M     0.05  // pictures nearer to a view than this count alike; as far as poses may be off

void exposure_free(struct exposure *exposure)
{
    free(exposure->pairs);
    free(exposure->log_gain);
    *exposure = (struct exposure){0};
}

static enum status grow_exposure(struct exposure *exposure, int pictures)
{
    if (pictures > exposure->picture_capacity) {
        const int capacity = pictures * 2 + 16;
        double(*gains)[3] = realloc(exposure->log_gain, (size_t)capacity * sizeof *gains);
        if (!gains)
            return fail(ERR_MEMORY, "no memory for exposure");
        exposure->log_gain = gains;
        exposure->picture_capacity = capacity;
    }
    for (; exposure->picture_count < pictures; exposure->picture_count++)
        for (int c = 0; c < 3; c++)
            exposure->log_gain[exposure->picture_count][c] = 0;
    if (exposure->pair_count + COMPARED > exposure->pair_capacity) {
        const int capacity = exposure->pair_capacity * 2 + 64;
        struct exposure_pair *pairs = realloc(exposure->pairs, (size_t)capacity * sizeof *pairs);
        if (!pairs)
            return fail(ERR_MEMORY, "no memory for exposure");
        exposure->pairs = pairs;
        exposure->pair_capacity = capacity;
    }
    return OK;
}

// Mean of 3 x 3 pixels. False: at the edge, dark or saturated.
static bool mean_colour(const struct surround_picture *picture, float u, float v, double out[3])
{
    const int x = (int)floorf(u + 0.5f), y = (int)floorf(v + 0.5f);
    if (x < 1 || y < 1 || x + 1 >= picture->width || y + 1 >= picture->height)
        return false;
    int sum[3] = {0};
    for (int k = 0; k < 9; k++) {
        const size_t at = (size_t)(y + k / 3 - 1) * (size_t)picture->width + (size_t)(x + k % 3 - 1);
        for (size_t c = 0; c < 3; c++) {
            const int value = picture->rgb[3 * at + c];
            if (value < DARKEST || value > BRIGHTEST)
                return false;
            sum[c] += value;
        }
    }
    for (int c = 0; c < 3; c++)
        out[c] = sum[c] / 9.0;
    return true;
}

static int compare_doubles(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double find_median(double *list, int count)
{
    qsort(list, (size_t)count, sizeof *list, compare_doubles);
    return list[count / 2];
}

static void measure_pair(const struct surround_picture *a, const struct surround_picture *b, struct exposure_pair *out)
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
        const double middle = find_median(ratios[k], n);
        for (int i = 0; i < n; i++)
            ratios[k][i] = fabs(ratios[k][i] - middle);
        const double sigma = 1.4826 * find_median(ratios[k], n); // of a normal distribution from the median deviation
        // A median's variance is pi / 2 times the mean's
        out->log_ratio[k] = middle;
        out->information[k] = 1 / (1.5708 * sigma * sigma * ALIKE / n + SIGMA_PAIR * SIGMA_PAIR);
    }
}

static bool is_met(const struct exposure *exposure, int a, int b)
{
    for (int i = 0; i < exposure->pair_count; i++)
        if ((exposure->pairs[i].a == a && exposure->pairs[i].b == b) ||
            (exposure->pairs[i].a == b && exposure->pairs[i].b == a))
            return true;
    return false;
}

static int count_of(const struct exposure *exposure, int picture)
{
    int n = 0;
    for (int i = 0; i < exposure->pair_count; i++)
        n += exposure->pairs[i].a == picture || exposure->pairs[i].b == picture;
    return n;
}

// The pairs of each picture as lists: next[2 * pair + side] follows in the list of the pair's a (side 0) or b (side 1).
struct pair_lists {
    int *first, *next; // -1 ends a list
};

static enum status list_pairs(const struct exposure *exposure, struct pair_lists *out)
{
    out->first = malloc(((size_t)exposure->picture_count + 1) * sizeof *out->first);
    out->next = malloc((2 * (size_t)exposure->pair_count + 1) * sizeof *out->next);
    if (!out->first || !out->next)
        return fail(ERR_MEMORY, "no memory for exposure");
    for (int p = 0; p < exposure->picture_count; p++)
        out->first[p] = -1;
    for (int i = 0; i < 2 * exposure->pair_count; i++) {
        const int p = i & 1 ? exposure->pairs[i / 2].b : exposure->pairs[i / 2].a;
        if (!exposure->pairs[i / 2].measured)
            continue;
        out->next[i] = out->first[p];
        out->first[p] = i;
    }
    return OK;
}

// The sum of the logarithms of those that are compared with each other, directly or not, is made 0: the iteration comes
// to that only slowly. group: of picture_count, overwritten.
static void centre_gains(struct exposure *exposure, int *group)
{
    for (int p = 0; p < exposure->picture_count; p++)
        group[p] = p;
    for (bool changed = true; changed;) {
        changed = false;
        for (int i = 0; i < exposure->pair_count; i++) {
            const struct exposure_pair *pair = &exposure->pairs[i];
            const int min = group[pair->a] < group[pair->b] ? group[pair->a] : group[pair->b];
            if (!pair->measured || group[pair->a] == group[pair->b])
                continue;
            group[pair->a] = group[pair->b] = min;
            changed = true;
        }
    }
    for (int g = 0; g < exposure->picture_count; g++)
        for (int c = 0; c < 3; c++) {
            double sum = 0;
            int count = 0;
            for (int p = g; p < exposure->picture_count; p++)
                if (group[p] == g) {
                    sum += exposure->log_gain[p][c];
                    count++;
                }
            for (int p = g; count && p < exposure->picture_count; p++)
                if (group[p] == g)
                    exposure->log_gain[p][c] -= sum / count;
        }
}

// Gauss and Seidel's iteration, from the gains there are.
static enum status solve_gains(struct exposure *exposure)
{
    struct pair_lists lists = {0};
    const enum status status = list_pairs(exposure, &lists);
    for (int step = 0; status == OK && step < SWEEPS * exposure->picture_count; step++) {
        const int p = step % exposure->picture_count;
        double sum[3] = {0}, weights[3];
        for (int c = 0; c < 3; c++)
            weights[c] = 1 / (SIGMA_GAIN * SIGMA_GAIN);
        for (int i = lists.first[p]; i >= 0; i = lists.next[i]) {
            const struct exposure_pair *pair = &exposure->pairs[i / 2];
            for (int c = 0; c < 3; c++) {
                weights[c] += pair->information[c];
                sum[c] += pair->information[c] * (i & 1 ? exposure->log_gain[pair->a][c] - pair->log_ratio[c]
                                                        : exposure->log_gain[pair->b][c] + pair->log_ratio[c]);
            }
        }
        for (int c = 0; c < 3; c++)
            exposure->log_gain[p][c] = sum[c] / weights[c];
    }
    if (status == OK)
        centre_gains(exposure, lists.first);
    free(lists.first);
    free(lists.next);
    return status;
}

// Compares a picture with the nearest others. Returns how many comparisons came.
static enum status compare_picture(struct exposure *exposure, const struct surround_picture *all,
                                   const struct surround_picture *const *some, int count, int one, int *added)
{
    const int a = (int)(some[one] - all);
    for (int reach = 1; reach < count && count_of(exposure, a) < COMPARED; reach++)
        for (int side = -1; side <= 1; side += 2) {
            const int other = one + side * reach;
            if (other < 0 || other >= count || count_of(exposure, a) >= COMPARED)
                continue;
            const int b = (int)(some[other] - all);
            const enum status status = grow_exposure(exposure, (a > b ? a : b) + 1);
            if (status != OK)
                return status;
            if (is_met(exposure, a, b))
                continue;
            struct exposure_pair *pair = &exposure->pairs[exposure->pair_count++];
            *pair = (struct exposure_pair){.a = a, .b = b};
            measure_pair(some[one], some[other], pair);
            ++*added;
        }
    return OK;
}

enum status exposure_even(struct exposure *exposure, struct surround_picture *all,
                          const struct surround_picture *const *some, int count)
{
    int added = 0;
    enum status status = OK;
    for (int i = 0; i < count && status == OK; i++)
        status = compare_picture(exposure, all, some, count, i, &added);
    if (status == OK && added)
        status = solve_gains(exposure);
    for (int p = 0; status == OK && added && p < exposure->picture_count; p++)
        for (int c = 0; c < 3; c++)
            all[p].gain[c] = (float)portable_exp(exposure->log_gain[p][c]);
    return status;
}

void exposure_suit_view(const struct exposure *exposure, struct surround_picture *all,
                        const struct surround_picture *const *ranked, int count, int near, struct pose world_from_view)
{
    const double last = near < count ? surround_view_distance(world_from_view, ranked[near]) + NEAR_M : INFINITY;
    double own[3] = {0}, weights = 1e-12;
    for (int i = 0; i < near; i++) {
        const ptrdiff_t p = ranked[i] - all;
        const double away = surround_view_distance(world_from_view, ranked[i]) + NEAR_M;
        // Shepard's weights, 1968; where all are as far as the next, they count alike
        const double weight = 1 / (away * away) - (1 - 1e-6) / (last * last);
        if (p >= exposure->picture_count)
            continue;
        weights += weight;
        for (int c = 0; c < 3; c++)
            own[c] += weight * exposure->log_gain[p][c];
    }
    for (int p = 0; p < exposure->picture_count; p++)
        for (int c = 0; c < 3; c++)
            all[p].gain[c] = (float)portable_exp(exposure->log_gain[p][c] - own[c] / weights);
}

// ---------------------------------------------------------------- view merge

// The nearest and farthest of the 3 x 3 pixels around a point decide, so that an edge a pixel off is no contradiction.
enum sight picture_sight(const struct surround_picture *picture, const struct picture_point *at, float apart)
{
    const int u = floor_of(at->u + 0.5f), v = floor_of(at->v + 0.5f);
    const float wanted = 1 / at->distance;
    float min = 1e9f, max = DEPTH_UNKNOWN;
    for (int j = -1; j <= 1; j++)
        for (int i = -1; i <= 1; i++) {
            const int x = surround_picture_column(picture, u + i), y = v + j;
            if (x < 0 || x >= picture->width || y < 0 || y >= picture->height)
                continue;
            const float inverse = picture->inverse[(size_t)y * (size_t)picture->width + (size_t)x];
            if (inverse < 0)
                continue;
            min = inverse < min ? inverse : min;
            max = inverse > max ? inverse : max;
        }
    if (max < 0)
        return SIGHT_UNKNOWN;
    if (min > wanted * (1 + apart) + 1e-4f)
        return SIGHT_HIDDEN;
    return max < wanted * (1 - apart) - 1e-4f ? SIGHT_THROUGH : SIGHT_SEEN;
}

// Where so much of the weight looks through every candidate, no picture has seen what is there: a wall was continued
// too far. Of 0.6, 0.75 and 0.85, on 24 views of a robot's corridor, the least that drew the seen pixels
// best: 25.9, 26.0, 26.1 dB, with 0.67, 0.61, 0.57 of the unseen marked (before unsupported surfaces were left out).
#define MAX_THROUGH 0.75

// A surface that at most so much of the weight looks through is taken.
#define HALF 0.5

struct candidate {
    float inverse_z;
    int layer;
};

enum { MAX_ASKED = 8 };   // the nearest pictures are asked what they see of a candidate
#define CONTRADICTS 0.03f // what is farther behind it than this share is another surface

// The four pixels around a point, of which the first is the cell's (joined[]).
static void pixels_around(const struct surround_picture *picture, const struct picture_point *at, size_t pixels[4])
{
    const int u = floor_of(at->u), v = floor_of(at->v), last = picture->width - 1;
    const size_t left = (size_t)clamp_int(surround_picture_column(picture, u), 0, last);
    const size_t right = (size_t)clamp_int(surround_picture_column(picture, u + 1), 0, last);
    const size_t above = (size_t)(v > 0 ? v : 0) * (size_t)picture->width;
    const size_t below = (size_t)(v + 1 < picture->height ? v + 1 : picture->height - 1) * (size_t)picture->width;
    pixels[0] = above + left, pixels[1] = above + right;
    pixels[2] = below + left, pixels[3] = below + right;
}

// Whether one of them is farther than the point.
static bool may_look_through(const struct surround_picture *picture, const struct picture_point *at)
{
    const float bound = 1 / at->distance * (1 - CONTRADICTS) - 1e-4f;
    size_t pixels[4];
    pixels_around(picture, at, pixels);
    for (int k = 0; k < 4; k++)
        if (picture->inverse[pixels[k]] >= 0 && picture->inverse[pixels[k]] < bound)
            return true;
    return false;
}

// How much of a picture at a point looks through it, and how much sees it; the rest is hidden from it or not known.
struct votes {
    float through, seen;
};

// By the share of the four pixels around: the edges of several pictures' pixels then make one that is finer than each.
// A surface is compared where the point is on it, not at its pixels, which on the road far ahead differ by more.
static struct votes votes_of(const struct surround_picture *picture, const struct picture_point *at)
{
    const float fu = at->u - (float)floor_of(at->u), fv = at->v - (float)floor_of(at->v);
    const float wanted = 1 / at->distance;
    struct votes out = {0, 0};
    size_t pixels[4];
    float value[4];
    pixels_around(picture, at, pixels);
    for (int k = 0; k < 4; k++)
        value[k] = picture->inverse[pixels[k]];
    if (at->v >= 0 && picture->joined[pixels[0]] & JOINED_DIAGONAL) {
        const float one = (1 - fv) * ((1 - fu) * value[0] + fu * value[1]) + fv * ((1 - fu) * value[2] + fu * value[3]);
        for (int k = 0; k < 4; k++)
            value[k] = one;
    }
    for (int k = 0; k < 4; k++) {
        if (value[k] < 0 || value[k] > wanted * (1 + CONTRADICTS) + 1e-4f)
            continue;
        const float share = (k & 1 ? fu : 1 - fu) * (k & 2 ? fv : 1 - fv);
        *(value[k] < wanted * (1 - CONTRADICTS) - 1e-4f ? &out.through : &out.seen) += share;
    }
    return out;
}

// Error of a candidate by equation 1: the share, weighted by 1 / angle, of the pictures that look through it; those
// that are hidden from it say nothing.
static double error_of(const struct surround_view *view, const struct surround_picture *const *pictures, int count,
                       int pixel, float inverse_z)
{
    double world[3], sum = 0, weights = 0;
    struct picture_point seen[MAX_ASKED];
    bool inside[MAX_ASKED], through = false;
    surround_view_point(view, pixel % view->lens.width, pixel / view->lens.width, inverse_z, world);
    for (int i = 0; i < count; i++) {
        inside[i] = surround_picture_project(pictures[i], world, &seen[i]);
        through |= inside[i] && may_look_through(pictures[i], &seen[i]);
    }
    if (!through) // as in most pixels, whatever the weights
        return 0;
    const struct vec3 at = v3(world[0], world[1], world[2]);
    const struct vec3 to_view = v3_unit(v3_sub(view->world_from_view.translation, at));
    for (int i = 0; i < count; i++) {
        const struct votes votes = inside[i] ? votes_of(pictures[i], &seen[i]) : (struct votes){0, 0};
        const struct vec3 to_picture = v3_unit(v3_sub(pictures[i]->world_from_camera.translation, at));
        const double sine = v3_length(v3_cross(to_view, to_picture)) + 0.05;
        weights += (double)(votes.through + votes.seen) / sine;
        sum += (double)votes.through / sine;
    }
    return weights > 0 ? sum / weights : 0;
}

// Sorted from the nearest; returns how many.
static int collect_candidates(const float *layers, size_t pixels, int count, size_t pixel, struct candidate *out)
{
    int n = 0;
    for (int l = 0; l < count; l++) {
        const float value = layers[(size_t)l * pixels + pixel];
        if (value < 0)
            continue;
        int at = n++;
        for (; at > 0 && out[at - 1].inverse_z < value; at--)
            out[at] = out[at - 1];
        out[at] = (struct candidate){value, l};
    }
    return n;
}

// The end of the surface that begins at candidate `from`.
static int surface_end(const struct candidate *candidate, int count, int from, double apart)
{
    int end = from + 1;
    while (end < count && candidate[end].inverse_z >= (float)(1 - apart) * candidate[from].inverse_z - 1e-4f)
        end++;
    return end;
}

// The mean of a surface's depths, the nearer pictures (lower layers) counting more.
static struct candidate surface_mean(const struct candidate *candidate, int from, int end)
{
    double sum = 0, weights = 0;
    struct candidate out = candidate[from];
    for (int i = from; i < end; i++) {
        const double w = 1.0 / (1 + candidate[i].layer);
        sum += w * (double)candidate[i].inverse_z;
        weights += w;
        out.layer = candidate[i].layer < out.layer ? candidate[i].layer : out.layer;
    }
    out.inverse_z = (float)(sum / weights);
    return out;
}

// Whether any picture has something farther at four points, each the first candidate of a pixel; of lanes without one
// the answer means nothing.
static four_ints looked_through(const struct surround_view *view, const struct surround_picture *const *pictures,
                                int count, const int pixels[4], four inverse_z)
{
    four_doubles world[3];
    four_ints through = {0};
    for (int l = 0; l < 4; l++) {
        double at[3];
        surround_view_point(view, pixels[l] % view->lens.width, pixels[l] / view->lens.width, inverse_z[l], at);
        for (int i = 0; i < 3; i++)
            world[i][l] = at[i];
    }
    for (int i = 0; i < count; i++) {
        struct four_points found;
        four camera[3];
        surround_picture_distances(pictures[i], world, camera, &found);
        surround_picture_find_four(pictures[i], camera, &found);
        for (int l = 0; l < 4; l++) {
            const struct picture_point at = {found.u[l], found.v[l], found.distance[l]};
            if (!through[l] && found.inside[l] && may_look_through(pictures[i], &at))
                through[l] = -1;
        }
    }
    return through;
}

// Whether any of the pictures asked sees a world point or looks through it; else it is occluded, or not known, in all.
static bool is_observed(const struct surround_picture *const *pictures, int asked, const double world[3])
{
    for (int i = 0; i < asked; i++) {
        struct picture_point at;
        if (!surround_picture_project(pictures[i], world, &at))
            continue;
        const struct votes votes = votes_of(pictures[i], &at);
        if (votes.seen + votes.through > 0)
            return true;
    }
    return false;
}

// Whether one of a surface's own pictures has points near it, and does not only continue what is beside it.
static bool is_measured(const struct surround_picture *const *pictures, const struct candidate *candidate, int count,
                        const double world[3])
{
    for (int i = 0; i < count; i++) {
        const struct surround_picture *p = pictures[candidate[i].layer];
        struct picture_point at;
        size_t pixels[4];
        if (!surround_picture_project(p, world, &at))
            continue;
        pixels_around(p, &at, pixels);
        for (int k = 0; k < 4; k++)
            if (p->inverse[pixels[k]] >= 0 && !(p->joined[pixels[k]] & DEPTH_EXTRAPOLATED))
                return true;
    }
    return false;
}

struct column { // of a pixel: what the layers have there
    struct candidate list[SURROUND_MAX_LAYERS];
    int count, end; // of its first surface
    struct candidate first;
};

// A surface that only pictures have that are too far to be asked, extrapolated in all of them, and occluded in every
// picture asked: nothing supports it, such as a wall extended behind a box.
static bool is_unsupported(const struct surround_picture *const *pictures, int asked, const struct candidate *candidate,
                           int count, const double world[3])
{
    return !is_observed(pictures, asked, world) && !is_measured(pictures, candidate, count, world);
}

// through: whether a picture may look through the first surface.
static void decide_pixel(struct surround_view *view, const struct surround_picture *const *pictures, int asked,
                         int pixel, const struct column *column, bool through, const struct view_options *options)
{
    struct candidate best = {0};
    double min = 2; // more than any error
    for (int from = 0, end; from < column->count && min > HALF; from = end) {
        end = from ? surface_end(column->list, column->count, from, options->apart) : column->end;
        const struct candidate mean = from ? surface_mean(column->list, from, end) : column->first;
        if (options->depth_test && mean.layer >= asked) { // few: the point is not made for the others
            double world[3];
            surround_view_point(view, pixel % view->lens.width, pixel / view->lens.width, mean.inverse_z, world);
            if (is_unsupported(pictures, asked, column->list + from, end - from, world))
                continue;
        }
        const bool test = options->depth_test && (from || through);
        const double error = test ? error_of(view, pictures, asked, pixel, mean.inverse_z) : 0;
        if (error < min) {
            min = error;
            best = mean;
        }
    }
    if (min > 1 || (options->depth_test && min > MAX_THROUGH))
        return;
    view->inverse_z[pixel] = best.inverse_z;
    view->first[pixel] = (int16_t)best.layer;
}

void view_merge(struct surround_view *view, const struct surround_picture *const *pictures, const float *layers,
                int count, const struct view_options *options)
{
    const size_t pixels = (size_t)view->lens.width * (size_t)view->lens.height;
    const int asked = count < MAX_ASKED ? count : MAX_ASKED;
    struct column columns[4];
    for (size_t i = 0; i < pixels; i += 4) {
        int at[4];
        four inverse_z = FOUR(1.0f);
        four_ints through = {0};
        bool any = false;
        for (int l = 0; l < 4; l++) {
            struct column *c = &columns[l];
            at[l] = (int)(i + (size_t)l < pixels ? i + (size_t)l : pixels - 1);
            c->count = collect_candidates(layers, pixels, count, (size_t)at[l], c->list);
            view->inverse_z[at[l]] = DEPTH_UNKNOWN;
            view->first[at[l]] = -1;
            if (!c->count)
                continue;
            c->end = surface_end(c->list, c->count, 0, options->apart);
            c->first = surface_mean(c->list, 0, c->end);
            inverse_z[l] = c->first.inverse_z;
            any = true;
        }
        if (options->depth_test && any)
            through = looked_through(view, pictures, asked, at, inverse_z);
        for (int l = 0; l < 4; l++)
            decide_pixel(view, pictures, asked, at[l], &columns[l], through[l], options);
    }
}
