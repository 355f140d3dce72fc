// The lens of a camera that nobody has measured: its focal length is learnt from the place, while the camera is
// found in it. Near things and far ones fit together only with the right one, see locate/focal_estimate.h.
#include "locate/locator_internal.h"

// A change smaller than this (of the logarithm) or than twice what it is sure to is not worth losing what is followed.
static const double MIN_CHANGE = 0.001, MIN_SIGMAS = 2;
// Of the pictures that are followed one in so many is asked: those between show the same things.
enum { FOCAL_INTERVAL = 3 };

// What is known of the focal length, of its logarithm less that of the lens in use.
static double focal_correction(const struct locator *l, double *sigma)
{
    *sigma = l->given_lens.focal_sigma;
    return focal_estimate_posterior(&l->focal, log(l->given_lens.fx / l->lens.fx), sigma);
}

void locator_update_lens(struct locator *l)
{
    if (!(l->given_lens.focal_sigma > 0))
        return;
    const double by = focal_correction(l, &l->lens.focal_sigma), sigma = l->lens.focal_sigma;
    if (!(fabs(by) > MIN_CHANGE && fabs(by) > MIN_SIGMAS * sigma))
        return;
    struct lens better = l->lens;
    struct tag_refiner *refiner;
    better.fx *= exp(by);
    better.fy *= exp(by);
    if (tag_refiner_open(&refiner, &better) != OK)
        return; // no memory: the old one still serves
    tag_refiner_close(&l->refiner);
    l->refiner = refiner;
    l->lens = better;
    l->track_count = 0;
    focal_estimate_shift(&l->focal, by);
    focal_correction(l, &l->lens.focal_sigma);
}

void locator_observe_focal(struct locator *l, const struct pnp_tag *tags, const struct pnp_point *points,
                           int point_count, const struct pose *camera_from_world)
{
    if (++l->frames_since_focal < FOCAL_INTERVAL)
        return;
    l->frames_since_focal = 0;
    focal_estimate_add(&l->focal, tags, l->count, points, point_count, l->lens.fx, l->lens.fy, l->motion,
                       camera_from_world);
}

// How far away what the camera is found by is, in the mean; 0 where there is nothing.
static double mean_distance(const struct pnp_tag *tags, int tag_count, const struct pnp_point *points, int point_count,
                            const struct pose *camera_from_world)
{
    double sum = 0;
    int count = 0;
    for (int i = 0; i < tag_count; i++) {
        if (tags[i].used) {
            sum += 4 * pose_apply(*camera_from_world, tags[i].world_from_tag.translation).z; // of its corners
            count += 4;
        }
    }
    for (int i = 0; i < point_count; i++)
        sum += pose_apply(*camera_from_world, points[i].world).z;
    count += point_count;
    return count ? sum / count : 0;
}

void locator_add_focal_variance(const struct locator *l, const struct pnp_tag *tags, const struct pnp_point *points,
                                int point_count, const struct pose *camera_from_world, double covariance[36])
{
    if (!(l->given_lens.focal_sigma > 0))
        return;
    // What is seen as large from twice as far through twice the focal length: the shift along the axis.
    const double off_m = l->lens.focal_sigma * mean_distance(tags, l->count, points, point_count, camera_from_world);
    covariance[35] += off_m * off_m;
}
