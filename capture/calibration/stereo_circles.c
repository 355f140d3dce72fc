#include "capture/calibration/stereo_circles.h"

#include <stdlib.h>
#include <string.h>

// Chosen by hand: the window of the mean is wider than any circle with its surroundings; DARKER in grey levels.
enum { WINDOW_SHARE = 8, DARKER = 20, LEAST_AREA_PX = 12, LEAST_CONTRAST = 40, SEEDS = 24 };

struct detector {
    const uint8_t *gray;
    int width, height;
    uint32_t *sums; // (width + 1) x (height + 1)
    int32_t *label; // 0: not dark, 1: dark, not visited, 2: visited
    int32_t *stack;
    struct circle *blobs;
    int blob_count;
    float contrast[STEREO_MOST_CIRCLES]; // of each blob, grey levels
};

static void sum_rows(struct detector *d)
{
    const size_t stride = (size_t)d->width + 1;
    memset(d->sums, 0, stride * sizeof *d->sums);
    for (int y = 0; y < d->height; y++) {
        uint32_t *row = d->sums + (size_t)(y + 1) * stride, sum = 0;
        row[0] = 0;
        for (int x = 0; x < d->width; x++) {
            sum += d->gray[(size_t)y * (size_t)d->width + (size_t)x];
            row[x + 1] = row[x + 1 - (ptrdiff_t)stride] + sum;
        }
    }
}

static void mark_dark(struct detector *d)
{
    const int reach = d->width / WINDOW_SHARE / 2;
    const size_t stride = (size_t)d->width + 1;
    for (int y = 0; y < d->height; y++) {
        const int y0 = y > reach ? y - reach : 0, y1 = y + reach + 1 < d->height ? y + reach + 1 : d->height;
        for (int x = 0; x < d->width; x++) {
            const int x0 = x > reach ? x - reach : 0, x1 = x + reach + 1 < d->width ? x + reach + 1 : d->width;
            const uint32_t sum = d->sums[(size_t)y1 * stride + (size_t)x1] - d->sums[(size_t)y0 * stride + (size_t)x1] -
                                 d->sums[(size_t)y1 * stride + (size_t)x0] + d->sums[(size_t)y0 * stride + (size_t)x0];
            const int mean = (int)(sum / (uint32_t)((x1 - x0) * (y1 - y0)));
            const size_t i = (size_t)y * (size_t)d->width + (size_t)x;
            d->label[i] = d->gray[i] + DARKER < mean;
        }
    }
}

struct box {
    int x0, y0, x1, y1; // inclusive
    int area, darkest;
};

// The dark component of pixel `start`, marked as visited.
static struct box fill(struct detector *d, int start)
{
    struct box b = {d->width, d->height, -1, -1, 0, 255};
    int top = 0;
    d->stack[top++] = start;
    d->label[start] = 2;
    while (top) {
        const int i = d->stack[--top], x = i % d->width, y = i / d->width;
        b.x0 = x < b.x0 ? x : b.x0;
        b.x1 = x > b.x1 ? x : b.x1;
        b.y0 = y < b.y0 ? y : b.y0;
        b.y1 = y > b.y1 ? y : b.y1;
        b.area++;
        b.darkest = d->gray[i] < b.darkest ? d->gray[i] : b.darkest;
        const int next[4] = {x > 0 ? i - 1 : -1, x + 1 < d->width ? i + 1 : -1, y > 0 ? i - d->width : -1,
                             y + 1 < d->height ? i + d->width : -1};
        for (int k = 0; k < 4; k++)
            if (next[k] >= 0 && d->label[next[k]] == 1) {
                d->label[next[k]] = 2;
                d->stack[top++] = next[k];
            }
    }
    return b;
}

// The grey level of the paper round a box: the mean of the brighter half of the box's margin.
static double paper_level(const struct detector *d, const struct box *b)
{
    int histogram[256] = {0}, n = 0;
    for (int y = b->y0; y <= b->y1; y++)
        for (int x = b->x0; x <= b->x1; x++)
            if (y == b->y0 || y == b->y1 || x == b->x0 || x == b->x1) {
                histogram[d->gray[(size_t)y * (size_t)d->width + (size_t)x]]++;
                n++;
            }
    double sum = 0;
    int taken = 0;
    for (int level = 255; level >= 0 && taken < n / 2; level--) {
        sum += (double)level * histogram[level];
        taken += histogram[level];
    }
    return taken ? sum / taken : 0;
}

