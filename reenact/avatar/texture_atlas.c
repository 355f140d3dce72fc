#include "reenact/avatar/texture_atlas.h"

#include "base/clamp.h"
#include "base/portable_math.h"
#include "base/threads.h"
#include "platform/vision/mesh_simplify.h"

#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- uv unwrap

enum { OWNER_SIDE = 1024, MAX_SIDE = 1280 };

// Chosen by hand.
static const double MIN_FACING = 0.5, SEED_FACING = 0.8; // cosines between a triangle's normal and its chart's
static const double INSIDE = 1e-3; // barycentric coordinate: a texel centre with less is on the edge, in no triangle

// A part of the surface, and the plane that it is projected to; texels count along the first two axes.
struct uv_chart {
    struct vec3 across, along, up; // unit
    int left, top, width, height;  // of its texels, the margin included
    int x, y;                      // of its top-left texel in the image
    int32_t first, count;          // its triangles in `order`
};

struct unwrapper {
    const struct surface_mesh *surface;
    const int32_t *corners;
    int triangles;
    double texel_m;
    struct vec3 *facing;                // of each triangle: its normal
    int32_t (*neighbor)[3];             // as in uv_mesh
    int32_t *chart_of;                  // of each triangle; -1: none yet
    int32_t *order;                     // triangles, chart by chart
    int32_t (*texel_owner)[OWNER_SIDE]; // the last chart that claimed this texel, coordinates modulo the side; -1: none
    struct uv_chart *charts;
    int32_t chart_count, placed; // placed: triangles that are in a chart
};

// ---------------------------------------------------------------- neighbours

struct mesh_edge {
    int32_t low, high, triangle, side;
};

static int by_ends(const void *a, const void *b)
{
    const struct mesh_edge *p = a, *q = b;
    if (p->low != q->low)
        return p->low < q->low ? -1 : 1;
    if (p->high != q->high)
        return p->high < q->high ? -1 : 1;
    return (p->triangle > q->triangle) - (p->triangle < q->triangle);
}

static enum status find_neighbours(struct unwrapper *unwrapper)
{
    struct mesh_edge *edges = malloc(sizeof *edges * 3 * (size_t)unwrapper->triangles);
    if (!edges)
        return fail(ERR_MEMORY, "no memory for unwrapping the mesh");
    for (int i = 0; i < 3 * unwrapper->triangles; i++) {
        int32_t a = unwrapper->corners[i], b = unwrapper->corners[i % 3 == 2 ? i - 2 : i + 1];
        edges[i] = (struct mesh_edge){a < b ? a : b, a < b ? b : a, i / 3, i % 3};
        unwrapper->neighbor[i / 3][i % 3] = -1;
    }
    qsort(edges, 3 * (size_t)unwrapper->triangles, sizeof *edges, by_ends);
    for (int i = 0; i + 1 < 3 * unwrapper->triangles; i++) {
        const struct mesh_edge *a = &edges[i], *b = &edges[i + 1];
        if (a->low != b->low || a->high != b->high)
            continue;
        unwrapper->neighbor[a->triangle][a->side] = b->triangle;
        unwrapper->neighbor[b->triangle][b->side] = a->triangle;
        i++;
    }
    free(edges);
    return OK;
}

// ---------------------------------------------------------------- charts

static void project_uv(const struct unwrapper *unwrapper, const struct uv_chart *chart, int32_t point, double at[2])
{
    struct vec3 p = unwrapper->surface->points[point];
    at[0] = v3_dot(p, chart->across) / unwrapper->texel_m;
    at[1] = v3_dot(p, chart->along) / unwrapper->texel_m;
}

// Claims the texels whose centres lie in the triangle. False: the chart has one of them already; none is claimed.
static bool claim_texels(struct unwrapper *unwrapper, const struct uv_chart *chart, int32_t number, int32_t triangle)
{
    double q[3][2], low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};
    for (int i = 0; i < 3; i++) {
        project_uv(unwrapper, chart, unwrapper->corners[3 * triangle + i], q[i]);
        for (int k = 0; k < 2; k++)
            low[k] = fmin(low[k], q[i][k]), high[k] = fmax(high[k], q[i][k]);
    }
    double area = (q[1][0] - q[0][0]) * (q[2][1] - q[0][1]) - (q[1][1] - q[0][1]) * (q[2][0] - q[0][0]);
    if (area == 0)
        return true;
    for (int claiming = 0; claiming < 2; claiming++) // test all, then claim all
        for (int y = (int)ceil(low[1]); y <= (int)floor(high[1]); y++)
            for (int x = (int)ceil(low[0]); x <= (int)floor(high[0]); x++) {
                double u = ((q[1][0] - x) * (q[2][1] - y) - (q[1][1] - y) * (q[2][0] - x)) / area;
                double v = ((q[2][0] - x) * (q[0][1] - y) - (q[2][1] - y) * (q[0][0] - x)) / area;
                if (u < INSIDE || v < INSIDE || 1 - u - v < INSIDE)
                    continue;
                int32_t *at = &unwrapper->texel_owner[y & (OWNER_SIDE - 1)][x & (OWNER_SIDE - 1)];
                if (*at == number && !claiming)
                    return false;
                *at = number;
            }
    return true;
}

