#include "reenact/shape.h"

#include <stdlib.h>
#include <string.h>

enum { LEVELS = 96 };

static const double PI = 3.14159265358979323846;
static const double LOWEST = -0.6, STEP = 0.06; // of the rings, bone lengths
static const double TOP = 6;                    // highest stand-off kept, cylinder radii
static const double SHARED_M = 0.01;            // neighbours overlap by this, so that no gap opens between them
static const double SEEN_SHARE = 0.2;           // a ring seen less than this of what the middle was is no part of it
static const double SHIFT_LIMIT_M = 0.12;       // joints are not worse than this
static const double SHIFT_TRUST = 0.05;         // in the joints, against a measured point
static const double NECK_SHARE = 0.65;          // of the lowest measured ring's radius
static const double END_REACH_M = 0.15;         // the end is sought so far about where it should be
enum { SHIFT_ROUNDS = 4, SHIFT_POINTS = 20 };
static const int ENOUGH = 200; // samples for a part

double shape_height(int ring) { return LOWEST + STEP * ring; }

// Samples of one part: counts by ring, angle and stand-off.
struct tally {
    uint16_t count[SHAPE_ALONG][SHAPE_AROUND][LEVELS];
};

static void add_point(struct tally *tally, const struct part_frame *f, double radius, struct vec3 p)
{
    struct vec3 in = part_frame_point_in(f, p);
    int ring = (int)lround((in.z / f->length - LOWEST) / STEP);
    double angle = atan2(in.y, in.x) / (2 * PI) * SHAPE_AROUND;
    int around = ((int)lround(angle) + SHAPE_AROUND) % SHAPE_AROUND;
    int level = (int)(hypot(in.x, in.y) / radius / TOP * LEVELS);
    if (ring < 0 || ring >= SHAPE_ALONG || level >= LEVELS)
        return;
    uint16_t *count = &tally->count[ring][around][level];
    *count = (uint16_t)(*count + (*count < UINT16_MAX));
}

static enum status add_frame(struct tally *tallies, struct take *take, const struct source_rays *rays, int64_t frame)
{
    const struct take_entry *e = take_entry(take, frame);
    struct take_pictures seen;
    enum status status = take_read(take, frame, TAKE_DEPTH | TAKE_MASK, &seen);
    if (status != OK || !seen.depth)
        return status;
    struct part_bones bones = part_bones_of(&e->skeleton, take_body(take));
    struct part_frame frames[PART_COUNT];
    bool framed[PART_COUNT];
    for (int i = 0; i < bones.count; i++)
        framed[i] = part_frame_bodily(&e->skeleton, bones.part[i], &frames[i]);
    double outside = part_outside_m(seen.mask != NULL);
    int count = source_rays_count(rays);
    const struct lens *lens = &take_calibration(take)->depth;
    for (int i = 0; i < count; i++) {
        if (!part_pixel_solid(seen.depth, seen.mask, lens->width, lens->height, i))
            continue;
        struct vec3 p = source_rays_point(rays, i, seen.depth[i]);
        uint16_t parts = part_label(&bones, p, SHARED_M, outside);
        for (int b = 0; b < bones.count && parts; b++)
            if (parts >> bones.part[b] & 1 && framed[b])
                add_point(&tallies[bones.part[b]], &frames[b], bones.radius[b], p);
    }
    return OK;
}

// The median stand-off of a cell, cylinder radii; negative: too few samples.
static float median(const uint16_t count[LEVELS])
{
    long total = 0, below = 0;
    for (int i = 0; i < LEVELS; i++)
        total += count[i];
    if (total < 3)
        return -1;
    for (int i = 0; i < LEVELS; i++) {
        if (2 * (below + count[i]) >= total)
            return (float)((i + (total / 2.0 - below) / count[i]) * TOP / LEVELS);
        below += count[i];
    }
    return -1;
}

// Which rings are there: outwards from the middle as long as they were seen about as much.
static bool find_ends(const struct tally *tally, struct part_shape *shape)
{
    long rings[SHAPE_ALONG] = {0}, total = 0, below = 0, inner = 0;
    for (int i = 0; i < SHAPE_ALONG; i++) {
        for (int k = 0; k < SHAPE_AROUND; k++)
            for (int l = 0; l < LEVELS; l++)
                rings[i] += tally->count[i][k][l];
        total += rings[i];
    }
    if (total < ENOUGH)
        return false;
    // The middle of what was seen, which need not be the bone's: a head stands on top of its own.
    int middle = 0;
    while (2 * (below + rings[middle]) < total)
        below += rings[middle++];
    int from = middle > 3 ? middle - 3 : 0, to = middle + 3 < SHAPE_ALONG ? middle + 3 : SHAPE_ALONG - 1;
    for (int i = from; i <= to; i++)
        inner += rings[i];
    double least = SEEN_SHARE * (double)inner / (to - from + 1);
    shape->first = shape->last = middle;
    while (shape->first > 0 && (double)rings[shape->first - 1] >= least)
        shape->first--;
    while (shape->last + 1 < SHAPE_ALONG && (double)rings[shape->last + 1] >= least)
        shape->last++;
    return shape->last - shape->first >= 4;
}

