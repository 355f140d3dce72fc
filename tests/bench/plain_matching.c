#include "tests/bench/plain_matching.h"

#include "base/portable_math.h"

#include <stdlib.h>
#include <string.h>

// Chosen by hand. EDGE: gradient, grey levels, from which a reduced pixel is an edge. A template of fewer edges says
// nothing.
enum { REDUCTION = 8, EDGE = 24, LEAST_EDGES = 20, KEPT = 8 };

struct plain_options plain_default_options(void)
{
    return (struct plain_options){0.2, 1.2, 1.2, 0.17453292519943295, true};
}

typedef uint8_t bytes16 __attribute__((vector_size(16), aligned(1), may_alias));

int plain_count_both_scalar(const uint8_t *a, const uint8_t *b, int n)
{
    int sum = 0;
    for (int i = 0; i < n; i++)
        sum += a[i] & b[i];
    return sum;
}

int plain_count_both(const uint8_t *a, const uint8_t *b, int n)
{
    int sum = 0, i = 0;
    while (i + 16 <= n) {
        bytes16 lanes = {0};
        for (int k = 0; k < 255 && i + 16 <= n; k++, i += 16) // a lane holds at most 255
            lanes += *(const bytes16 *)(const void *)(a + i) & *(const bytes16 *)(const void *)(b + i);
        for (int k = 0; k < 16; k++)
            sum += lanes[k];
    }
    return sum + plain_count_both_scalar(a + i, b + i, n - i);
}

// Edge pixels as bytes 0 and 1, and the number of them above and left of each pixel.
struct edges {
    int width, height;
    uint8_t *bits;
    int32_t *sums; // (width + 1) x (height + 1); NULL for templates
    int count;
};

static void edges_free(struct edges *e)
{
    free(e->bits);
    free(e->sums);
    *e = (struct edges){0};
}

// Bilinear.
static double sample(const struct gray_picture *p, double x, double y)
{
    x = x < 0 ? 0 : x > p->width - 1 ? p->width - 1 : x;
    y = y < 0 ? 0 : y > p->height - 1 ? p->height - 1 : y;
    const int x0 = (int)x, y0 = (int)y, x1 = x0 + 1 < p->width ? x0 + 1 : x0, y1 = y0 + 1 < p->height ? y0 + 1 : y0;
    const uint8_t *a = p->gray + (size_t)y0 * (size_t)p->width, *b = p->gray + (size_t)y1 * (size_t)p->width;
    const double top = a[x0] + (x - x0) * (a[x1] - a[x0]), low = b[x0] + (x - x0) * (b[x1] - b[x0]);
    return top + (y - y0) * (low - top);
}

// Marks edges of a grey image of small size: the gradient by central differences, its larger component.
static void mark_edges(const uint8_t *small, const uint8_t *inside, struct edges *e)
{
    const int w = e->width;
    e->count = 0;
    memset(e->bits, 0, (size_t)w * (size_t)e->height);
    for (int y = 1; y + 1 < e->height; y++)
        for (int x = 1; x + 1 < w; x++) {
            const int i = y * w + x;
            if (inside && !(inside[i] && inside[i - 1] && inside[i + 1] && inside[i - w] && inside[i + w]))
                continue;
            const int dx = abs(small[i + 1] - small[i - 1]), dy = abs(small[i + w] - small[i - w]);
            e->bits[i] = dx > EDGE || dy > EDGE;
            e->count += e->bits[i];
        }
}

