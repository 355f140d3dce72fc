#include "reenact/avatar/color_inpainting.h"

#include "base/clamp.h"
#include "base/threads.h"

#include <stdlib.h>
#include <string.h>

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
    const struct ring_sample *sample = a, *y = b;
    if (sample->along != y->along)
        return sample->along < y->along ? -1 : 1;
    return (sample->number > y->number) - (sample->number < y->number);
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