// Grows a chart from one triangle over its neighbours that face much the same way.
static void grow_chart(struct unwrapper *unwrapper, int32_t seed, struct vec3 up)
{
    int32_t number = unwrapper->chart_count++;
    struct uv_chart *chart = &unwrapper->charts[number];
    struct vec3 reference = fabs(up.y) < 0.7 ? v3(0, 1, 0) : v3(1, 0, 0);
    *chart = (struct uv_chart){.up = up, .across = v3_unit(v3_cross(reference, up)), .first = unwrapper->placed};
    chart->along = v3_cross(up, chart->across);
    unwrapper->chart_of[seed] = number;
    unwrapper->order[unwrapper->placed++] = seed;
    claim_texels(unwrapper, chart, number, seed);
    for (int32_t at = chart->first; at < unwrapper->placed; at++)
        for (int side = 0; side < 3; side++) {
            int32_t next = unwrapper->neighbor[unwrapper->order[at]][side];
            if (next < 0 || unwrapper->chart_of[next] >= 0 || v3_dot(unwrapper->facing[next], up) < MIN_FACING ||
                !claim_texels(unwrapper, chart, number, next))
                continue;
            unwrapper->chart_of[next] = number;
            unwrapper->order[unwrapper->placed++] = next;
        }
    chart->count = unwrapper->placed - chart->first;
}

// First what faces one of the main directions, which makes few large charts; then what is left.
static void cut_charts(struct unwrapper *unwrapper)
{
    const struct vec3 main[] = {v3(0, 0, -1), v3(0, 0, 1), v3(1, 0, 0), v3(-1, 0, 0), v3(0, -1, 0), v3(0, 1, 0)};
    for (size_t m = 0; m < COUNT_OF(main); m++)
        for (int32_t t = 0; t < unwrapper->triangles; t++)
            if (unwrapper->chart_of[t] < 0 && v3_dot(unwrapper->facing[t], main[m]) > SEED_FACING)
                grow_chart(unwrapper, t, main[m]);
    for (int32_t t = 0; t < unwrapper->triangles; t++)
        if (unwrapper->chart_of[t] < 0)
            grow_chart(unwrapper, t, unwrapper->facing[t]);
    for (int32_t i = 0; i < unwrapper->chart_count; i++) {
        struct uv_chart *chart = &unwrapper->charts[i];
        double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY}, at[2];
        for (int32_t k = 0; k < 3 * chart->count; k++) {
            project_uv(unwrapper, chart, unwrapper->corners[3 * unwrapper->order[chart->first + k / 3] + k % 3], at);
            for (int e = 0; e < 2; e++)
                low[e] = fmin(low[e], at[e]), high[e] = fmax(high[e], at[e]);
        }
        chart->left = (int)floor(low[0]) - UV_CHART_MARGIN / 2, chart->top = (int)floor(low[1]) - UV_CHART_MARGIN / 2;
        chart->width = (int)ceil(high[0]) - chart->left + UV_CHART_MARGIN / 2;
        chart->height = (int)ceil(high[1]) - chart->top + UV_CHART_MARGIN / 2;
    }
}

// ---------------------------------------------------------------- packing

// In rows, the highest charts first, in an image about square. ERR_INPUT: too large.
static enum status pack_charts(struct unwrapper *unwrapper, struct uv_mesh *out)
{
    int highest = 0, row_height = 0, x = 0, y = 0;
    double area = 0;
    for (int32_t i = 0; i < unwrapper->chart_count; i++) {
        struct uv_chart *chart = &unwrapper->charts[i];
        if (chart->width > OWNER_SIDE || chart->height > OWNER_SIDE)
            return fail(ERR_INPUT, "the person is too large for the texture atlas");
        area += (double)chart->width * chart->height;
        highest = chart->height > highest ? chart->height : highest;
        out->width = chart->width > out->width ? chart->width : out->width;
    }
    while ((double)out->width * out->width < area)
        out->width++;
    for (int height = highest; height > 0; height--)
        for (int32_t i = 0; i < unwrapper->chart_count; i++) {
            struct uv_chart *chart = &unwrapper->charts[i];
            if (chart->height != height)
                continue;
            if (x + chart->width > out->width)
                x = 0, y += row_height, row_height = 0;
            chart->x = x, chart->y = y;
            x += chart->width;
            row_height = row_height ? row_height : height;
        }
    out->height = y + row_height;
    return out->width <= MAX_SIDE && out->height <= MAX_SIDE
               ? OK
               : fail(ERR_INPUT, "the person is too large for the texture atlas");
}

// number: of each of the surface's points: its index in the current chart; scratch, -1 at first.
static void write_points(const struct unwrapper *unwrapper, struct uv_mesh *out, int32_t *number)
{
    for (int32_t i = 0; i < unwrapper->chart_count; i++) {
        const struct uv_chart *chart = &unwrapper->charts[i];
        int before = out->point_count;
        for (int32_t k = 0; k < 3 * chart->count; k++) {
            int32_t triangle = unwrapper->order[chart->first + k / 3], point = unwrapper->corners[3 * triangle + k % 3];
            if (number[point] < before) {
                double at[2];
                project_uv(unwrapper, chart, point, at);
                number[point] = out->point_count;
                out->points[out->point_count] = point;
                out->at[out->point_count][0] = (float)(at[0] - chart->left + chart->x + 0.5);
                out->at[out->point_count++][1] = (float)(at[1] - chart->top + chart->y + 0.5);
            }
            out->corners[3 * triangle + k % 3] = number[point];
        }
    }
    out->corner_count = 3 * unwrapper->triangles;
}

static enum status unwrap_with(struct unwrapper *unwrapper, struct uv_mesh *out, int32_t *number)
{
    for (int32_t t = 0; t < unwrapper->triangles; t++) {
        const struct vec3 *p = unwrapper->surface->points;
        const int32_t *q = unwrapper->corners + 3 * (size_t)t;
        unwrapper->facing[t] = v3_unit(v3_cross(v3_sub(p[q[1]], p[q[0]]), v3_sub(p[q[2]], p[q[0]])));
        unwrapper->chart_of[t] = -1;
    }
    for (int i = 0; i < OWNER_SIDE * OWNER_SIDE; i++)
        unwrapper->texel_owner[i / OWNER_SIDE][i % OWNER_SIDE] = -1;
    for (int i = 0; i < unwrapper->surface->point_count; i++)
        number[i] = -1;
    enum status status = find_neighbours(unwrapper);
    if (status != OK)
        return status;
    cut_charts(unwrapper);
    status = pack_charts(unwrapper, out);
    if (status == OK)
        write_points(unwrapper, out, number);
    return status;
}