// The picture turned and scaled so that one of its pixels is `scale` pixels; the edges of what is inside.
static enum status make_template(const struct gray_picture *p, double scale, double angle, struct edges *out)
{
    const double c = portable_cos(angle), s = portable_sin(angle);
    const double half_x = scale * (fabs(c) * p->width + fabs(s) * p->height) / 2;
    const double half_y = scale * (fabs(s) * p->width + fabs(c) * p->height) / 2;
    *out = (struct edges){2 * (int)ceil(half_x) + 1, 2 * (int)ceil(half_y) + 1, NULL, NULL, 0};
    const size_t pixels = (size_t)out->width * (size_t)out->height;
    out->bits = malloc(pixels);
    uint8_t *small = malloc(pixels), *inside = malloc(pixels);
    if (!out->bits || !small || !inside) {
        free(small);
        free(inside);
        edges_free(out);
        return fail(ERR_MEMORY, "no memory for a template");
    }
    for (int y = 0; y < out->height; y++)
        for (int x = 0; x < out->width; x++) {
            const double dx = (x - out->width / 2) / scale, dy = (y - out->height / 2) / scale;
            const double u = c * dx + s * dy + (p->width - 1) / 2.0, v = -s * dx + c * dy + (p->height - 1) / 2.0;
            double sum = 0;
            for (int k = 0; k < 4; k++) // four samples, so that it is scaled down without aliasing
                sum += sample(p, u + (k % 2 - 0.5) / 2 / scale, v + (k / 2 - 0.5) / 2 / scale);
            small[y * out->width + x] = (uint8_t)(sum / 4 + 0.5);
            inside[y * out->width + x] = u >= 0 && v >= 0 && u <= p->width - 1 && v <= p->height - 1;
        }
    mark_edges(small, inside, out);
    free(small);
    free(inside);
    return OK;
}

// The image scaled down by whole means.
static enum status reduce(const struct gray_picture *p, int by, struct edges *out)
{
    *out = (struct edges){p->width / by, p->height / by, NULL, NULL, 0};
    const size_t pixels = (size_t)out->width * (size_t)out->height, stride = (size_t)out->width + 1;
    out->bits = malloc(pixels + 1);
    out->sums = calloc(stride * ((size_t)out->height + 1), sizeof *out->sums);
    uint8_t *small = malloc(pixels + 1);
    if (!out->bits || !out->sums || !small) {
        free(small);
        edges_free(out);
        return fail(ERR_MEMORY, "no memory to scale an image down");
    }
    for (int y = 0; y < out->height; y++)
        for (int x = 0; x < out->width; x++) {
            int sum = 0;
            for (int j = 0; j < by; j++)
                for (int i = 0; i < by; i++)
                    sum += p->gray[(size_t)(y * by + j) * (size_t)p->width + (size_t)(x * by + i)];
            small[y * out->width + x] = (uint8_t)((sum + by * by / 2) / (by * by));
        }
    mark_edges(small, NULL, out);
    free(small);
    for (int y = 0; y < out->height; y++)
        for (int x = 0; x < out->width; x++)
            out->sums[(size_t)(y + 1) * stride + (size_t)(x + 1)] =
                out->sums[(size_t)(y + 1) * stride + (size_t)x] + out->sums[(size_t)y * stride + (size_t)(x + 1)] -
                out->sums[(size_t)y * stride + (size_t)x] + out->bits[y * out->width + x];
    return OK;
}

// Score with the template's first pixel at (left, top), which may reach over the image's edge.
static double score_at(const struct edges *t, const struct edges *image, int left, int top)
{
    const int x0 = left > 0 ? left : 0, y0 = top > 0 ? top : 0;
    const int x1 = left + t->width < image->width ? left + t->width : image->width;
    const int y1 = top + t->height < image->height ? top + t->height : image->height;
    int both = 0;
    if (x1 - x0 < 4 || y1 - y0 < 4)
        return 0;
    for (int y = y0; y < y1; y++)
        both += plain_count_both(t->bits + (y - top) * t->width + (x0 - left), image->bits + y * image->width + x0,
                                 x1 - x0);
    const size_t stride = (size_t)image->width + 1;
    const int in_window = image->sums[(size_t)y1 * stride + (size_t)x1] -
                          image->sums[(size_t)y0 * stride + (size_t)x1] -
                          image->sums[(size_t)y1 * stride + (size_t)x0] + image->sums[(size_t)y0 * stride + (size_t)x0];
    return 2.0 * both / (t->count + in_window);
}

