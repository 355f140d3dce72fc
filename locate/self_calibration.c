// The lens of a camera that nobody has measured: its focal length is learnt from the place, while the camera is
// found in it. Near things and far ones fit together only with the right one, see locate/focal_estimate.h.
#include "locate/locator_internal.h"

// A change smaller than this (of the logarithm) or than twice what it is sure to is not worth losing what is followed.
static const double WORTH = 0.001, SURELY = 2;
// Of the pictures that are followed one in so many is asked: those between show the same things.
enum { ASKED = 3 };

// What is known of the focal length, of its logarithm less that of the lens in use.
static double known_of(const struct locator *l, double *sigma)
{
    *sigma = l->told.focal_sigma;
    return focal_known(&l->focal, log(l->told.fx / l->lens.fx), sigma);
}

void locator_learn_lens(struct locator *l)
{
    if (!(l->told.focal_sigma > 0))
        return;
    const double by = known_of(l, &l->lens.focal_sigma), sigma = l->lens.focal_sigma;
    if (!(fabs(by) > WORTH && fabs(by) > SURELY * sigma))
        return;
    struct lens better = l->lens;
    struct refiner *refiner;
    better.fx *= exp(by);
    better.fy *= exp(by);
    if (refiner_open(&refiner, &better) != OK)
        return; // no memory: the old one still serves
    refiner_close(&l->refiner);
    l->refiner = refiner;
    l->lens = better;
    l->track_count = 0;
    focal_shift(&l->focal, by);
    known_of(l, &l->lens.focal_sigma);
}

void locator_ask_for_focal(struct locator *l, const struct fit_tag *tags, const struct fit_point *points,
                           int point_count, const struct pose *camera_from_world)
{
    if (++l->unasked < ASKED)
        return;
    l->unasked = 0;
    focal_add(&l->focal, tags, l->count, points, point_count, l->lens.fx, l->lens.fy, l->motion, camera_from_world);
}

// How far away what the camera is found by is, in the mean; 0 where there is nothing.
static double distance_of(const struct fit_tag *tags, int tag_count, const struct fit_point *points, int point_count,
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

void locator_doubt_lens(const struct locator *l, const struct fit_tag *tags, const struct fit_point *points,
                        int point_count, const struct pose *camera_from_world, double covariance[36])
{
    if (!(l->told.focal_sigma > 0))
        return;
    // What is seen as large from twice as far through twice the focal length: the shift along the axis.
    const double off_m = l->lens.focal_sigma * distance_of(tags, l->count, points, point_count, camera_from_world);
    covariance[35] += off_m * off_m;
}
