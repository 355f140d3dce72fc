// A thing's reference picture prepared for recognition: which pixels show it, its size in metres, its texture at all
// scales, its features. Made once, then only read. Memory: about 60 bytes a pixel and 0.3 KB a feature.
#pragma once
#include "base/status.h"
#include "objects/thing.h"
#include "platform/vision/image_features.h"

// ---------------------------------------------------------------- texture pyramid

// Colour images at falling sizes, as floats. Pure but for memory; any thread may call.

struct texture_level {
    int width, height;
    float *rgb; // 0..255
};

// Levels of a pyramid: each half the size of the one before, means of 2 x 2. level[0].rgb is there; the caller frees
// all. ERR_MEMORY: those that could be made are there.
MUST_CHECK enum status texture_pyramid(struct texture_level *level, int levels);

// ---------------------------------------------------------------- thing model

enum { MODEL_LEVELS = 6, MODEL_CHANNELS = 2, MODEL_MAX_FEATURES = 700, SAMPLES_MAX = 900 };

struct thing_model {
    int width, height; // of the reference picture
    uint8_t *inside;   // width * height: 1 shows the thing
    float *half_px;    // half the silhouette's width, per row
    // Both shapes: where the origin is in the picture, and how large a pixel is there, where the thing is nearest.
    struct model_scale {
        double x, y, metres_per_px;
        double size_sigma;     // relative: how well the picture tells where the thing ends
        double middle_sigma_m; // how well it tells where its middle is
    } scale[THING_SHAPES];
    // Of the solid of revolution: its largest radius, and from how far away its picture was taken (in perspective).
    double radius_m, distance_m;
    struct texture_level level[MODEL_LEVELS];       // each half the size of the one before
    struct scale_feature *features[MODEL_CHANNELS]; // of the red and the blue channel
    int feature_count[MODEL_CHANNELS];
};

// Its picture's margin, where that has one even colour, does not belong to the thing. ERR_MEMORY, ERR_SOLVER;
// ERR_INPUT: the picture shows nothing. On error *out is all 0.
MUST_CHECK enum status thing_model_make(const struct thing *thing, struct thing_model *out);
void thing_model_free(struct thing_model *model);

// Points of the thing's surface with their colours, as an image shows them in which one metre at the thing is
// `px_per_metre` pixels: about one point a pixel, at most SAMPLES_MAX, fewer where that would be more.
struct thing_samples {
    int count;
    float color[SAMPLES_MAX][3];
    struct vec3 at[THING_SHAPES][SAMPLES_MAX];     // thing's axes
    struct vec3 normal[THING_SHAPES][SAMPLES_MAX]; // of the surface, outwards, of length 1
    float facing[THING_SHAPES][SAMPLES_MAX];       // cosine of the angle at which the reference picture shows it
};
void thing_sample(const struct thing_model *model, double px_per_metre, int max, struct thing_samples *out);

// The red (0) or blue (1) channel of an image.
void model_channel(const uint8_t *rgb, size_t pixels, int channel, uint8_t *plane);