enum status uv_unwrap(struct uv_mesh *out, const struct surface_mesh *surface, const int32_t *corners, int corner_count,
                      double texel_m)
{
    size_t triangles = (size_t)corner_count / 3;
    struct unwrapper c = {.surface = surface,
                          .corners = corners,
                          .triangles = (int)triangles,
                          .texel_m = texel_m,
                          .facing = malloc(sizeof *c.facing * triangles),
                          .chart_of = malloc(sizeof *c.chart_of * triangles),
                          .order = malloc(sizeof *c.order * triangles),
                          .texel_owner = malloc(sizeof *c.texel_owner * OWNER_SIDE),
                          .charts = malloc(sizeof *c.charts * triangles)};
    int32_t *number = malloc(sizeof *number * (size_t)surface->point_count);
    *out = (struct uv_mesh){.points = malloc(sizeof *out->points * 3 * triangles),
                            .at = malloc(sizeof *out->at * 3 * triangles),
                            .corners = malloc(sizeof *out->corners * 3 * triangles),
                            .neighbor = malloc(sizeof *out->neighbor * triangles)};
    c.neighbor = out->neighbor;
    enum status status = OK;
    if (!c.facing || !c.neighbor || !c.chart_of || !c.order || !c.texel_owner || !c.charts || !number || !out->points ||
        !out->at || !out->corners)
        status = fail(ERR_MEMORY, "no memory for unwrapping the mesh");
    if (status == OK)
        status = unwrap_with(&c, out, number);
    free(c.facing);
    free(c.chart_of);
    free(c.order);
    free(c.texel_owner);
    free(c.charts);
    free(number);
    if (status != OK)
        uv_mesh_free(out);
    return status;
}

void uv_mesh_free(struct uv_mesh *mesh)
{
    free(mesh->points);
    free(mesh->at);
    free(mesh->corners);
    free(mesh->neighbor);
    *mesh = (struct uv_mesh){0};
}

// ---------------------------------------------------------------- color inpainting

enum { RING_SAMPLES = 1000, PASSES = 4, CHUNK = 4096 };

// Chosen by hand on the films of people who never turn (docs/notes/avatar.md).
static const double MIRROR_M = 0.03;          // how far from the mirrored point a seen one may lie
static const double RING_HALF_WIDTH_M = 0.05; // samples farther away along the bone have no weight
static const float RING_FALLOFF_M = 0.03F;    // at this distance a sample's weight is a quarter of the nearest one's
static const float COLOR_OUTLIER = 0.1F;      // at this residual a colour's weight is a quarter; gamma-encoded, 0 to 1

// ---------------------------------------------------------------- nearest seen point

// The points that were seen, sorted by height in the bind pose, for fast searches of the nearest.
struct height_bins {
    double low; // y of the first bin's edge; bind-pose axes, y down
    int count;
    int32_t *first; // index in `points` of each bin's first, and one past the last's end
    int32_t *points;
};

static const double HEIGHT_BIN_M = 0.01;

static int height_bin_of(const struct height_bins *bins, double height)
{
    return (int)clamp_double(floor((height - bins->low) / HEIGHT_BIN_M), 0, bins->count - 1);
}

static enum status height_bins_open(struct height_bins *bins, const struct surface_mesh *surface, const uint8_t *filled)
{
    double low = INFINITY, high = -INFINITY;
    for (int i = 0; i < surface->point_count; i++) {
        low = fmin(low, surface->points[i].y);
        high = fmax(high, surface->points[i].y);
    }
    *bins = (struct height_bins){.low = low, .count = (int)fmin(fmax((high - low) / HEIGHT_BIN_M, 0), 1e6) + 1};
    assert(bins->count > 0);
    bins->first = calloc((size_t)bins->count + 1, sizeof *bins->first);
    bins->points = malloc(sizeof *bins->points * (size_t)surface->point_count);
    if (!bins->first || !bins->points) {
        free(bins->first);
        free(bins->points);
        return fail(ERR_MEMORY, "no memory for inpainting colours");
    }
    for (int i = 0; i < surface->point_count; i++)
        bins->first[height_bin_of(bins, surface->points[i].y)] += !filled[i];
    for (int k = 1; k <= bins->count; k++)
        bins->first[k] += bins->first[k - 1];
    for (int i = surface->point_count - 1; i >= 0; i--)
        if (!filled[i])
            bins->points[--bins->first[height_bin_of(bins, surface->points[i].y)]] = i;
    return OK;
}

// The nearest point that was seen, of equals the lowest-numbered; -1: none is nearer than `within`.
static int nearest_seen(const struct height_bins *bins, const struct surface_mesh *surface, struct vec3 p,
                        double within)
{
    int best = -1, middle = height_bin_of(bins, p.y);
    double min = within * within;
    for (int away = 0; away < bins->count; away++) {
        double beside = fmax(away - 1, 0) * HEIGHT_BIN_M; // no point of such a bin is nearer
        if (beside * beside > min)
            break;
        for (int side = away ? -1 : 1; side <= 1; side += 2) {
            int k = middle + side * away;
            if (k < 0 || k >= bins->count)
                continue;
            for (int at = bins->first[k]; at < bins->first[k + 1]; at++) {
                int i = bins->points[at];
                struct vec3 d = v3_sub(surface->points[i], p);
                double d2 = v3_dot(d, d);
                if (d2 < min || (d2 == min && best > i))
                    min = d2, best = i;
            }
        }
    }
    return best;
}

// ---------------------------------------------------------------- round a bone

// A point of a bone that was seen.
struct ring_sample {
    double along;                  // metres along the bone from its origin
    float at[3], color[3], time_s; // color: gamma-encoded
    int32_t number;
};

