// Image model of a tag: predicts the linear light of a pixel that sees a tag with sharp edges between black and white
// cells, through the pixel's square and a Gaussian blur, and its derivatives by all parameters. Coordinates (u, v) are
// the tag's own: -1 .. 1 over the black square, v up; its white rim is one cell wide. Pure.
#pragma once
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

// *value and its derivatives at one pixel. inverse: of m->h. False: outside the tag's white rim.
bool tag_model_predict(const struct tag_sensor *sensor, const struct tag_model *m, const double inverse[9],
                       const struct pixel_sample *s, double *value, double by[TAG_PARAMETERS]);
