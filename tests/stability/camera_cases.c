// A camera's pose from points, its filter, its fusion with the map, its focal length, relocalisation.
#include "base/linear_algebra.h"
#include "locate/focal_estimate.h"
#include "locate/pose_fusion.h"
#include "locate/relocalization.h"
#include "tests/stability/stability.h"

#include <string.h>

#define F_PX 525.0
enum { POINTS = 40 };

enum layout { SPREAD, COLLINEAR, COPLANAR, COINCIDENT, BEHIND };

// Points seen by a camera at the world's origin; deterministic and without chance.
static int lay_out(enum layout layout, int count, struct pnp_point out[POINTS])
{
    for (int i = 0; i < count; i++) {
        const double a = (i * 37 % 41) / 20.0 - 1, b = (i * 29 % 31) / 15.0 - 1, c = (i * 23 % 37) / 18.0 - 1;
        struct vec3 p = v3(a, 0.7 * b, 3 + c);
        if (layout == COLLINEAR)
            p = v3(a, 0.5 * a, 3 + a);
        if (layout == COPLANAR)
            p.z = 3;
        if (layout == COINCIDENT)
            p = v3(0.3, -0.1, 3);
        if (layout == BEHIND)
            p.z = -p.z;
        out[i] = (struct pnp_point){.world = p, .x = p.x / p.z, .y = p.y / p.z, .sigma_px = 0.5};
    }
    return count;
}

static struct pose_problem problem_of(const struct pnp_point *points, int count)
{
    return (struct pose_problem){.points = points, .point_count = count, .fx = F_PX, .fy = F_PX};
}

// in: layout, number of points -> the pose's standard deviation along z, metres: within a factor of two of a hand
// count where it is known.
static struct answer ask_covariance(const double *in)
{
    struct pnp_point points[POINTS];
    const struct pose_problem problem = problem_of(points, lay_out((enum layout)in[0], (int)in[1], points));
    double covariance[36];
    const struct pose at = POSE_IDENTITY;
    if (!pnp_covariance(&problem, &at, covariance))
        return answer_of(ANSWER_UNKNOWN);
    return answer_value(sqrt(covariance[35]));
}

// The information inverted as it comes, by elimination.
static struct answer covariance_by_elimination(const double *in)
{
    struct pnp_point points[POINTS];
    const struct pose_problem problem = problem_of(points, lay_out((enum layout)in[0], (int)in[1], points));
    double information[36], unit[6] = {0, 0, 0, 0, 0, 1};
    const struct pose at = POSE_IDENTITY;
    pnp_information(&problem, &at, information);
    gauss_solve(information, 6, unit);
    return answer_value(sqrt(fabs(unit[5])));
}

// in: layout, points, start off by so many metres -> how far off the refined pose is.
static struct answer ask_refine(const double *in)
{
    struct pnp_point points[POINTS];
    const struct pose_problem problem = problem_of(points, lay_out((enum layout)in[0], (int)in[1], points));
    struct pose at = {{0, 0, 0, 1}, {in[2], 0, 0}};
    (void)pnp_refine(&problem, &at);
    return answer_value(v3_length(at.translation));
}

// One step of Gauss and Newton, undamped, without the robust kernel's say.
static struct answer one_step(const double *in)
{
    struct pnp_point points[POINTS];
    const int count = lay_out((enum layout)in[0], (int)in[1], points);
    float xx = 0, xd = 0; // of the translation along x alone
    for (int i = 0; i < count; i++) {
        const float j = (float)(F_PX / points[i].world.z), d = (float)in[2] * j;
        xx += j * j;
        xd += j * d;
    }
    return answer_value(in[2] - (double)(0.5F * xd / xx)); // half of a step: damping that never ends
}

static struct answer ask_point_error(const double *in)
{
    const struct pnp_point p = {.world = v3(in[0], in[1], in[2]), .sigma_px = 1};
    const struct pose at = POSE_IDENTITY;
    const double error = pnp_point_error(&p, NULL, &at, F_PX, F_PX);
    return error >= PNP_NOT_VISIBLE ? answer_of(ANSWER_UNKNOWN) : answer_value(error);
}

