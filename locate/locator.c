// Opening and closing a locator; localisation is in locate/localize.c, tracking in locate/tracking.c.
#include "locate/locator_internal.h"

#include <stdlib.h>
#include <string.h>

// A landmark's count of searches in vain starts at 3. A search is expected to find it with the weight 1 / (1 + count),
// see landmark_activation.c: so one that was never searched for counts a quarter of one that was just found, as if it
// had been found and then missed three times. Chosen by hand.
enum { UNKNOWN_MISSED_COUNT = 3 };

enum { MIN_TRACKED = 30, MAX_TRACKED = 200 }; // of locator_options.points

struct locator_options locator_default_options(void)
{
    return (struct locator_options){
        .quad_decimate = 1, .features = 1000, .points = 150, .max_rms_px = 2.5, .max_position_sigma_m = 0.05};
}

static enum status check_inputs(const struct place *place, const struct lens *lens,
                                const struct locator_options *options)
{
    enum status status = lens_check(lens, "color");
    if (status != OK)
        return status;
    if (options->features < 100 || options->features > FEATURES_MAX)
        return fail(ERR_INPUT, "features must lie between 100 and %d, not %d", FEATURES_MAX, (int)options->features);
    if (options->points < MIN_TRACKED || options->points > MAX_TRACKED)
        return fail(ERR_INPUT, "points must lie between %d and %d, not %d", MIN_TRACKED, MAX_TRACKED,
                    (int)options->points);
    if (!(options->max_rms_px > 0))
        return fail(ERR_INPUT, "max_rms_px must be greater than 0, not %g", options->max_rms_px);
    if (!(options->max_position_sigma_m > 0))
        return fail(ERR_INPUT, "max_position_sigma_m must be greater than 0, not %g", options->max_position_sigma_m);
    if (place->tag_count <= 0 && place->point_count < LOCATOR_MIN_WITHOUT_TAGS)
        return fail(ERR_INPUT, "the place holds no tag and too few points to find a camera by; map it again, with tags "
                               "on its walls");
    for (int32_t i = 0; i < place->tag_count; i++) {
        const struct place_tag *tag = &place->tags[i];
        if (!(tag->side_m > 0) || !isfinite(tag->side_m) || !pose_finite(tag->world_from_tag))
            return fail(ERR_INPUT, "tag %d of the place has no sensible size or pose", (int)tag->id);
        for (int32_t k = 0; k < i; k++)
            if (place->tags[k].id == tag->id)
                return fail(ERR_INPUT,
                            "the place holds two tags with the number %d; take one of them away and map it again",
                            (int)tag->id);
    }
    return OK;
}

static enum status init_locator(struct locator *l, const struct place *place)
{
    size_t pixels = (size_t)l->lens.width * (size_t)l->lens.height, n = (size_t)place->tag_count + 1;
    l->gray = malloc(pixels);
    l->tags = malloc(n * sizeof *l->tags);
    l->patterns = malloc(n * sizeof *l->patterns);
    l->tag_tracks = calloc(n, sizeof *l->tag_tracks);
    l->moved_votes = calloc(n, sizeof *l->moved_votes);
    if (!l->gray || !l->tags || !l->patterns || !l->tag_tracks || !l->moved_votes)
        return fail(ERR_MEMORY, "no memory to find a camera in the place");
    if (place->point_count > 0) {
        size_t points = (size_t)place->point_count;
        l->points = malloc(points * sizeof *l->points);
        l->region_points = malloc(points * sizeof *l->region_points);
        l->region_of = malloc(points * sizeof *l->region_of);
        l->points_by_region = malloc(points * sizeof *l->points_by_region);
        l->missed_count = calloc(points, sizeof *l->missed_count);
        if (!l->points || !l->region_points || !l->region_of || !l->points_by_region || !l->missed_count)
            return fail(ERR_MEMORY, "no memory to find a camera in the place");
        memcpy(l->points, place->points, points * sizeof *l->points);
        memset(l->missed_count, UNKNOWN_MISSED_COUNT, points);
        l->point_count = place->point_count;
    }
    l->tag_count = place->tag_count;
    if (l->tag_count)
        memcpy(l->tags, place->tags, (n - 1) * sizeof *l->tags);
    for (int32_t i = 0; i < l->tag_count; i++)
        if (!tag_pattern(l->tags[i].id, &l->patterns[i]))
            return fail(ERR_INPUT, "the place's tag %d is not of the family tag36h11, which ends at %d",
                        (int)l->tags[i].id, TAG_ID_COUNT - 1);
    enum status status = tag_refiner_open(&l->refiner, &l->lens);
    if (status == OK)
        status = klt_pyramid_open(&l->pyramid, l->lens.width, l->lens.height);
    if (status == OK)
        status = tag_detector_open(&l->detector, l->options.quad_decimate);
    const double coarse = 2 * l->options.quad_decimate;
    return status == OK && coarse <= TAG_MAX_DECIMATE ? tag_detector_open(&l->coarse_detector, coarse) : status;
}

