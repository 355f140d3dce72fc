// Projection, distortion and rolling shutter (base/lens.h, locate/rolling_shutter.h).
#include "base/lens.h"
#include "locate/rolling_shutter.h"
#include "reenact/observation/depth_frame.h"
#include "tests/stability/stability.h"

// 640 x 480, principal point in the middle of an even-sided square, so that x and y have the same lens: f, c, k1, k2.
static struct lens lens_of(double f, double c, double k1, double k2)
{
    return (struct lens){.width = 640, .height = 480, .fx = f, .fy = f, .cx = c, .cy = c, .k1 = k1, .k2 = k2};
}

// in: as plain_project.
static struct answer ask_pixel_of(const double *in)
{
    const struct lens lens = lens_of(in[3], in[4], in[5], in[6]);
    const int pixel = depth_pixel_at(&lens, v3(in[0], in[1], in[2]));
    return pixel < 0 ? answer_of(ANSWER_UNKNOWN) : answer_values((double[]){pixel % 640, floor(pixel / 640)}, 2);
}

static struct answer ask_ray(const double *in)
{
    const struct lens lens = lens_of(in[2], in[3], in[4], in[5]);
    const struct vec3 ray = lens_ray(&lens, (struct pixel){in[0], in[1]});
    return answer_values((double[]){ray.x, ray.y}, 2);
}

// Whether a point far beside the image is projected into it: 0, it is not.
static struct answer ask_clamped(const double *in)
{
    const struct lens lens = lens_of(in[3], in[4], in[5], in[6]);
    const struct pixel px = lens_project_clamped(&lens, lens_max_radius2(&lens), v3(in[0], in[1], in[2]));
    return answer_value(px.x >= 0 && px.x < 640 && px.y >= 0 && px.y < 480);
}

static struct answer folded(const double *in)
{
    const struct lens lens = lens_of(in[3], in[4], in[5], in[6]);
    const struct pixel px = lens_project(&lens, v3(in[0], in[1], in[2]));
    return answer_value(px.x >= 0 && px.x < 640 && px.y >= 0 && px.y < 480);
}

// in: width, fx, cx, k1, readout_s, focal_sigma.
static struct lens described(const double *in)
{
    struct lens lens = lens_of(in[1], in[2], in[3], 0);
    lens.width = (int)in[0];
    lens.fy = 525;
    lens.cy = 240;
    lens.readout_s = in[4];
    lens.focal_sigma = in[5];
    return lens;
}

static struct answer ask_check(const double *in)
{
    const struct lens lens = described(in);
    return answer_status(lens_check(&lens, "color"), 0);
}

// The lens as it is: where the image's first pixel looks, how uncertain that is, and when it is read.
static struct answer taken_at_its_word(const double *in)
{
    const struct lens lens = described(in);
    const struct vec3 ray = lens_ray(&lens, (struct pixel){0, 0});
    return answer_values((double[]){ray.x, ray.x * lens.focal_sigma, shutter_row_time(&lens, 0)}, 3);
}

static struct answer ask_row_time(const double *in)
{
    const struct lens lens = {.width = 640, .height = (int)in[1], .readout_s = in[0]};
    return answer_value(shutter_row_time(&lens, in[2]));
}

// in: every velocity, every variance -> the velocity's prior; a hand-held camera's has the mean 0 and information 1.
static struct answer ask_motion_prior(const double *in)
{
    double velocity[6], covariance[36] = {0};
    for (int i = 0; i < 6; i++) {
        velocity[i] = in[0];
        covariance[7 * i] = in[1];
    }
    const struct shutter_motion m = shutter_motion_prior(velocity, covariance);
    return answer_values((double[]){m.velocity[0], m.information[0]}, 2);
}

static struct answer prior_as_given(const double *in) { return answer_values((double[]){in[0], 1 / in[1]}, 2); }

// A point that comes behind the camera while its row is read.
static struct answer ask_shutter(const double *in)
{
    struct lens lens = lens_of(525, 319.5, 0, 0);
    struct shutter_motion m = shutter_motion_unknown();
    lens.readout_s = 0.2;
    m.velocity[5] = in[3];
    const struct pixel px = shutter_project(&lens, &m, v3(in[0], in[1], in[2]));
    return answer_values((double[]){px.x, px.y}, 2);
}

static struct answer shutter_behind(const double *in)
{
    struct lens lens = lens_of(525, 319.5, 0, 0);
    struct shutter_motion m = shutter_motion_unknown();
    lens.readout_s = 0.2;
    m.velocity[5] = in[3];
    const struct vec3 p = v3(in[0], in[1], in[2]);
    const double row = lens_project(&lens, p).y;
    const struct pixel px = lens_project(&lens, shutter_apply_motion(&m, shutter_row_time(&lens, row), p));
    return answer_values((double[]){px.x, px.y}, 2);
}