static struct answer pixels_behind(const double *in)
{
    return answer_value(F_PX * sqrt(in[0] * in[0] + in[1] * in[1]) / fabs(in[2]));
}

// in: layout, points. Three matches at a time; no descriptor decides.
static struct answer ask_relocalize(const double *in)
{
    static struct feature_index index;
    static struct feature features[POINTS];
    struct pnp_point points[POINTS];
    struct place_landmark landmarks[POINTS] = {0};
    struct landmark_match matches[POINTS];
    const struct lens lens = {.width = 640, .height = 480, .fx = F_PX, .fy = F_PX, .cx = 319.5, .cy = 239.5};
    const int count = lay_out((enum layout)in[0], (int)in[1], points);
    for (int i = 0; i < count; i++) {
        landmarks[i].world = points[i].world;
        features[i] = (struct feature){.at = {F_PX * points[i].x + 319.5, F_PX * points[i].y + 239.5}, .scale = 1};
        matches[i] = (struct landmark_match){i, i};
    }
    feature_index_build(&index, features, count, &lens);
    const struct match_query query = {.points = landmarks, .point_count = count, .index = &index, .lens = &lens};
    struct pose camera_from_world;
    int inliers;
    if (!relocalize(&query, matches, count, NULL, &camera_from_world, &inliers))
        return answer_of(ANSWER_UNKNOWN);
    return answer_value(v3_length(camera_from_world.translation));
}

// As if any three points gave a pose.
static struct answer at_the_first_point(const double *in)
{
    (void)in;
    return answer_value(3);
}

// in: standard deviation of the measurement and of the state (both axes alike), offset -> the pose after the update.
static struct answer ask_kalman(const double *in)
{
    double start[36] = {0}, measured[36] = {0};
    struct pose_kalman k;
    const struct pose there = {{0, 0, 0, 1}, {in[2], 0, 0}};
    for (int i = 0; i < 6; i++) {
        start[7 * i] = in[1] * in[1];
        measured[7 * i] = in[0] * in[0];
    }
    pose_kalman_start(&k, POSE_IDENTITY, start);
    const double distance = pose_kalman_update(&k, there, measured, 1e9);
    return distance <= 1e9 ? answer_value(k.world_from_camera.translation.x) : answer_of(ANSWER_UNKNOWN);
}

static struct answer weighted_mean(const double *in)
{
    const double w = in[1] * in[1] / (in[1] * in[1] + in[0] * in[0]);
    return answer_value(w * in[2]);
}

// in: all of one covariance.
static struct answer ask_fusion(const double *in)
{
    struct pose_fusion a;
    struct pose_measurement m = {0};
    double by[6], start[36] = {0}, noise[36] = {0};
    for (int i = 0; i < 6; i++) {
        start[7 * i] = in[0];
        m.map_covariance[7 * i] = in[0];
        m.drift[7 * i] = m.noise[7 * i] = noise[7 * i] = in[0];
        m.offset[i] = 0.01;
    }
    pose_fusion_start(&a, start, noise);
    return pose_fusion_update(&a, &m, by) ? answer_value(by[3]) : answer_of(ANSWER_UNKNOWN);
}

static struct answer all_of_the_offset(const double *in) { return answer_value(0.01 * in[0] / in[0]); }

// in: layout, true focal length over the lens's -> the focal length found, over the lens's.
static struct answer ask_focal(const double *in)
{
    struct pnp_point points[POINTS];
    struct focal_estimate f = {0};
    const int count = lay_out((enum layout)in[0], POINTS, points);
    for (int i = 0; i < count; i++) {
        points[i].x *= in[1];
        points[i].y *= in[1];
    }
    const struct pose_problem problem = problem_of(points, count);
    const struct pose at = POSE_IDENTITY;
    for (int i = 0; i < 30; i++)
        focal_estimate_add(&f, &problem, &at);
    return f.frames ? answer_value(1) : answer_of(ANSWER_UNKNOWN);
}

// Nearer or longer: a plane does not say, and the distance is taken at its word.
static struct answer focal_at_given_distance(const double *in) { return answer_value(in[1]); }