// Fills cells that nobody saw along their ring, from the two nearest seen ones.
static bool fill_ring(float ring[SHAPE_AROUND])
{
    float seen[SHAPE_AROUND];
    memcpy(seen, ring, sizeof seen);
    int any = 0;
    for (int k = 0; k < SHAPE_AROUND; k++)
        any += seen[k] >= 0;
    if (any < SHAPE_AROUND / 8)
        return false;
    for (int k = 0; k < SHAPE_AROUND; k++) {
        if (seen[k] >= 0)
            continue;
        int left = 1, right = 1;
        while (seen[(k - left + SHAPE_AROUND) % SHAPE_AROUND] < 0)
            left++;
        while (seen[(k + right) % SHAPE_AROUND] < 0)
            right++;
        float a = seen[(k - left + SHAPE_AROUND) % SHAPE_AROUND], b = seen[(k + right) % SHAPE_AROUND];
        ring[k] = (a * (float)right + b * (float)left) / (float)(left + right);
    }
    return true;
}

static void smooth(struct part_shape *s)
{
    struct part_shape from = *s;
    for (int i = s->first; i <= s->last; i++) {
        int up = i > s->first ? i - 1 : i, down = i < s->last ? i + 1 : i;
        for (int k = 0; k < SHAPE_AROUND; k++) {
            int l = (k + SHAPE_AROUND - 1) % SHAPE_AROUND, r = (k + 1) % SHAPE_AROUND;
            float rows[3];
            const int at[3] = {up, i, down};
            for (int j = 0; j < 3; j++)
                rows[j] = (from.radius[at[j]][l] + 2 * from.radius[at[j]][k] + from.radius[at[j]][r]) / 4;
            s->radius[i][k] = (rows[0] + 2 * rows[1] + rows[2]) / 4;
        }
    }
}

static void conclude(const struct tally *tally, bool narrow_below, struct part_shape *shape)
{
    if (!find_ends(tally, shape))
        return;
    bool filled[SHAPE_ALONG] = {false};
    int good = -1;
    for (int i = shape->first; i <= shape->last; i++) {
        for (int k = 0; k < SHAPE_AROUND; k++)
            shape->radius[i][k] = median(tally->count[i][k]);
        filled[i] = fill_ring(shape->radius[i]);
        if (filled[i] && good < 0)
            good = i;
    }
    if (good < 0)
        return;
    for (int i = good - 1; i >= shape->first; i--)
        memcpy(shape->radius[i], shape->radius[i + 1], sizeof shape->radius[i]);
    for (int i = good; i <= shape->last; i++)
        if (!filled[i])
            memcpy(shape->radius[i], shape->radius[i - 1], sizeof shape->radius[i]);
    if (narrow_below) { // down to the joint that it turns about: a neck, too hidden to be measured
        int joint = (int)lround(-LOWEST / STEP);
        for (int i = shape->first - 1; i >= joint; i--)
            for (int k = 0; k < SHAPE_AROUND; k++)
                shape->radius[i][k] = (float)NECK_SHARE * shape->radius[shape->first][k];
        shape->first = joint < shape->first ? joint : shape->first;
    }
    smooth(shape);
    shape->known = true;
}

enum status shape_measure(struct shape *out, struct take *take, const struct source_rays *rays, int max_frames)
{
    *out = (struct shape){0};
    int64_t usable = 0, seen = 0, frames = take_frame_count(take);
    for (int64_t i = 0; i < frames; i++)
        usable += take_entry(take, i)->has_skeleton && take_entry(take, i)->has_depth;
    if (!usable)
        return OK;
    struct tally *tallies = calloc(PART_COUNT, sizeof *tallies);
    if (!tallies)
        return fail(ERR_MEMORY, "out of memory");
    enum status status = OK;
    for (int64_t i = 0; i < frames && status == OK; i++) {
        if (!take_entry(take, i)->has_skeleton || !take_entry(take, i)->has_depth)
            continue;
        // Every usable frame, or max_frames of them at even steps.
        bool chosen = usable <= max_frames || seen * max_frames / usable != (seen + 1) * max_frames / usable;
        seen++;
        if (chosen)
            status = add_frame(tallies, take, rays, i);
    }
    for (int p = 0; p < PART_COUNT && status == OK; p++)
        conclude(&tallies[p], p == PART_HEAD, &out->parts[p]);
    free(tallies);
    return status;
}