// Of each bone at most RING_SAMPLES, evenly spread over what was seen of it, sorted along it.
struct ring_samples {
    struct ring_sample of[BONE_COUNT][RING_SAMPLES];
    int count[BONE_COUNT];
};

static int by_along(const void *a, const void *b)
{
    const struct ring_sample *x = a, *y = b;
    if (x->along != y->along)
        return x->along < y->along ? -1 : 1;
    return (x->number > y->number) - (x->number < y->number);
}

// How far along the bone; of the skull along the way it faces, about which hair and face lie in rings.
static double along_bone(const struct bind_pose *bind_pose, int bone, struct vec3 p)
{
    const struct bone_frame *f = &bind_pose->frame[bone];
    return v3_dot(v3_sub(p, f->origin), bone == BONE_SKULL ? f->y : f->z);
}

static struct ring_sample ring_sample_of(const struct vertex_colors *vertex_colors, int i, struct vec3 p, double along)
{
    const float *c = vertex_colors->color[i];
    return (struct ring_sample){.along = along,
                                .at = {(float)p.x, (float)p.y, (float)p.z},
                                .color = {sqrtf(c[0]), sqrtf(c[1]), sqrtf(c[2])},
                                .time_s = vertex_colors->time_s[i],
                                .number = i};
}

static void find_ring_samples(struct ring_samples *samples, const struct vertex_colors *vertex_colors,
                              const struct vertex_color_target *target)
{
    const struct surface_mesh *surface = target->surface;
    const struct skin_weights *skins = target->skins;
    int seen[BONE_COUNT] = {0}, at[BONE_COUNT] = {0};
    for (int i = 0; i < surface->point_count; i++)
        seen[skins[i].bone[0]] += !vertex_colors->filled[i];
    for (int i = 0; i < surface->point_count; i++) {
        const int b = skins[i].bone[0];
        if (vertex_colors->filled[i] || at[b]++ % (seen[b] / RING_SAMPLES + 1))
            continue;
        const struct vec3 p = surface->points[i];
        samples->of[b][samples->count[b]++] = ring_sample_of(vertex_colors, i, p, along_bone(target->bind_pose, b, p));
    }
    for (int b = 0; b < BONE_COUNT; b++)
        qsort(samples->of[b], (size_t)samples->count[b], sizeof *samples->of[b], by_along);
}

