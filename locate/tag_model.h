// Image model of a tag: predicts the linear light of a pixel that sees a tag with sharp edges between black and white
// cells, through the pixel's square and a Gaussian blur, and its derivatives by all parameters. Coordinates (u, v) are
// the tag's own: -1 .. 1 over the black square, v up; its white rim is one cell wide. Pure.
#pragma once
#include "base/depth_noise.h"
#include "base/lens.h"
#include "locate/tag_corners.h"
#include "platform/vision/tag_detector.h"

enum {
    TAG_RIM = TAG_CELLS + 2, // cells along a side with the white rim
    TAG_HOMOGRAPHY_DOF = 8,
    // What is estimated: d of h (I + d) row by row without its last element, blur, white, black, and the gradient of
    // white in u and v.
    TAG_PARAMETERS = 13,
    GAUSSIAN_STEPS = 1024, // of the table of the normal distribution, over +- GAUSSIAN_REACH
};
#define GAUSSIAN_REACH 4.0
#define TAG_CELL       (2.0 / TAG_CELLS) // a cell's side in (u, v)

// The standard normal distribution at one place.
struct gaussian_value {
    double integral; // of `below`, from minus infinity
    double below;    // the distribution function
    double density;
};

// What the model needs of the camera.
struct tag_sensor {
    double pixel_x, pixel_y; // a pixel's sides on the plane z = 1
    struct gaussian_value gaussian[GAUSSIAN_STEPS + 1];
};
void tag_sensor_init(struct tag_sensor *sensor, const struct lens *lens);

struct pixel_sample {
    double x, y;  // on the plane z = 1
    double value; // linear light, 0 .. 1
};

struct tag_model {
    double h[9];                                    // (u, v) to the plane z = 1
    double blur_px, white, black, white_u, white_v; // linear light
    double cells[TAG_RIM][TAG_RIM];                 // 1: white; row 0 at the bottom
};

// *value and its derivatives at one pixel. inverse: of model->h. False: outside the tag's white rim.
bool tag_model_predict(const struct tag_sensor *sensor, const struct tag_model *model, const double inverse[9],
                       const struct pixel_sample *sample, double *value, double by[TAG_PARAMETERS]);

// ---------------------------------------------------------------- tag depth

// Depth samples inside a tag, and the noise of a depth sensor. Pure.

enum { TAG_DEPTH_SAMPLES = 36 };

// A depth sample inside a tag: its ray and its depth along z, metres.
struct depth_sample {
    double x, y, z; // the point is z * (x, y, 1), camera axes
};

struct tag_depth {
    int32_t count;
    double share; // weight of a sample against an independent one: far away, a whole tag falls on two or three of the
                  // sensor's quantisation steps
    struct depth_sample sample[TAG_DEPTH_SAMPLES];
};

// Samples up to TAG_DEPTH_SAMPLES pixels evenly spread inside the tag; pixels without depth and outliers of the tag's
// plane are left out. depth: millimetres, of the same pixels as `lens`. out->count is 0 where fewer than 6 are left.
void tag_read_depth(const struct tag_observation *seen, const struct lens *lens, const uint16_t *depth,
                    struct tag_depth *out);

// ---------------------------------------------------------------- mirrored tags

// Whether a picture shows tags in a mirror: none is found in it, since no tag's mirror image is another tag, and they
// are found in the picture turned over. What has no tag may be mirrored without anything to tell it.

struct mirrored_tags;

// For pictures of that size. ids: of the tags that count, copied; NULL: all tags do. ERR_MEMORY.
MUST_CHECK enum status mirrored_tags_open(struct mirrored_tags **out, const struct lens *lens, const int32_t *ids,
                                          int count);
void mirrored_tags_close(struct mirrored_tags **tags); // NULL is fine; sets *tags = NULL

// *shown: how many of the tags the picture shows in a mirror. 15 ms at 640 x 480. ERR_MEMORY.
MUST_CHECK enum status mirrored_tags_look(struct mirrored_tags *tags, const uint8_t *gray, int *shown);

// The same of the picture as it is.
MUST_CHECK enum status mirrored_tags_look_straight(struct mirrored_tags *tags, const uint8_t *gray, int *shown);
