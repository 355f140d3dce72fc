// Self-calibration: an uncertain focal length is estimated while the camera is localised in the place, see
// locate/focal_estimate.h.
#include "locate/locator_internal.h"

// A smaller change (of the logarithm), or one below twice its standard deviation, is not worth losing the tracks.
// Chosen by hand.
static const double MIN_CHANGE = 0.001, MIN_SIGMAS = 2;
// One in so many tracked images is used: those between show the same. Chosen by hand.
enum { FOCAL_INTERVAL = 3 };

// The estimate of log(focal length) less that of the lens in use.
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
        return; // no memory: keep the old one
    tag_refiner_close(&l->refiner);
    l->refiner = refiner;
    l->lens = better;
    l->track_count = 0;
    focal_estimate_shift(&l->focal, by);
    focal_correction(l, &l->lens.focal_sigma);
}

void locator_observe_focal(struct locator *l, const struct pose_problem *problem, const struct pose *camera_from_world)
{
    if (++l->frames_since_focal < FOCAL_INTERVAL)
        return;
    l->frames_since_focal = 0;
    focal_estimate_add(&l->focal, problem, camera_from_world);
}

// The mean distance of tag corners and points along z; 0 where there are none.
static double mean_distance(const struct pose_problem *problem, const struct pose *camera_from_world)
{
    const struct pnp_tag *tags = problem->tags;
    double sum = 0;
    int count = 0;
    for (int i = 0; i < problem->tag_count; i++) {
        if (tags[i].used) {
            sum += 4 * pose_apply(*camera_from_world, tags[i].world_from_tag.translation).z; // of its corners
            count += 4;
        }
    }
    for (int i = 0; i < problem->point_count; i++)
        sum += pose_apply(*camera_from_world, problem->points[i].world).z;
    count += problem->point_count;
    return count ? sum / count : 0;
}

void locator_add_focal_variance(const struct locator *l, const struct pose_problem *problem,
                                const struct pose *camera_from_world, double covariance[36])
{
    if (!(l->given_lens.focal_sigma > 0))
        return;
    // Twice the distance with twice the focal length gives the same image size: the translation along z.
    const double off_m = l->lens.focal_sigma * mean_distance(problem, camera_from_world);
    covariance[35] += off_m * off_m;
}