// The first sample at or past `along`.
static int first_from(const struct ring_sample *sample, int count, double along)
{
    int low = 0, high = count;
    while (low < high) {
        int middle = low + (high - low) / 2;
        if (sample[middle].along < along)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

// A sample's weight for p, by its distance along the bone and its distance in space.
static float ring_weight(const struct ring_sample *sample, struct vec3 p, double along)
{
    const float off = (float)((sample->along - along) / RING_HALF_WIDTH_M), level = 1 - off * off;
    const float d[3] = {sample->at[0] - (float)p.x, sample->at[1] - (float)p.y, sample->at[2] - (float)p.z};
    const float beside = 1 + (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]) / (RING_FALLOFF_M * RING_FALLOFF_M);
    return level * level / (beside * beside);
}

// Iteratively reweighted mean (Geman-McClure).
static void robust_mean(const struct ring_sample *sample, const float *weight, int count, float color[3])
{
    float robust[RING_SAMPLES];
    memcpy(robust, weight, sizeof *robust * (size_t)count);
    for (int pass = 0; pass < PASSES; pass++) {
        float sum[3] = {0}, total = 0;
        for (int k = 0; k < count; k++) {
            for (int c = 0; c < 3; c++)
                sum[c] += robust[k] * sample[k].color[c];
            total += robust[k];
        }
        for (int c = 0; c < 3; c++)
            color[c] = sum[c] / total;
        for (int k = 0; k < count; k++) {
            float off2 = 0;
            for (int c = 0; c < 3; c++)
                off2 += (sample[k].color[c] - color[c]) * (sample[k].color[c] - color[c]);
            const float alike = 1 + off2 / (COLOR_OUTLIER * COLOR_OUTLIER);
            robust[k] = weight[k] / (alike * alike);
        }
    }
}

// False: nothing was seen of the bone at that height.
static bool fill_from_ring(const struct ring_samples *all, int bone, struct vec3 p, double along, float color[3],
                           float *time_s)
{
    const struct ring_sample *sample = all->of[bone];
    const int last = all->count[bone] - 1;
    if (last < 0)
        return false;
    along = fmin(fmax(along, sample[0].along + RING_HALF_WIDTH_M / 2),
                 fmax(sample[last].along - RING_HALF_WIDTH_M / 2, sample[0].along));
    const int first = first_from(sample, all->count[bone], along - RING_HALF_WIDTH_M);
    float weight[RING_SAMPLES], max = 0;
    int count = 0;
    for (int k = first; k <= last && sample[k].along < along + RING_HALF_WIDTH_M; k++) {
        weight[count] = ring_weight(&sample[k], p, along);
        if (weight[count] > max)
            max = weight[count], *time_s = sample[k].time_s;
        count++;
    }
    if (!(max > 0))
        return false;
    robust_mean(&sample[first], weight, count, color);
    for (int c = 0; c < 3; c++)
        color[c] *= color[c];
    return true;
}

// ---------------------------------------------------------------- points

struct inpainting {
    const struct vertex_color_target *target;
    struct height_bins bins;
    struct ring_samples *ring;
    struct vertex_colors *vertex_colors;
};

static void copy_color(struct vertex_colors *colors, int i, int from)
{
    if (from < 0)
        return;
    memcpy(colors->color[i], colors->color[from], sizeof colors->color[i]);
    colors->time_s[i] = colors->time_s[from];
}

// The point that was seen nearest to p's mirror image; -1: none, or one was seen about as near to p itself.
static int mirror_of(const struct inpainting *inpainting, struct vec3 p)
{
    const struct surface_mesh *surface = inpainting->target->surface;
    const struct vec3 mirrored = {-p.x, p.y, p.z};
    const int mirror = nearest_seen(&inpainting->bins, surface, mirrored, MIRROR_M);
    if (mirror < 0)
        return -1;
    const double beside_m = 2 * v3_distance(surface->points[mirror], mirrored);
    return nearest_seen(&inpainting->bins, surface, p, beside_m) < 0 ? mirror : -1;
}

// Threads share nothing that is written: only unseen points are written, only seen ones are read.
static void fill_chunk(void *context, int chunk)
{
    const struct inpainting *inpainting = context;
    const struct surface_mesh *surface = inpainting->target->surface;
    struct vertex_colors *c = inpainting->vertex_colors;
    for (int i = chunk * CHUNK; i < (chunk + 1) * CHUNK && i < surface->point_count; i++) {
        if (!c->filled[i])
            continue;
        const struct vec3 p = surface->points[i];
        const int bone = inpainting->target->skins[i].bone[0];
        const int mirror = mirror_of(inpainting, p);
        if (mirror >= 0)
            copy_color(c, i, mirror);
        else if (!fill_from_ring(inpainting->ring, bone, p, along_bone(inpainting->target->bind_pose, bone, p),
                                 c->color[i], &c->time_s[i]))
            copy_color(c, i, nearest_seen(&inpainting->bins, surface, p, INFINITY));
    }
}

enum status color_inpaint(struct vertex_colors *vertex_colors, const struct vertex_color_target *target, int threads)
{
    const struct surface_mesh *surface = target->surface;
    struct inpainting f = {.target = target, .vertex_colors = vertex_colors, .ring = calloc(1, sizeof *f.ring)};
    enum status status = f.ring ? height_bins_open(&f.bins, surface, vertex_colors->filled)
                                : fail(ERR_MEMORY, "no memory for inpainting colours");
    if (status == OK) {
        find_ring_samples(f.ring, vertex_colors, target);
        parallel_for(threads, (surface->point_count + CHUNK - 1) / CHUNK, fill_chunk, &f);
        free(f.bins.first);
        free(f.bins.points);
    }
    free(f.ring);
    return status;
}

// ---------------------------------------------------------------- texture atlas

enum { TRIANGLES = 2500, ROWS = 16, FARTHEST_CELLS = 4, SUBDIVISIONS = 4, ITERATIONS = 3 };

// docs/notes/retrieval-and-drawing.md compares 2000 to 4000 triangles; the rest was chosen by hand.
static const double ERROR_M = 0.01; // of simplification, before the coarse mesh is refitted to the fine surface
static const double TEXEL_M = 0.004, COARSER = 1.3, TEXEL_MAX_M = 0.03; // COARSER: factor where it does not fit
static const float GUTTER = 1.5F; // texels beyond a triangle's edge that bilinear filtering reads

// Finds points of the fine surface by cubes of TSDF_VOXEL_M, and the triangles of each point.
struct point_grid {
    const struct surface_mesh *surface;
    struct vec3 low;
    int size[3];
    int32_t *head, *next;      // linked list of each cube's points; -1: end
    int32_t *first, *triangle; // point i's triangles are numbers first[i] to first[i + 1] of `triangle`
};

static void point_grid_close(struct point_grid *grid)
{
    free(grid->head);
    free(grid->next);
    free(grid->first);
    free(grid->triangle);
}

static void cube_of(const struct point_grid *grid, struct vec3 p, int at[3])
{
    at[0] = (int)floor((p.x - grid->low.x) / TSDF_VOXEL_M);
    at[1] = (int)floor((p.y - grid->low.y) / TSDF_VOXEL_M);
    at[2] = (int)floor((p.z - grid->low.z) / TSDF_VOXEL_M);
}

static int32_t *head_of(const struct point_grid *grid, const int at[3])
{
    for (int k = 0; k < 3; k++)
        if (at[k] < 0 || at[k] >= grid->size[k])
            return NULL;
    return &grid->head[((size_t)at[2] * (size_t)grid->size[1] + (size_t)at[1]) * (size_t)grid->size[0] + (size_t)at[0]];
}

static void fill_grid(struct point_grid *grid)
{
    const struct surface_mesh *s = grid->surface;
    for (int i = s->point_count - 1; i >= 0; i--) {
        int at[3];
        cube_of(grid, s->points[i], at);
        int32_t *head = head_of(grid, at);
        grid->next[i] = *head;
        *head = i;
    }
    for (int c = 0; c < s->corner_count; c++)
        grid->first[s->corners[c] + 1]++;
    for (int i = 0; i < s->point_count; i++)
        grid->first[i + 1] += grid->first[i];
    // Backwards: first[i + 1] is the end of point i's range, and becomes its start.
    for (int c = s->corner_count - 1; c >= 0; c--)
        grid->triangle[--grid->first[s->corners[c] + 1]] = c / 3;
    memmove(grid->first, grid->first + 1, sizeof *grid->first * (size_t)s->point_count);
    grid->first[s->point_count] = s->corner_count;
}

static enum status point_grid_open(struct point_grid *grid, const struct surface_mesh *mesh)
{
    struct vec3 high = mesh->points[0];
    size_t points = (size_t)mesh->point_count, cubes;
    *grid = (struct point_grid){.surface = mesh, .low = mesh->points[0]};
    for (int i = 0; i < mesh->point_count; i++) {
        struct vec3 p = mesh->points[i];
        grid->low = v3(fmin(grid->low.x, p.x), fmin(grid->low.y, p.y), fmin(grid->low.z, p.z));
        high = v3(fmax(high.x, p.x), fmax(high.y, p.y), fmax(high.z, p.z));
    }
    cube_of(grid, high, grid->size);
    for (int k = 0; k < 3; k++)
        grid->size[k]++;
    cubes = (size_t)grid->size[0] * (size_t)grid->size[1] * (size_t)grid->size[2];
    grid->head = malloc(sizeof *grid->head * cubes);
    grid->next = malloc(sizeof *grid->next * points);
    grid->first = calloc(points + 2, sizeof *grid->first);
    grid->triangle = malloc(sizeof *grid->triangle * (size_t)mesh->corner_count);
    if (!grid->head || !grid->next || !grid->first || !grid->triangle) {
        point_grid_close(grid);
        return fail(ERR_MEMORY, "no memory for the texture atlas");
    }
    for (size_t i = 0; i < cubes; i++)
        grid->head[i] = -1;
    fill_grid(grid);
    return OK;
}

// The nearest point of one cube that faces the same way, if it is nearer than the best so far.
struct nearest {
    double distance2;
    int32_t point; // -1: none
};

static void search_cube(const struct point_grid *grid, const int at[3], struct vec3 p, struct vec3 facing,
                        struct nearest *best)
{
    const int32_t *head = head_of(grid, at);
    for (int32_t i = head ? *head : -1; i >= 0; i = grid->next[i]) {
        struct vec3 d = v3_sub(grid->surface->points[i], p);
        double away2 = v3_dot(d, d);
        if (away2 < best->distance2 && v3_dot(grid->surface->normals[i], facing) > 0)
            *best = (struct nearest){away2, i};
    }
}

// The nearest of the surface's points that face the same way; -1: none is near. Searches growing blocks of cubes until
// one has any.
static int32_t nearest_point(const struct point_grid *grid, struct vec3 p, struct vec3 facing)
{
    struct nearest best = {INFINITY, -1};
    int center[3];
    cube_of(grid, p, center);
    for (int reach = 1; reach <= FARTHEST_CELLS && best.point < 0; reach++) {
        const int side = 2 * reach + 1;
        for (int i = 0; i < side * side * side; i++) {
            const int at[3] = {center[0] - reach + i % side, center[1] - reach + i / side % side,
                               center[2] - reach + i / side / side};
            search_cube(grid, at, p, facing, &best);
        }
    }
    return best.point;
}

// The point of a triangle that is nearest to p, in barycentric coordinates; its squared distance. Beyond an edge it is
// approximate: negative coordinates are set to 0.
static double closest_point(const struct vec3 *a, const struct vec3 *b, const struct vec3 *c, struct vec3 p,
                            double share[3])
{
    struct vec3 ab = v3_sub(*b, *a), ac = v3_sub(*c, *a), ap = v3_sub(p, *a);
    double d11 = v3_dot(ab, ab), d12 = v3_dot(ab, ac), d22 = v3_dot(ac, ac), e1 = v3_dot(ab, ap), e2 = v3_dot(ac, ap);
    double area2 = d11 * d22 - d12 * d12;
    share[1] = area2 > 0 ? (d22 * e1 - d12 * e2) / area2 : 0;
    share[2] = area2 > 0 ? (d11 * e2 - d12 * e1) / area2 : 0;
    share[0] = 1 - share[1] - share[2];
    double sum = 0;
    for (int i = 0; i < 3; i++)
        sum += share[i] = fmax(share[i], 0);
    for (int i = 0; i < 3; i++)
        share[i] /= sum;
    struct vec3 at = v3_add(v3_scale(*a, share[0]), v3_add(v3_scale(*b, share[1]), v3_scale(*c, share[2])));
    struct vec3 off = v3_sub(p, at);
    return v3_dot(off, off);
}

// ---------------------------------------------------------------- the image

struct texel_bake {
    struct texture_atlas *atlas;
    const struct vertex_colors *vertex_colors;
    const struct point_grid *grid;
    int32_t *owner; // of each texel: the triangle that is baked into it; -1: none is near
    float *off;     // of each texel: distance beyond that triangle's edge, texels; negative inside
};

static void write_texel(const struct texel_bake *bake, size_t texel, struct vec3 p, struct vec3 facing)
{
    const struct surface_mesh *s = bake->grid->surface;
    int32_t point = nearest_point(bake->grid, p, facing);
    double min = INFINITY, best[3] = {1, 0, 0};
    if (point < 0)
        return;
    const int32_t alone[3] = {point, point, point},
                  *of = alone; // of: the corners of the nearest triangle; the point itself where there is none
    for (int32_t i = bake->grid->first[point]; i < bake->grid->first[point + 1]; i++) {
        const int32_t *c = s->corners + 3 * (size_t)bake->grid->triangle[i];
        double share[3];
        double away2 = closest_point(&s->points[c[0]], &s->points[c[1]], &s->points[c[2]], p, share);
        if (away2 < min) {
            min = away2;
            of = c;
            memcpy(best, share, sizeof best);
        }
    }
    int heaviest = best[1] > best[0] ? 1 : 0;
    heaviest = best[2] > best[heaviest] ? 2 : heaviest;
    for (int k = 0; k < 3; k++) {
        double sum = 0;
        for (int i = 0; i < 3; i++)
            sum += best[i] * (double)bake->vertex_colors->color[of[i]][k];
        bake->atlas->color[3 * texel + (size_t)k] = (uint8_t)(255 * sqrt(fmin(fmax(sum, 0), 1)) + 0.5);
    }
    double hundredths = fmin(fmax((double)bake->vertex_colors->time_s[of[heaviest]] * 100 + 0.5, 0), 0xffffff);
    uint8_t *seen_time = bake->atlas->seen_time + 4 * texel;
    seen_time[0] = (uint8_t)((int)hundredths >> 8 & 255);
    seen_time[1] = (uint8_t)((int)hundredths & 255);
    seen_time[2] = bake->vertex_colors->filled[of[heaviest]] ? 255 : 0;
    seen_time[3] = (uint8_t)((int)hundredths >> 16);
}

// Barycentric coordinates of (x, y) in a triangle of the mesh, negative beyond an edge. *off: how far it lies beyond
// the farthest edge, texels.
static void barycentrics_of(const struct uv_mesh *mesh, const int32_t *c, float x, float y, float share[3], float *off)
{
    const float *q[3] = {mesh->at[c[0]], mesh->at[c[1]], mesh->at[c[2]]};
    float area = (q[1][0] - q[0][0]) * (q[2][1] - q[0][1]) - (q[1][1] - q[0][1]) * (q[2][0] - q[0][0]);
    *off = area > 0 ? -INFINITY : INFINITY;
    for (int i = 0; i < 3; i++) {
        const float *a = q[(i + 1) % 3], *b = q[(i + 2) % 3];
        float doubled = (a[0] - x) * (b[1] - y) - (a[1] - y) * (b[0] - x);
        share[i] = doubled / area;
        *off = fmaxf(*off, -doubled / (float)portable_hypot((double)(b[0] - a[0]), (double)(b[1] - a[1])));
    }
}

// Each texel that a triangle covers, or that lies less than GUTTER beyond its edge, goes to the triangle that it lies
// deepest in.
static void assign_texels(struct texel_bake *bake)
{
    const struct uv_mesh *m = &bake->atlas->mesh;
    for (int t = 0; t < m->corner_count; t += 3) {
        const int32_t *c = m->corners + t;
        float low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY}, share[3], off;
        for (int i = 0; i < 3; i++)
            for (int k = 0; k < 2; k++) {
                low[k] = fminf(low[k], m->at[c[i]][k]);
                high[k] = fmaxf(high[k], m->at[c[i]][k]);
            }
        int right = (int)fminf(high[0] + GUTTER, (float)m->width);
        int bottom = (int)fminf(high[1] + GUTTER, (float)m->height);
        for (int y = (int)fmaxf(low[1] - GUTTER, 0); y < bottom; y++)
            for (int x = (int)fmaxf(low[0] - GUTTER, 0); x < right; x++) {
                size_t texel = (size_t)y * (size_t)m->width + (size_t)x;
                barycentrics_of(m, c, (float)x + 0.5F, (float)y + 0.5F, share, &off);
                if (off < GUTTER && off < bake->off[texel]) {
                    bake->off[texel] = off;
                    bake->owner[texel] = t / 3;
                }
            }
    }
}

