// The sides of tags as the depth shows them, against the list: a wrong number in tags.json is the commonest mistake of
// those who hang tags, and without this check it looks like a tag that was moved.
//
// A tag's depth samples lie on a plane; its corners' rays meet that plane in a square whose side is measured. The error
// is that of the plane's distance, a share of the side: samples' noise, and the sensor's common scale error, which the
// other tags show.
#include "base/linear_algebra.h"
#include "capture/mapping/map_internal.h"

#include <stdlib.h>

// All chosen by hand.
enum { MIN_SIGHTINGS = 2, MAX_SIGHTINGS = 64, MIN_SAMPLES = 8 };
static const double FAR_M = 60;         // no sensor measures so far, but depth in another unit is said to be
                                        // as far
static const double SLANT_COSINE = 0.5; // a tag seen at 60 degrees or less from its normal
// A depth sensor's common scale error is below 3 %, and tags are not printed so inexactly.
static const double WRONG_SHARE = 0.06;
static const double SIGMAS = 4; // of the measured side, added to that

// The plane 1 / z = a x + b y + c through the samples, by least squares. False: too few of them.
static bool fit_plane(const struct tag_depth *depth, double plane[3])
{
    double n[9] = {0}, g[3] = {0};
    if (depth->count < MIN_SAMPLES)
        return false;
    for (int i = 0; i < depth->count; i++) {
        const struct depth_sample *s = &depth->sample[i];
        const double q[3] = {s->x, s->y, 1};
        for (int k = 0; k < 3; k++) {
            g[k] += q[k] / s->z;
            for (int l = 0; l < 3; l++)
                n[k * 3 + l] += q[k] * q[l];
        }
    }
    if (!cholesky_factor(n, 3))
        return false;
    cholesky_solve(n, 3, g);
    for (int k = 0; k < 3; k++)
        plane[k] = g[k];
    return true;
}

// The side that one sighting shows, metres; 0: it shows none.
static double measured_side(const struct tag_observation *seen, const struct tag_depth *depth)
{
    double plane[3];
    struct vec3 corner[4];
    if (!fit_plane(depth, plane))
        return 0;
    for (int k = 0; k < 4; k++) {
        const double inverse = plane[0] * seen->ray[k].x + plane[1] * seen->ray[k].y + plane[2];
        if (!(inverse > 1 / FAR_M))
            return 0;
        corner[k] = v3_scale(seen->ray[k], 1 / inverse);
    }
    struct vec3 normal = v3_unit(v3_cross(v3_sub(corner[2], corner[0]), v3_sub(corner[3], corner[1])));
    struct vec3 middle = v3_scale(v3_add(corner[0], corner[2]), 0.5);
    if (fabs(v3_dot(normal, v3_unit(middle))) < SLANT_COSINE)
        return 0;
    // From the area: insensitive to a tilt of the plane, to first order.
    return sqrt(0.5 * v3_length(v3_cross(v3_sub(corner[2], corner[0]), v3_sub(corner[3], corner[1]))));
}

static int compare_doubles(const void *left, const void *right)
{
    const double a = *(const double *)left, b = *(const double *)right;
    return (a > b) - (a < b);
}

// The median over the sweep's sightings, and its standard error from the median deviation. False: too few sightings.
static bool side_of_tag(const struct map *map, int32_t tag, double *side_m, double *sigma_m)
{
    double side[MAX_SIGHTINGS];
    int count = 0;
    for (int32_t i = 0; i < map->frame_count; i++)
        for (int32_t k = 0; k < map->frames[i].seen_count && count < MAX_SIGHTINGS; k++) {
            const struct map_frame *f = &map->frames[i];
            const double s = f->tag_index[k] == tag ? measured_side(&f->seen[k], &f->depths[k]) : 0;
            if (s > 0)
                side[count++] = s;
        }
    if (count < MIN_SIGHTINGS)
        return false;
    qsort(side, (size_t)count, sizeof *side, compare_doubles);
    *side_m = side[count / 2];
    for (int i = 0; i < count; i++)
        side[i] = fabs(side[i] - *side_m);
    qsort(side, (size_t)count, sizeof *side, compare_doubles);
    // Of few sightings the deviation itself is uncertain: not below a hundredth of the side.
    *sigma_m = fmax(1.4826 * side[count / 2], 0.01 * *side_m) / sqrt(count);
    return true;
}

// The median ratio of measured to listed sides; 0 where no side was measured.
static double common_ratio(const struct map *map)
{
    double ratio[MAPPER_MAX_TAGS];
    int count = 0;
    for (int32_t t = 0; t < map->tag_count; t++)
        if (map->tags[t].measured_side_m > 0 && count < MAPPER_MAX_TAGS)
            ratio[count++] = map->tags[t].measured_side_m / map->tags[t].side_m;
    if (!count)
        return 0;
    qsort(ratio, (size_t)count, sizeof *ratio, compare_doubles);
    return ratio[count / 2];
}

static void forget_observations(struct map_frame *frame, int32_t tag)
{
    int32_t kept = 0;
    for (int32_t k = 0; k < frame->seen_count; k++) {
        if (frame->tag_index[k] == tag)
            continue;
        frame->seen[kept] = frame->seen[k];
        frame->depths[kept] = frame->depths[k];
        frame->raw_seen[kept] = frame->raw_seen[k];
        frame->raw_depths[kept] = frame->raw_depths[k];
        frame->tag_index[kept++] = frame->tag_index[k];
    }
    frame->seen_count = kept;
}

enum status map_check_tag_sides(struct map *map)
{
    double *sigma = calloc((size_t)map->tag_count + 1, sizeof *sigma);
    if (!sigma)
        return fail(ERR_MEMORY, "no memory to measure %d tags", (int)map->tag_count);
    for (int32_t t = 0; t < map->tag_count; t++)
        if (!side_of_tag(map, t, &map->tags[t].measured_side_m, &sigma[t]))
            map->tags[t].measured_side_m = 0;
    // What most tags agree on is the sensor's scale, unless no sensor is so wrong: then it is the list's, as when the
    // printer scaled the pages, or depth is in another unit, or the lens is another one. There would be too little left
    // to map by, so that these tags stay, and depth is fitted to them: which of the three it is shows in the map.
    map->side_ratio = common_ratio(map);
    const double ratio = map->side_ratio > 0 ? map->side_ratio : 1;
    const bool list_is_wrong = fabs(ratio - 1) > WRONG_SHARE;
    const double scale = list_is_wrong ? 1 : ratio;
    map->list_is_wrong = list_is_wrong;
    for (int32_t t = 0; t < map->tag_count; t++) {
        struct map_tag *tag = &map->tags[t];
        const double off = fabs(tag->measured_side_m / (scale * tag->side_m) - 1),
                     max = WRONG_SHARE + (list_is_wrong ? 0 : SIGMAS * sigma[t] / tag->side_m);
        tag->wrong = tag->measured_side_m > 0 && !tag->mapped && off > max; // an earlier sweep's are constants
        tag->measured_side_m /= scale;
        for (int32_t i = 0; i < map->frame_count && tag->wrong && !list_is_wrong; i++)
            forget_observations(&map->frames[i], t);
    }
    if (list_is_wrong)
        map_scale_depth(map, 1 / ratio);
    free(sigma);
    return OK;
}