// Centroid and area weighted by darkness; false: not the image of a disc.
static bool measure(struct detector *d, const struct box *component, struct circle *out)
{
    const struct box b = {component->x0 - 3, component->y0 - 3, component->x1 + 3, component->y1 + 3, 0, 0};
    if (component->x0 <= 0 || component->y0 <= 0 || component->x1 >= d->width - 1 || component->y1 >= d->height - 1)
        return false; // cut off
    if (b.x0 < 0 || b.y0 < 0 || b.x1 >= d->width || b.y1 >= d->height)
        return false;
    const double paper = paper_level(d, &b), ink = component->darkest;
    if (paper - ink < LEAST_CONTRAST)
        return false;
    d->contrast[d->blob_count] = (float)(paper - ink);
    double m = 0, mx = 0, my = 0, mxx = 0, mxy = 0, myy = 0;
    for (int y = b.y0; y <= b.y1; y++)
        for (int x = b.x0; x <= b.x1; x++) {
            double w = (paper - d->gray[(size_t)y * (size_t)d->width + (size_t)x]) / (paper - ink);
            if (w > 1)
                w = 1;
            else if (w < 0.06) // the paper's noise
                w = 0;
            m += w;
            mx += w * x;
            my += w * y;
            mxx += w * x * x;
            mxy += w * x * y;
            myy += w * y * y;
        }
    *out = (struct circle){{mx / m, my / m}, m, 0, 0};
    mxx = mxx / m - out->at.x * out->at.x;
    mxy = mxy / m - out->at.x * out->at.y;
    myy = myy / m - out->at.y * out->at.y;
    const double half = (mxx + myy) / 2, split = sqrt((mxx - myy) * (mxx - myy) / 4 + mxy * mxy);
    if (half - split < 0.25 || (half + split) / (half - split) > 16)
        return false; // narrower than 2 pixels, or four times as long as wide
    const double ellipse = 4 * 3.14159265358979 * sqrt(mxx * myy - mxy * mxy); // its area, if it is one
    return m > 0.85 * ellipse && m < 1.1 * ellipse;
}

static void find_blobs(struct detector *d)
{
    for (int i = 0; i < d->width * d->height && d->blob_count < STEREO_MOST_CIRCLES; i++) {
        if (d->label[i] != 1)
            continue;
        const struct box b = fill(d, i);
        if (b.area >= LEAST_AREA_PX && b.area < d->width * d->height / 20 && measure(d, &b, &d->blobs[d->blob_count]))
            d->blob_count++;
    }
}

