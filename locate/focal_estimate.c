#include "locate/focal_estimate.h"

#include <string.h>

static const double STEP = 0.01, MAX_LOG_SCALE = 0.4, CONVERGED = 0.001;
// A printed tag's side and a map's scale are seldom surer than this.
static const double TOLERATED = 0.02, SURE_SIGMA = 4;
// Corners are as loose as this: far from the right focal length they must still pull.
static const double LOOSE_PX = 0.1;
// A picture that knows it worse says nothing; none knows it better, because of the errors that its tags and points
// have in common.
static const double WORST_SIGMA = 0.05, BEST_SIGMA = 0.003;
// What pictures say of a focal length far off falls short by up to this share of it: what agrees with a wrong lens was
// chosen through it.
static const double SHORTFALL_SHARE = 0.5;

struct scaled_problem {
    struct tag_observation seen[PNP_MAX_TAGS];
    struct pnp_tag tags[PNP_MAX_TAGS];
    struct pnp_point points[FOCAL_MAX_POINTS];
    int count, point_count;
};

// The robust cost of the best pose if the focal length were exp(log_scale) times what it is
// said to be: rays are that much steeper, pixels the same.
static double cost_at(const struct pnp_tag *tags, int count, const struct pnp_point *points, int point_count,
                      double log_scale, double fx, double fy, const struct shutter_motion *motion,
                      struct pose *camera_from_world)
{
    struct shutter_motion moving = motion ? *motion : shutter_motion_unknown();
    struct scaled_problem e = {.count = count, .point_count = point_count};
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
        e.tags[i].used = true; // a wrong focal length is what makes good tags disagree
    }
    for (int i = 0; i < point_count; i++) {
        e.points[i] = points[i];
        e.points[i].x /= scale;
        e.points[i].y /= scale;
        e.points[i].z = 0;
    }
    return pnp_refine(e.tags, count, 0, e.points, point_count, 0, fx * scale, fy * scale, motion ? &moving : NULL,
                      camera_from_world);
}

void focal_estimate_add(struct focal_estimate *f, const struct pnp_tag *tags, int count, const struct pnp_point *points,
                        int point_count, double fx, double fy, const struct shutter_motion *motion,
                        const struct pose *camera_from_world)
{
    double at = 0, curvature = 0, cost = 0, numbers = -7;
    point_count = point_count < FOCAL_MAX_POINTS ? point_count : FOCAL_MAX_POINTS;
    numbers += 8 * count + 2 * point_count;
    if (!(numbers > 0))
        return;
    for (int round = 0; round < 8; round++) {
        struct pose pose[3] = {*camera_from_world, *camera_from_world, *camera_from_world};
        double c[3];
        for (int k = 0; k < 3; k++)
            c[k] = cost_at(tags, count, points, point_count, at + (k - 1) * STEP, fx, fy, motion, &pose[k]);
        curvature = (c[0] - 2 * c[1] + c[2]) / (STEP * STEP);
        cost = c[1];
        // Far off, where the robust cost flattens, only its slope leads the way.
        double slope = (c[2] - c[0]) / (2 * STEP), step = curvature > 0 ? -slope / curvature : -slope * INFINITY;
        step = fmax(-5 * STEP, fmin(5 * STEP, step));
        if (fabs(step) < CONVERGED)
            break;
        at += step;
        if (!(fabs(at) < MAX_LOG_SCALE))
            return;
    }
    // The cost is chi squared; errors larger than its evidence owns to make it less sure.
    double information = curvature / 2 / fmax(1, cost / numbers);
    if (!(information > 1 / (WORST_SIGMA * WORST_SIGMA)) || !isfinite(at))
        return;
    information = 1 / (1 / information + BEST_SIGMA * BEST_SIGMA);
    f->sum += at * information;
    f->information += information;
    f->frames++;
}

double focal_estimate_posterior(const struct focal_estimate *f, double before, double *sigma)
{
    const double prior = 1 / (*sigma * *sigma);
    *sigma = 1 / sqrt(prior + f->information);
    return (before * prior + f->sum) / (prior + f->information);
}

void focal_estimate_shift(struct focal_estimate *f, double by)
{
    if (!f->frames)
        return;
    const double mean = f->sum / f->information - by, worse = SHORTFALL_SHARE * by;
    f->information = 1 / (1 / f->information + worse * worse);
    f->sum = mean * f->information;
}

bool focal_estimate_is_wrong(const struct focal_estimate *f, double *scale)
{
    double mean = f->frames ? f->sum / f->information : 0;
    *scale = exp(mean);
    return f->frames && fabs(mean) > TOLERATED && fabs(mean) > SURE_SIGMA / sqrt(f->information);
}