static void write_rows(void *context, int rows)
{
    const struct texel_bake *bake = context;
    const struct surface_mesh *s = bake->grid->surface;
    const struct uv_mesh *m = &bake->atlas->mesh;
    for (int y = rows * ROWS; y < (rows + 1) * ROWS && y < m->height; y++)
        for (int x = 0; x < m->width; x++) {
            size_t texel = (size_t)y * (size_t)m->width + (size_t)x;
            if (bake->owner[texel] < 0)
                continue;
            const int32_t *c = m->corners + 3 * (size_t)bake->owner[texel];
            struct vec3 p = v3(0, 0, 0), facing = p;
            float share[3], off;
            barycentrics_of(m, c, (float)x + 0.5F, (float)y + 0.5F, share, &off);
            for (int i = 0; i < 3; i++) {
                p = v3_add(p, v3_scale(bake->atlas->points[c[i]], (double)share[i]));
                facing = v3_add(facing, s->normals[m->points[c[i]]]);
            }
            write_texel(bake, texel, p, facing);
        }
}

static enum status bake_texels(struct texture_atlas *atlas, const struct point_grid *grid,
                               const struct vertex_colors *vertex_colors, int threads)
{
    struct texel_bake f = {.atlas = atlas, .vertex_colors = vertex_colors, .grid = grid};
    size_t texels = (size_t)atlas->mesh.width * (size_t)atlas->mesh.height;
    enum status status = OK;
    atlas->color = calloc(texels, 3);
    atlas->seen_time = calloc(texels, 4);
    f.owner = malloc(sizeof *f.owner * texels);
    f.off = malloc(sizeof *f.off * texels);
    if (atlas->color && atlas->seen_time && f.owner && f.off) {
        for (size_t i = 0; i < texels; i++)
            f.owner[i] = -1, f.off[i] = INFINITY;
        assign_texels(&f);
        parallel_for(threads, (atlas->mesh.height + ROWS - 1) / ROWS, write_rows, &f);
    } else {
        status = fail(ERR_MEMORY, "no memory for the texture atlas");
    }
    free(f.owner);
    free(f.off);
    return status;
}