struct best {
    struct plain_match match[KEPT];
    int count;
};

static void keep(struct best *b, const struct plain_match *m)
{
    int at = b->count < KEPT ? b->count : KEPT;
    while (at > 0 && b->match[at - 1].score < m->score)
        at--;
    if (at >= KEPT)
        return;
    const int moved = (b->count < KEPT ? b->count : KEPT - 1) - at;
    memmove(&b->match[at + 1], &b->match[at], (size_t)moved * sizeof *m);
    b->match[at] = *m;
    b->count += b->count < KEPT;
}

// All places within `reach` (reduced pixels) of `near`, or everywhere for a negative reach.
static enum status try_template(const struct gray_picture *p, const struct edges *image, int by,
                                struct plain_match near, int reach, struct best *best)
{
    struct edges t;
    enum status status = make_template(p, near.scale / by, near.angle, &t);
    if (status != OK)
        return status;
    if (t.count >= LEAST_EDGES) {
        const int cx = (int)((near.middle.x + 0.5) / by), cy = (int)((near.middle.y + 0.5) / by);
        const int x0 = reach < 0 ? 0 : cx - reach, x1 = reach < 0 ? image->width - 1 : cx + reach;
        const int y0 = reach < 0 ? 0 : cy - reach, y1 = reach < 0 ? image->height - 1 : cy + reach;
        for (int y = y0; y <= y1; y++)
            for (int x = x0; x <= x1; x++) {
                struct plain_match m = near;
                m.score = score_at(&t, image, x - t.width / 2, y - t.height / 2);
                m.middle = (struct pixel){(x + 0.5) * by - 0.5, (y + 0.5) * by - 0.5};
                keep(best, &m);
            }
    }
    edges_free(&t);
    return OK;
}

static enum status search_all(const struct gray_picture *p, const struct edges *image, int by,
                              const struct plain_options *o, struct best *best)
{
    enum status status = OK;
    for (double scale = o->least_scale; scale <= o->most_scale && status == OK; scale *= o->scale_step)
        for (double angle = 0; angle < 6.2831 && status == OK; angle += o->angle_step)
            status = try_template(p, image, by, (struct plain_match){{0, 0}, angle, scale, 0}, -1, best);
    return status;
}

// Each of the best again in a finer image, with angles and scales in between.
static enum status search_near(const struct gray_picture *p, const struct edges *image, int by,
                               const struct plain_options *o, const struct best *coarse, struct best *best)
{
    enum status status = OK;
    const double between = sqrt(sqrt(o->scale_step));
    for (int i = 0; i < coarse->count && status == OK; i++)
        for (int k = 0; k < 9 && status == OK; k++) {
            struct plain_match m = coarse->match[i];
            m.angle += (k % 3 - 1) * o->angle_step / 3;
            m.scale *= k / 3 == 0 ? 1 / between : k / 3 == 1 ? 1 : between;
            status = try_template(p, image, by, m, 3, best);
        }
    return status;
}

enum status plain_match_find(const struct gray_picture *picture, const struct gray_picture *image,
                             const struct plain_options *options, struct plain_match *out)
{
    struct best coarse = {0}, fine = {0};
    struct edges small = {0}, larger = {0};
    enum status status = reduce(image, REDUCTION / 2, &larger);
    if (status == OK && options->coarse_to_fine)
        status = reduce(image, REDUCTION, &small);
    if (status == OK)
        status = options->coarse_to_fine ? search_all(picture, &small, REDUCTION, options, &coarse)
                                         : search_all(picture, &larger, REDUCTION / 2, options, &fine);
    if (status == OK && options->coarse_to_fine)
        status = search_near(picture, &larger, REDUCTION / 2, options, &coarse, &fine);
    edges_free(&small);
    edges_free(&larger);
    if (status != OK)
        return status;
    if (!fine.count)
        return NOTHING;
    *out = fine.match[0];
    return OK;
}
