// The calibration that an Azure Kinect leaves with its recordings, as lenses of base/lens.h.
//
// The sensor describes a lens by a rational radial factor in r^2, (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4
// + k6 r^6), and two tangential terms (the model of OpenCV's CALIB_RATIONAL_MODEL), for its whole chip: 1024 x 1024
// pixels of depth, 4096 x 3072 of colour, of which each mode takes a part (Azure Kinect Sensor SDK,
// mode_specific_calibration.c). Our lenses have a polynomial. One is fitted to the factor by least squares over the
// image, the focal length with it; where it is nowhere further off than AZURE_FIT_PX the images stay as they are.
// Otherwise they are resampled to a pinhole with the same principal point and field of view: azure_remap_*.
#pragma once
#include "base/lens.h"

// Chosen by hand: below what depth's noise makes of a point at the image's rim.
#define AZURE_FIT_PX 1.0

// How the images of one camera become those of its lens.
struct azure_remap {
    int width, height;
    float
        *from; // for each pixel of the lens, x and y in the sensor's image, -1: outside; NULL: images stay as they are
};

struct azure_calibration {
    struct calibration lenses;
    struct azure_remap color, depth;
};

// json: calibration.json as the sensor has it. color, depth: width and height of the images, 0: there are none. `name`
// is for sentences. ERR_INPUT: not such a calibration, or images of a size that no mode has. ERR_MEMORY. On error *out
// holds nothing; else the caller frees it.
MUST_CHECK enum status azure_calibration_parse(const char *json, size_t count, const char *name, const int color[2],
                                               const int depth[2], struct azure_calibration *out);
void azure_calibration_free(struct azure_calibration *calibration); // what is zeroed is fine

// in and out have the remap's size and differ; `from` is not NULL. Colour is interpolated, depth is its nearest sample.
void azure_remap_color(const struct azure_remap *remap, const uint8_t *in, uint8_t *out);
void azure_remap_depth(const struct azure_remap *remap, const uint16_t *in, uint16_t *out);