// ---------------------------------------------------------------- the coarse mesh

// The coarse triangles, indexed by the fine surface's points; other points' values are undefined.
struct coarse_mesh {
    int32_t *corners;
    int corner_count;
    struct vec3 *points, *normals; // normals: unit
    double *moves, *weights;       // of each point: weighted sum of its moves along the normal, metres; weights
};

static void coarse_mesh_free(struct coarse_mesh *mesh)
{
    free(mesh->corners);
    free(mesh->points);
    free(mesh->normals);
    free(mesh->moves);
    free(mesh->weights);
}

// Area-weighted.
static void find_normals(struct coarse_mesh *mesh, int point_count)
{
    for (int i = 0; i < point_count; i++)
        mesh->normals[i] = v3(0, 0, 0);
    for (int t = 0; t < mesh->corner_count; t += 3) {
        const int32_t *at = mesh->corners + t;
        const struct vec3 p = mesh->points[at[0]],
                          doubled = v3_cross(v3_sub(mesh->points[at[1]], p), v3_sub(mesh->points[at[2]], p));
        for (int i = 0; i < 3; i++)
            mesh->normals[at[i]] = v3_add(mesh->normals[at[i]], doubled);
    }
    for (int i = 0; i < point_count; i++)
        mesh->normals[i] = v3_unit(mesh->normals[i]);
}