#define REFUSED(what, ...)                                                                                             \
    {                                                                                                                  \
        what, "lens_check", ANSWER_ERROR, ask_check, NULL, taken_at_its_word, .in = { __VA_ARGS__ }                    \
    }

static const struct stability_case cases[] = {
    {"pixel of a point behind the camera", "nothing nearer than 5 cm", ANSWER_UNKNOWN, ask_pixel_of, &plain_project,
     .in = {0.1, 0.1, -2, 525, 319.5, 0, 0}, .unit = "px"},
    {"pixel of the camera's own centre", "nothing nearer than 5 cm", ANSWER_UNKNOWN, ask_pixel_of, &plain_project,
     .in = {0, 0, 0, 525, 319.5, 0, 0}, .unit = "px"},
    {"pixel of a point in the image plane", "nothing nearer than 5 cm", ANSWER_UNKNOWN, ask_pixel_of, &plain_project,
     .in = {1, 0, 5e-324, 525, 319.5, 0, 0}, .unit = "px"},
    {"pixel of a point that is NaN", "comparisons that NaN fails", ANSWER_UNKNOWN, ask_pixel_of, &plain_project,
     .in = {0, 0, NAN, 525, 319.5, 0, 0}, .unit = "px"},
    {"pixel of an infinite point", "comparisons that NaN fails", ANSWER_UNKNOWN, ask_pixel_of, &plain_project,
     .in = {INFINITY, 0, INFINITY, 525, 319.5, 0, 0}, .unit = "px"},
    {"ray of a barrel lens's corner", "Newton to 1e-10", ANSWER_VALUE, ask_ray, &plain_undistort,
     .in = {0, 0, 525, 319.5, -0.28, 0.07}, .tolerance = 1e-10},
    {"ray of a pincushion lens's corner", "Newton to 1e-10", ANSWER_VALUE, ask_ray, &plain_undistort,
     .in = {639, 479, 525, 319.5, 0.3, -0.05}, .tolerance = 1e-10},
    {"a point 80 degrees aside of a barrel lens", "distortion held beyond the image", ANSWER_VALUE, ask_clamped, NULL,
     folded, .in = {2.6, 0.2, 1, 525, 319.5, -0.15, 0}, .exact = {0}, .exact_count = 1},
    REFUSED("lens with a focal length of NaN", 640, NAN, 319.5),
    REFUSED("lens with an infinite focal length", 640, INFINITY, 319.5),
    REFUSED("lens with a focal length of 0", 640, 0, 319.5),
    REFUSED("lens with a focal length below 0", 640, -525, 319.5),
    REFUSED("lens with a denormal focal length", 640, 5e-320, 319.5),
    REFUSED("lens with a focal length of 1e300 px", 640, 1e300, 319.5),
    REFUSED("lens with its principal point at 1e300 px", 640, 525, 1e300),
    REFUSED("lens with its principal point at NaN", 640, 525, NAN),
    REFUSED("lens whose distortion folds the image's corner", 640, 525, 319.5, -0.9),
    REFUSED("lens with an infinite distortion", 640, 525, 319.5, INFINITY),
    REFUSED("lens 0 pixels wide", 0, 525, 319.5),
    REFUSED("lens with a readout of NaN", 640, 525, 319.5, 0, NAN),
    REFUSED("lens whose focal length is infinitely unsure", 640, 525, 319.5, 0, 0, INFINITY),
    {"when the only row of an image is read", "one row has no time", ANSWER_VALUE, ask_row_time, &plain_row_time,
     .in = {0.03, 1, 0}, .exact = {0}, .exact_count = 1, .unit = "s"},
    {"prior of a velocity that is NaN", "a hand-held camera's", ANSWER_VALUE, ask_motion_prior, NULL, prior_as_given,
     .in = {NAN, 1e-4}, .exact = {0, 1}, .exact_count = 2},
    {"prior of a velocity of 1e6 m/s", "a hand-held camera's", ANSWER_VALUE, ask_motion_prior, NULL, prior_as_given,
     .in = {1e6, 1e-4}, .exact = {0, 1}, .exact_count = 2},
    {"prior of a velocity without variance", "a hand-held camera's", ANSWER_VALUE, ask_motion_prior, NULL,
     prior_as_given, .in = {0.1, 0}, .exact = {0, 1}, .exact_count = 2},
    {"a point that passes the camera while its row is read", "last row before it", ANSWER_VALUE, ask_shutter, NULL,
     shutter_behind, .in = {0.05, 0.1, 0.3, 9}, .exact = {407, 494.5}, .exact_count = 2, .tolerance = 1e-9,
     .unit = "px"},
};
const struct stability_stage stability_lens = {"lens and shutter", cases, COUNT_OF(cases)};