// How far the points' end lies beyond the shape's: all but the outermost hundredth of them, counted in bins.
static double end_shift(const struct part_shape *s, const struct part_frame *f, const float *points, int count)
{
    enum { BINS = 256 };
    int bins[BINS] = {0}, used = 0;
    double low = shape_height(s->last) * f->length - END_REACH_M;
    for (int i = 0; i < count; i++) {
        const float *at = points + 3 * (size_t)i;
        int bin = (int)floor((part_frame_point_in(f, v3(at[0], at[1], at[2])).z - low) / (2 * END_REACH_M) * BINS);
        if (bin >= 0) {
            bins[bin < BINS ? bin : BINS - 1]++;
            used++;
        }
    }
    if (used < SHIFT_POINTS)
        return 0;
    int top = BINS - 1;
    for (int beyond = bins[top]; top > 0 && beyond * 100 < used; beyond += bins[top])
        top--;
    return (top + 1.0) / BINS * 2 * END_REACH_M - END_REACH_M;
}

struct vec3 shape_shift(const struct part_shape *s, const struct part_frame *f, double radius, bool free_end,
                        const float *points, int count)
{
    struct vec3 shift = v3(0, 0, 0);
    for (int round = 0; round < SHIFT_ROUNDS; round++) {
        double xx = 0, xy = 0, yy = 0, x = 0, y = 0, used = 0;
        for (int i = 0; i < count; i += 3) {
            const float *at = points + 3 * (size_t)i;
            struct vec3 in = v3_sub(part_frame_point_in(f, v3(at[0], at[1], at[2])), shift);
            int ring = (int)lround((in.z / f->length - LOWEST) / STEP);
            double far = hypot(in.x, in.y);
            if (ring < s->first || ring > s->last || !(far > 1e-3))
                continue;
            int around = (int)lround(atan2(in.y, in.x) / (2 * PI) * SHAPE_AROUND);
            double off = far - radius * s->radius[ring][(around + SHAPE_AROUND) % SHAPE_AROUND];
            if (fabs(off) > SHIFT_LIMIT_M)
                continue; // something else's
            double cx = in.x / far, cy = in.y / far;
            xx += cx * cx, xy += cx * cy, yy += cy * cy;
            x += cx * off, y += cy * off;
            used++;
        }
        if (used < SHIFT_POINTS)
            return v3(0, 0, 0);
        xx += SHIFT_TRUST * used;
        yy += SHIFT_TRUST * used;
        double det = xx * yy - xy * xy;
        shift = v3_add(shift, v3((yy * x - xy * y) / det, (xx * y - xy * x) / det, 0));
    }
    if (free_end)
        shift.z = end_shift(s, f, points, count);
    double far = v3_length(shift);
    return far > SHIFT_LIMIT_M ? v3_scale(shift, SHIFT_LIMIT_M / far) : shift;
}

enum status shape_mesh(const struct part_shape *s, struct cylinder_mesh *out)
{
    assert(s->known);
    int rings = s->last - s->first + 3; // with a ring of no width at either end
    *out = (struct cylinder_mesh){.vertex_count = rings * SHAPE_AROUND, .index_count = (rings - 1) * SHAPE_AROUND * 6};
    out->vertices = malloc(sizeof(float) * 3 * (size_t)out->vertex_count);
    out->indices = malloc(sizeof(uint16_t) * (size_t)out->index_count);
    if (!out->vertices || !out->indices) {
        cylinder_mesh_free(out);
        return fail(ERR_MEMORY, "out of memory");
    }
    float *v = out->vertices;
    for (int i = 0; i < rings; i++) {
        bool pole = i == 0 || i == rings - 1;
        int ring = i == 0 ? s->first : i == rings - 1 ? s->last : s->first + i - 1;
        double height = shape_height(ring) + (i == 0 ? -STEP / 2 : i == rings - 1 ? STEP / 2 : 0);
        for (int k = 0; k < SHAPE_AROUND; k++) {
            double r = pole ? 0 : s->radius[ring][k], a = 2 * PI * k / SHAPE_AROUND;
            *v++ = (float)(r * cos(a));
            *v++ = (float)(r * sin(a));
            *v++ = (float)height;
        }
    }
    cylinder_mesh_indices(out->indices, SHAPE_AROUND, rings);
    return OK;
}