static const struct stability_case cases[] = {
    {"pose's covariance from 40 points on a line", "Cholesky's pivots", ANSWER_UNKNOWN, ask_covariance, NULL,
     covariance_by_elimination, .in = {COLLINEAR, 40}, .unit = "m"},
    {"pose's covariance from 40 points in one place", "Cholesky's pivots", ANSWER_UNKNOWN, ask_covariance, NULL,
     covariance_by_elimination, .in = {COINCIDENT, 40}, .unit = "m"},
    {"pose's covariance from two points", "Cholesky's pivots", ANSWER_UNKNOWN, ask_covariance, NULL,
     covariance_by_elimination, .in = {SPREAD, 2}, .unit = "m"},
    {"pose's covariance from nothing", "Cholesky's pivots", ANSWER_UNKNOWN, ask_covariance, NULL,
     covariance_by_elimination, .in = {SPREAD, 0}, .unit = "m"},
    {"pose's covariance from points behind the camera", "what is not visible has no say", ANSWER_UNKNOWN,
     ask_covariance, NULL, covariance_by_elimination, .in = {BEHIND, 40}, .unit = "m"},
    {"pose from 40 points in a plane, started 1 m off", "damped until it falls", ANSWER_VALUE, ask_refine, NULL,
     one_step, .in = {COPLANAR, 40, 1}, .exact = {0}, .exact_count = 1, .tolerance = 1e-7, .unit = "m"},
    {"reprojection error of a point behind the camera", "what is not visible has no say", ANSWER_UNKNOWN,
     ask_point_error, NULL, pixels_behind, .in = {0, 0.1, -1}, .unit = "px"},
    {"reprojection error of a point at the camera", "what is not visible has no say", ANSWER_UNKNOWN, ask_point_error,
     NULL, pixels_behind, .in = {0, 0, 0}, .unit = "px"},
    {"reprojection error of a point that is NaN", "what is not visible has no say", ANSWER_UNKNOWN, ask_point_error,
     NULL, pixels_behind, .in = {0, 0, NAN}, .unit = "px"},
    {"relocalisation by points on a line", "P3P's triangle", ANSWER_UNKNOWN, ask_relocalize, NULL, at_the_first_point,
     .in = {COLLINEAR, 40}, .unit = "m"},
    {"relocalisation by points in one place", "P3P's triangle", ANSWER_UNKNOWN, ask_relocalize, NULL,
     at_the_first_point, .in = {COINCIDENT, 40}, .unit = "m"},
    {"relocalisation by points in a plane", "all roots of P3P", ANSWER_VALUE, ask_relocalize, NULL, at_the_first_point,
     .in = {COPLANAR, 40}, .exact = {0}, .exact_count = 1, .tolerance = 5e-2, .unit = "m"},
    {"relocalisation by two points", "enough inliers not to be chance", ANSWER_UNKNOWN, ask_relocalize, NULL,
     at_the_first_point, .in = {SPREAD, 2}, .unit = "m"},
    {"filter where nothing is uncertain", "Cholesky's pivots", ANSWER_UNKNOWN, ask_kalman, NULL, weighted_mean,
     .in = {0, 0, 0.1}, .unit = "m"},
    {"filter with a covariance of NaN", "Cholesky's pivots", ANSWER_UNKNOWN, ask_kalman, NULL, weighted_mean,
     .in = {NAN, 0.01, 0.1}, .unit = "m"},
    {"filter with a pose that is NaN", "NaN is beyond any bound", ANSWER_UNKNOWN, ask_kalman, NULL, weighted_mean,
     .in = {0.01, 0.01, NAN}, .unit = "m"},
    {"fusion without any uncertainty", "Cholesky's pivots", ANSWER_UNKNOWN, ask_fusion, NULL, all_of_the_offset,
     .in = {0}, .unit = "m"},
    {"fusion with a covariance of NaN", "Cholesky's pivots", ANSWER_UNKNOWN, ask_fusion, NULL, all_of_the_offset,
     .in = {NAN}, .unit = "m"},
    {"focal length from a plane parallel to the image", "curvature is the information", ANSWER_UNKNOWN, ask_focal, NULL,
     focal_at_given_distance, .in = {COPLANAR, 1.1}},
};
const struct stability_stage stability_camera = {"camera's pose", cases, COUNT_OF(cases)};
