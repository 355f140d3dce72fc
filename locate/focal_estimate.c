#include "locate/focal_estimate.h"

#include <string.h>

// All of log(focal length); chosen by hand unless something else is said.
static const double STEP = 0.01, MAX_LOG_SCALE = 0.4, CONVERGED = 0.001;
// The size of printed tags and a map's scale are seldom more accurate than TOLERATED.
static const double TOLERATED = 0.02, SURE_SIGMA = 4;
// Least uncertainty of a tag corner: far from the right focal length sharper ones would be outliers.
static const double LOOSE_PX = 0.1;
// Bounds of one image's standard deviation: above WORST_SIGMA it is not used; none is better than BEST_SIGMA, because
// of the errors that its tags and points have in common.
static const double WORST_SIGMA = 0.05, BEST_SIGMA = 0.003;
// Images underestimate the distance to a focal length far off by up to this share of it, since their inliers were
// selected with the wrong one.
static const double SHORTFALL_SHARE = 0.5;

struct scaled_problem {
    struct tag_observation seen[PNP_MAX_TAGS];
    struct pnp_tag tags[PNP_MAX_TAGS];
    struct pnp_point points[FOCAL_MAX_POINTS];
};

// The robust cost of the best pose if the focal length were exp(log_scale) times that of the calibration: rays are that
// much less steep, pixels the same. *camera_from_world: in: start, out: that pose.
static double cost_at(const struct pose_problem *problem, double log_scale, struct pose *camera_from_world)
{
    const struct pnp_tag *tags = problem->tags;
    const struct pnp_point *points = problem->points;
    const int count = problem->tag_count, point_count = problem->point_count;
    struct shutter_motion moving = problem->motion ? *problem->motion : shutter_motion_unknown();
    struct scaled_problem e = {0};
    double scale = exp(log_scale);
    for (int i = 0; i < count; i++) {
        e.seen[i] = *tags[i].seen;
        for (int k = 0; k < 4; k++) {
            e.seen[i].ray[k].x /= scale;
            e.seen[i].ray[k].y /= scale;
        }
        e.tags[i] = tags[i];
        e.tags[i].seen = &e.seen[i];
        e.tags[i].map_px = fmax(tags[i].map_px, LOOSE_PX);
        e.tags[i].depth = NULL;
        e.tags[i].used = true; // a wrong focal length makes correct tags disagree
    }
    for (int i = 0; i < point_count; i++) {
        e.points[i] = points[i];
        e.points[i].x /= scale;
        e.points[i].y /= scale;
        e.points[i].z = 0;
    }
    const struct pose_problem scaled = {.tags = e.tags,
                                        .tag_count = count,
                                        .points = e.points,
                                        .point_count = point_count,
                                        .fx = problem->fx * scale,
                                        .fy = problem->fy * scale,
                                        .motion = problem->motion ? &moving : NULL};
    return pnp_refine(&scaled, camera_from_world);
}

void focal_estimate_add(struct focal_estimate *estimate, const struct pose_problem *problem,
                        const struct pose *camera_from_world)
{
    double at = 0, curvature = 0, cost = 0, numbers = -7; // degrees of freedom: pose and focal length take up seven
    struct pose_problem own = *problem;
    own.point_count = own.point_count < FOCAL_MAX_POINTS ? own.point_count : FOCAL_MAX_POINTS;
    numbers += 8 * own.tag_count + 2 * own.point_count;
    if (!(numbers > 0))
        return;
    for (int round = 0; round < 8; round++) {
        struct pose pose[3] = {*camera_from_world, *camera_from_world, *camera_from_world};
        double c[3];
        for (int k = 0; k < 3; k++)
            c[k] = cost_at(&own, at + (k - 1) * STEP, &pose[k]);
        curvature = (c[0] - 2 * c[1] + c[2]) / (STEP * STEP);
        cost = c[1];
        // Far off, where the robust cost flattens, a step of bounded length down the slope.
        double slope = (c[2] - c[0]) / (2 * STEP), step = curvature > 0 ? -slope / curvature : -slope * INFINITY;
        step = fmax(-5 * STEP, fmin(5 * STEP, step));
        if (fabs(step) < CONVERGED)
            break;
        at += step;
        if (!(fabs(at) < MAX_LOG_SCALE))
            return;
    }
    // The cost is chi squared; residuals larger than their covariances explain scale the variance up.
    double information = curvature / 2 / fmax(1, cost / numbers);
    if (!(information > 1 / (WORST_SIGMA * WORST_SIGMA)) || !isfinite(at))
        return;
    information = 1 / (1 / information + BEST_SIGMA * BEST_SIGMA);
    estimate->sum += at * information;
    estimate->information += information;
    estimate->frames++;
}

double focal_estimate_posterior(const struct focal_estimate *estimate, double before, double *sigma)
{
    const double prior = 1 / (*sigma * *sigma);
    *sigma = 1 / sqrt(prior + estimate->information);
    return (before * prior + estimate->sum) / (prior + estimate->information);
}

void focal_estimate_shift(struct focal_estimate *estimate, double by)
{
    if (!estimate->frames)
        return;
    const double mean = estimate->sum / estimate->information - by, worse = SHORTFALL_SHARE * by;
    estimate->information = 1 / (1 / estimate->information + worse * worse);
    estimate->sum = mean * estimate->information;
}

bool focal_estimate_is_wrong(const struct focal_estimate *estimate, double *scale)
{
    double mean = estimate->frames ? estimate->sum / estimate->information : 0;
    *scale = exp(mean);
    return estimate->frames && fabs(mean) > TOLERATED && fabs(mean) > SURE_SIGMA / sqrt(estimate->information);
}