enum status locator_open(struct locator **out, const struct place *place, const struct lens *lens,
                         const struct locator_options *options)
{
    *out = NULL;
    struct locator_options wanted = options ? *options : locator_default_options();
    enum status status = check_inputs(place, lens, &wanted);
    if (status != OK)
        return status;
    struct locator *l = calloc(1, sizeof *l);
    if (!l)
        return fail(ERR_MEMORY, "no memory to find a camera in the place");
    l->lens = l->given_lens = *lens;
    l->options = wanted;
    l->motion = lens->readout_s > 0 ? &l->frame_motion : NULL;
    l->expected = shutter_motion_unknown();
    status = init_locator(l, place);
    if (status != OK)
        locator_close(&l);
    *out = l;
    return status;
}

void locator_close(struct locator **out)
{
    struct locator *l = *out;
    if (!l)
        return;
    tag_detector_close(&l->detector);
    tag_detector_close(&l->coarse_detector);
    tag_refiner_close(&l->refiner);
    klt_pyramid_close(&l->pyramid);
    free(l->gray);
    free(l->tags);
    free(l->patterns);
    free(l->tag_tracks);
    free(l->moved_votes);
    free(l->points);
    free(l->region_points);
    free(l->region_of);
    free(l->points_by_region);
    free(l->missed_count);
    free(l);
    *out = NULL;
}

void locator_set_motion_prior(struct locator *l, const double velocity[6], const double covariance[36])
{
    l->expected = shutter_motion_prior(velocity, covariance);
}

const struct lens *locator_lens(const struct locator *l) { return &l->lens; }

int locator_seen_tags(const struct locator *l, int32_t *ids, int capacity)
{
    int count = 0;
    for (int i = 0; i < l->observed_count; i++) {
        const int32_t id = l->tags[l->observed_tag[i]].id;
        int at = 0;
        while (at < count && ids[at] < id)
            at++;
        if ((at < count && ids[at] == id) || count == capacity)
            continue;
        memmove(ids + at + 1, ids + at, (size_t)(count++ - at) * sizeof *ids);
        ids[at] = id;
    }
    return count;
}

double locator_depth_scale(const struct locator *l)
{
    double sum = 0, weights = 0;
    for (int i = 0; i < l->observed_count; i++) {
        const struct tag_depth *depth = &l->depths[i];
        struct pose two[2];
        const int n = depth->count ? planar_poses(l->tags[l->observed_tag[i]].side_m, l->observations[i].ray, two) : 0;
        if (!n)
            continue;
        double measured = 0, z = two[0].translation.z;
        for (int32_t k = 0; k < depth->count; k++)
            measured += depth->sample[k].z / depth->count;
        z = n > 1 ? (z + two[1].translation.z) / 2 : z;
        const double side = l->tags[l->observed_tag[i]].side_m / z;
        sum += side * side * measured / z;
        weights += side * side;
    }
    return weights > 0 ? sum / weights : 0;
}

bool locator_focal_is_wrong(const struct locator *l, double *scale)
{
    return focal_estimate_is_wrong(&l->focal, scale);
}
