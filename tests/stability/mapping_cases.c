// The map of a place: bundle adjustment, triangulation, gravity, the locator of an empty place.
#include "base/linear_algebra.h"
#include "capture/mapping/mapper.h"
#include "capture/sensor_pose.h"
#include "locate/locator.h"
#include "platform/vision/bundle_adjustment.h"
#include "tests/stability/stability.h"

#include <stdlib.h>
#include <string.h>

// One point, two cameras `base` apart that see it straight ahead of the first at depth z -> the depth found, from a
// start half as far. Both cameras are held.
static struct answer ask_depth(const double *in)
{
    const double base = in[0], z = in[1];
    struct ba_camera cameras[2] = {{POSE_IDENTITY}, {{{0, 0, 0, 1}, {-base, 0, 0}}}};
    struct vec3 point = v3(0, 0, 0.5 * z);
    struct ba_observation seen[2] = {{.camera = 0, .point = 0, .covariance = {0.25, 0, 0.25}},
                                     {.camera = 1, .point = 0, .x = -base / z, .covariance = {0.25, 0, 0.25}}};
    double cost;
    const struct ba_problem problem = {.fx = 525,
                                       .fy = 525,
                                       .cameras = cameras,
                                       .points = &point,
                                       .observations = seen,
                                       .camera_count = 2,
                                       .point_count = 1,
                                       .observation_count = 2,
                                       .held_camera = -1,
                                       .hold_cameras = true,
                                       .max_iterations = 100,
                                       .cost = &cost};
    const enum status status = bundle_adjust(&problem);
    return answer_status(status, point.z);
}

// A camera that sees one tag, with corners of NaN, or with no weight -> whether it is refused or left as it was.
static struct answer ask_square(const double *in)
{
    struct ba_camera camera = {{{1, 0, 0, 0}, {0, 0, 1}}};
    struct ba_square square = {.world_from_square = POSE_IDENTITY, .side_m = 0.16, .held = true};
    struct ba_corners seen = {0};
    double cost;
    for (int i = 0; i < 8; i++) {
        seen.observed[i] = (i % 2 ? i < 4 : i == 2 || i == 4) ? 42 : -42;
        seen.whiten[i][i] = in[1];
    }
    seen.observed[3] += in[0];
    const struct ba_problem problem = {.fx = 525,
                                       .fy = 525,
                                       .cameras = &camera,
                                       .squares = &square,
                                       .corners = &seen,
                                       .camera_count = 1,
                                       .square_count = 1,
                                       .corner_count = 1,
                                       .held_camera = -1,
                                       .max_iterations = 30,
                                       .cost = &cost};
    const enum status status = bundle_adjust(&problem);
    return status == OK ? answer_value(camera.camera_from_world.translation.z) : answer_status(status, 0);
}

static struct answer mean_of_corners(const double *in) { return answer_value((in[0] + 42) * 525 / 42); }

// in: depth in mm everywhere, or with in[1] a step of mm from row to row.
static struct answer ask_floor(const double *in)
{
    enum { WIDTH = 160, HEIGHT = 120 };
    static uint16_t depth[WIDTH * HEIGHT];
    const struct lens lens = {.width = WIDTH, .height = HEIGHT, .fx = 131, .fy = 131, .cx = 79.5, .cy = 59.5};
    struct floor_plane floor;
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        depth[i] = (uint16_t)in[0];
    if (!floor_plane_find(&lens, depth, &floor))
        return answer_of(ANSWER_UNKNOWN);
    return answer_value(floor.height_m);
}

// The plane through three pixels of it.
static struct answer through_three_pixels(const double *in)
{
    const double z = in[0] * 1e-3;
    const struct vec3 n = v3_unit(v3_cross(v3(z, 0, 0), v3(0, z, 0)));
    return answer_value(fabs(n.z * z));
}

// in: tags, landmarks, side.
static struct answer ask_locator(const double *in)
{
    struct place_tag tags[2] = {{.id = 3, .side_m = in[2], .world_from_tag = POSE_IDENTITY},
                                {.id = 3, .side_m = in[2], .world_from_tag = POSE_IDENTITY}};
    struct place place = {.tags = tags, .tag_count = (int32_t)in[0]};
    const struct lens lens = {.width = 64, .height = 48, .fx = in[1], .fy = in[1], .cx = 31.5, .cy = 23.5};
    struct locator *locator;
    const enum status status = locator_open(&locator, &place, &lens, NULL);
    locator_close(&locator);
    return answer_status(status, 0);
}

static struct answer opened(const double *in)
{
    (void)in;
    return answer_value(0);
}

// in: side, number of tags; no depth.
static struct answer ask_mapper(const double *in)
{
    const struct calibration calibration = {
        .color = {.width = 64, .height = 48, .fx = 50, .fy = 50, .cx = 31.5, .cy = 23.5},
        .registered = true,
        .color_from_depth = POSE_IDENTITY};
    const struct mapper_tag tags[2] = {{7, in[0]}, {7, in[0]}};
    struct mapper *mapper;
    const enum status status = mapper_open(&mapper, &calibration, tags, (int32_t)in[1], NULL);
    mapper_close(&mapper);
    return answer_status(status, 0);
}