// Samples how far a triangle lies from the fine surface, and distributes it to its corners by barycentric coordinates.
static void measure_triangle(struct coarse_mesh *mesh, const struct point_grid *grid, const int32_t *at)
{
    const struct vec3 *p = mesh->points, *n = mesh->normals;
    double area = v3_length(v3_cross(v3_sub(p[at[1]], p[at[0]]), v3_sub(p[at[2]], p[at[0]])));
    for (int i = 0; i < SUBDIVISIONS; i++)
        for (int j = 0; i + j < SUBDIVISIONS; j++) {
            const double a = (i + 1.0 / 3) / SUBDIVISIONS, b = (j + 1.0 / 3) / SUBDIVISIONS,
                         share[3] = {a, b, 1 - a - b};
            struct vec3 at_sample = v3(0, 0, 0), facing = at_sample;
            for (int k = 0; k < 3; k++) {
                at_sample = v3_add(at_sample, v3_scale(p[at[k]], share[k]));
                facing = v3_add(facing, v3_scale(n[at[k]], share[k]));
            }
            const int32_t nearest = nearest_point(grid, at_sample, facing);
            if (nearest < 0)
                continue;
            double off = v3_dot(grid->surface->normals[nearest], v3_sub(grid->surface->points[nearest], at_sample));
            for (int k = 0; k < 3; k++) {
                mesh->moves[at[k]] += share[k] * area * off;
                mesh->weights[at[k]] += share[k] * area;
            }
        }
}

// The corners of the simplified mesh lie on the fine surface, so on a round limb the triangles between them lie inside
// it and the limb would be drawn too thin. The corners move along their normals until as much of each triangle lies
// outside as inside.
static void refit_corners(struct coarse_mesh *mesh, const struct point_grid *grid)
{
    const int count = grid->surface->point_count;
    for (int iteration = 0; iteration < ITERATIONS; iteration++) {
        find_normals(mesh, count);
        for (int i = 0; i < count; i++)
            mesh->moves[i] = mesh->weights[i] = 0;
        for (int t = 0; t < mesh->corner_count; t += 3)
            measure_triangle(mesh, grid, mesh->corners + t);
        for (int i = 0; i < count; i++)
            if (mesh->weights[i] > 0)
                mesh->points[i] =
                    v3_add(mesh->points[i], v3_scale(mesh->normals[i], mesh->moves[i] / mesh->weights[i]));
    }
    find_normals(mesh, count);
}

static enum status coarse_mesh_make(struct coarse_mesh *mesh, const struct surface_mesh *surface_mesh)
{
    const size_t count = (size_t)surface_mesh->point_count;
    float(*points)[3] = malloc(sizeof *points * count);
    *mesh = (struct coarse_mesh){.corners = malloc(sizeof *mesh->corners * (size_t)surface_mesh->corner_count),
                                 .points = malloc(sizeof *mesh->points * count),
                                 .normals = malloc(sizeof *mesh->normals * count),
                                 .moves = malloc(sizeof *mesh->moves * count),
                                 .weights = malloc(sizeof *mesh->weights * count)};
    if (!points || !mesh->corners || !mesh->points || !mesh->normals || !mesh->moves || !mesh->weights) {
        free(points);
        return fail(ERR_MEMORY, "no memory for the texture atlas");
    }
    memcpy(mesh->points, surface_mesh->points, sizeof *mesh->points * count);
    for (size_t i = 0; i < count; i++) {
        points[i][0] = (float)surface_mesh->points[i].x;
        points[i][1] = (float)surface_mesh->points[i].y;
        points[i][2] = (float)surface_mesh->points[i].z;
    }
    const struct simplify_mesh full = {(const float(*)[3])points, surface_mesh->corners, surface_mesh->point_count,
                                       surface_mesh->corner_count};
    mesh->corner_count = mesh_simplify(&full, 3 * TRIANGLES, (float)ERROR_M, mesh->corners);
    free(points);
    return OK;
}

static enum status unwrap_coarse(struct texture_atlas *atlas, const struct surface_mesh *mesh,
                                 const struct coarse_mesh *coarse_mesh)
{
    double texel_m = TEXEL_M;
    enum status status;
    do
        status = uv_unwrap(&atlas->mesh, mesh, coarse_mesh->corners, coarse_mesh->corner_count, texel_m);
    while (status == ERR_INPUT && (texel_m *= COARSER) < TEXEL_MAX_M);
    if (status != OK)
        return status;
    const struct uv_mesh *m = &atlas->mesh;
    atlas->points = malloc(sizeof *atlas->points * (size_t)m->point_count);
    atlas->normals = malloc(sizeof *atlas->normals * (size_t)m->point_count);
    if (!atlas->points || !atlas->normals)
        return fail(ERR_MEMORY, "no memory for the texture atlas");
    for (int i = 0; i < m->point_count; i++) {
        atlas->points[i] = coarse_mesh->points[m->points[i]];
        atlas->normals[i] = coarse_mesh->normals[m->points[i]];
    }
    return OK;
}

enum status texture_atlas_make(struct texture_atlas *out, const struct surface_mesh *mesh,
                               const struct vertex_colors *vertex_colors, int threads)
{
    struct coarse_mesh coarse = {0};
    struct point_grid grid;
    *out = (struct texture_atlas){0};
    enum status status = point_grid_open(&grid, mesh);
    if (status != OK)
        return status;
    status = coarse_mesh_make(&coarse, mesh);
    if (status == OK) {
        refit_corners(&coarse, &grid);
        status = unwrap_coarse(out, mesh, &coarse);
    }
    if (status == OK)
        status = bake_texels(out, &grid, vertex_colors, threads);
    coarse_mesh_free(&coarse);
    point_grid_close(&grid);
    if (status != OK)
        texture_atlas_free(out);
    return status;
}

void texture_atlas_free(struct texture_atlas *atlas)
{
    uv_mesh_free(&atlas->mesh);
    free(atlas->points);
    free(atlas->normals);
    free(atlas->color);
    free(atlas->seen_time);
    *atlas = (struct texture_atlas){0};
}