static int compare_floats(const void *a, const void *b)
{
    const float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

// Printed circles are all equally dark. The corner of the board's white edge before a grey wall looks like a blob, too.
static void drop_faint_blobs(struct detector *d)
{
    float sorted[STEREO_MOST_CIRCLES];
    int kept = 0;
    memcpy(sorted, d->contrast, (size_t)d->blob_count * sizeof *sorted);
    qsort(sorted, (size_t)d->blob_count, sizeof *sorted, compare_floats);
    const float least = d->blob_count ? 0.65F * sorted[d->blob_count / 2] : 0;
    for (int i = 0; i < d->blob_count; i++)
        if (d->contrast[i] >= least)
            d->blobs[kept++] = d->blobs[i];
    d->blob_count = kept;
}

static double distance2(struct pixel a, struct pixel b)
{
    return (a.x - b.x) * (a.x - b.x) + (a.y - b.y) * (a.y - b.y);
}

static int nearest(const struct detector *d, struct pixel at, int except)
{
    int best = -1;
    for (int i = 0; i < d->blob_count; i++)
        if (i != except && (best < 0 || distance2(d->blobs[i].at, at) < distance2(d->blobs[best].at, at)))
            best = i;
    return best;
}

// A lattice being grown: at[i] of blob i.
struct lattice {
    bool taken[STEREO_MOST_CIRCLES];
    int column[STEREO_MOST_CIRCLES], row[STEREO_MOST_CIRCLES];
    struct pixel step[STEREO_MOST_CIRCLES][2]; // to the next column, to the next row
    int queue[STEREO_MOST_CIRCLES], count;
};

static struct pixel mirrored(struct pixel at, struct pixel about)
{
    return (struct pixel){2 * about.x - at.x, 2 * about.y - at.y};
}

// The two steps at a blob that has a neighbour on each of four sides.
static bool seed_steps(const struct detector *d, int seed, struct pixel step[2])
{
    const struct pixel at = d->blobs[seed].at;
    const int a = nearest(d, at, seed);
    if (a < 0)
        return false;
    const struct pixel u = {d->blobs[a].at.x - at.x, d->blobs[a].at.y - at.y};
    const double length2 = distance2(d->blobs[a].at, at);
    const int back = nearest(d, mirrored(d->blobs[a].at, at), seed);
    if (back < 0 || distance2(d->blobs[back].at, mirrored(d->blobs[a].at, at)) > 0.06 * length2)
        return false;
    int across = -1; // the nearest that is off the line of u
    for (int i = 0; i < d->blob_count; i++) {
        const struct pixel v = {d->blobs[i].at.x - at.x, d->blobs[i].at.y - at.y};
        const double cross = u.x * v.y - u.y * v.x;
        if (i != seed && cross > 0.5 * sqrt(length2) * sqrt(v.x * v.x + v.y * v.y) &&
            (across < 0 || distance2(d->blobs[i].at, at) < distance2(d->blobs[across].at, at)))
            across = i;
    }
    if (across < 0)
        return false;
    step[0] = u;
    step[1] = (struct pixel){d->blobs[across].at.x - at.x, d->blobs[across].at.y - at.y};
    return distance2(step[1], (struct pixel){0, 0}) < 9 * length2;
}

static void take(struct lattice *l, int blob, int column, int row)
{
    l->taken[blob] = true;
    l->column[blob] = column;
    l->row[blob] = row;
    l->queue[l->count++] = blob;
}

static void grow(const struct detector *d, int seed, const struct pixel step[2], struct lattice *l)
{
    memset(l->taken, 0, sizeof l->taken);
    l->count = 0;
    take(l, seed, 0, 0);
    memcpy(l->step[seed], step, sizeof l->step[seed]);
    for (int next = 0; next < l->count; next++) {
        const int blob = l->queue[next];
        const struct pixel at = d->blobs[blob].at;
        for (int side = 0; side < 4; side++) {
            const int axis = side / 2, sign = side % 2 ? -1 : 1;
            const struct pixel s = l->step[blob][axis];
            const struct pixel want = {at.x + sign * s.x, at.y + sign * s.y};
            const int found = nearest(d, want, blob);
            const double size2 = s.x * s.x + s.y * s.y;
            if (found < 0 || l->taken[found] || distance2(d->blobs[found].at, want) > 0.09 * size2)
                continue;
            const double growth = d->blobs[found].area_px / d->blobs[blob].area_px;
            if (growth < 0.65 || growth > 1.55)
                continue;
            take(l, found, l->column[blob] + (axis ? 0 : sign), l->row[blob] + (axis ? sign : 0));
            memcpy(l->step[found], l->step[blob], sizeof l->step[found]);
            l->step[found][axis] =
                (struct pixel){sign * (d->blobs[found].at.x - at.x), sign * (d->blobs[found].at.y - at.y)};
        }
    }
}

static int write_lattice(const struct detector *d, const struct lattice *l, struct circle *out)
{
    int column = 0, row = 0;
    for (int i = 0; i < l->count; i++) {
        column = l->column[l->queue[i]] < column ? l->column[l->queue[i]] : column;
        row = l->row[l->queue[i]] < row ? l->row[l->queue[i]] : row;
    }
    for (int i = 0; i < l->count; i++) {
        const int blob = l->queue[i];
        out[i] = d->blobs[blob];
        out[i].column = l->column[blob] - column;
        out[i].row = l->row[blob] - row;
    }
    return l->count;
}

static int order(const struct detector *d, struct lattice *l, struct circle *out)
{
    int best = 0;
    const int stride = d->blob_count / SEEDS + 1;
    for (int seed = 0; seed < d->blob_count; seed += stride) {
        struct pixel step[2];
        if (!seed_steps(d, seed, step))
            continue;
        grow(d, seed, step, l);
        if (l->count > best)
            best = write_lattice(d, l, out);
    }
    return best;
}

enum status stereo_circles_find(const uint8_t *gray, int width, int height, struct circle *out, int *count)
{
    const size_t pixels = (size_t)width * (size_t)height;
    struct detector d = {.gray = gray, .width = width, .height = height};
    d.sums = malloc(((size_t)width + 1) * ((size_t)height + 1) * sizeof *d.sums);
    d.label = malloc(pixels * sizeof *d.label);
    d.stack = malloc(pixels * sizeof *d.stack);
    d.blobs = malloc(STEREO_MOST_CIRCLES * sizeof *d.blobs);
    struct lattice *l = malloc(sizeof *l);
    *count = 0;
    enum status status = OK;
    if (!d.sums || !d.label || !d.stack || !d.blobs || !l) {
        status = fail(ERR_MEMORY, "no memory to look for circles");
    } else {
        sum_rows(&d);
        mark_dark(&d);
        find_blobs(&d);
        drop_faint_blobs(&d);
        *count = order(&d, l, out);
    }
    free(d.sums);
    free(d.label);
    free(d.stack);
    free(d.blobs);
    free(l);
    return status;
}