// in: variances of two unknowns and their correlation -> the variance of the first, the second unknown.
static struct answer ask_marginal(const double *in)
{
    const double a[4] = {in[0], in[2], in[2], in[1]};
    double out;
    return marginal_information(a, 1, false, &out) ? answer_value(out) : answer_of(ANSWER_UNKNOWN);
}

static struct answer schur_as_it_comes(const double *in) { return answer_value(in[0] - in[2] * in[2] / in[1]); }

// in: as plain_solve2. The line's two unknowns, by Cholesky after the mean is taken off.
static struct answer ask_inverse(const double *in)
{
    double a[4] = {in[0], in[1], in[1], in[2]}, inverse[4];
    return invert_symmetric(a, 2, inverse) ? answer_value(inverse[0]) : answer_of(ANSWER_UNKNOWN);
}

static struct answer inverse_by_determinant(const double *in)
{
    return answer_value(in[2] / (in[0] * in[2] - in[1] * in[1]));
}

static const struct stability_case cases[] = {
    {"depth of a point from a base line of 1 mm at 5 m", "until the cost is least", ANSWER_VALUE, ask_depth,
     &plain_triangulate, .in = {0.001, 5}, .tolerance = 0.05, .unit = "m", .guard_is_double = true, .foreign = true},
    {"depth of a point from a base line of 1 m at 2 m", "until the cost is least", ANSWER_VALUE, ask_depth,
     &plain_triangulate, .in = {1, 2}, .tolerance = 1e-9, .unit = "m", .guard_is_double = true, .foreign = true},
    {"bundle adjustment with a corner that is NaN", "residuals are checked", ANSWER_ERROR, ask_square, NULL,
     mean_of_corners, .in = {NAN, 2}, .unit = "m", .foreign = true},
    {"bundle adjustment with an infinite corner", "residuals are checked", ANSWER_ERROR, ask_square, NULL,
     mean_of_corners, .in = {INFINITY, 2}, .unit = "m", .foreign = true},
    {"floor in an image without depth", "enough points of a plane", ANSWER_UNKNOWN, ask_floor, NULL,
     through_three_pixels, .in = {0}, .unit = "m"},
    {"floor in an image of one wall, 2 m away", "a floor is level", ANSWER_UNKNOWN, ask_floor, NULL,
     through_three_pixels, .in = {2000}, .unit = "m"},
    {"floor in an image of the largest depth", "a floor is level", ANSWER_UNKNOWN, ask_floor, NULL,
     through_three_pixels, .in = {65535}, .unit = "m"},
    {"locating in a place without tags or landmarks", "refused when opened", ANSWER_ERROR, ask_locator, NULL, opened,
     .in = {0, 50, 0.16}},
    {"locating in a place with one tag twice", "refused when opened", ANSWER_ERROR, ask_locator, NULL, opened,
     .in = {2, 50, 0.16}},
    {"locating with a lens of focal length NaN", "refused when opened", ANSWER_ERROR, ask_locator, NULL, opened,
     .in = {1, NAN, 0.16}},
    {"locating by a tag with a side of NaN", "refused when opened", ANSWER_ERROR, ask_locator, NULL, opened,
     .in = {1, 50, NAN}},
    {"locating by a tag with a side of 0", "refused when opened", ANSWER_ERROR, ask_locator, NULL, opened,
     .in = {1, 50, 0}},
    {"mapping without tags or depth", "refused when opened", ANSWER_ERROR, ask_mapper, NULL, opened, .in = {0.16, 0}},
    {"mapping with one tag twice", "refused when opened", ANSWER_ERROR, ask_mapper, NULL, opened, .in = {0.16, 2}},
    {"mapping with a tag of side NaN", "refused when opened", ANSWER_ERROR, ask_mapper, NULL, opened, .in = {NAN, 1}},
    {"mapping with a tag of side 0", "refused when opened", ANSWER_ERROR, ask_mapper, NULL, opened, .in = {0, 1}},
    {"what is known with the rest unknown, of nothing", "Cholesky's pivots", ANSWER_UNKNOWN, ask_marginal, NULL,
     schur_as_it_comes, .in = {1, 0, 0}},
    {"variance from a singular information matrix", "Cholesky's pivots", ANSWER_UNKNOWN, ask_inverse, NULL,
     inverse_by_determinant, .in = {1, 1, 1}},
    {"variance from an indefinite information matrix", "Cholesky's pivots", ANSWER_UNKNOWN, ask_inverse, NULL,
     inverse_by_determinant, .in = {1, 2, 1}},
    {"variance from an information matrix of NaN", "Cholesky's pivots", ANSWER_UNKNOWN, ask_inverse, NULL,
     inverse_by_determinant, .in = {1, NAN, 1}},
};
const struct stability_stage stability_mapping = {"map of a place", cases, COUNT_OF(cases)};
