// The pose of a thing from the pixels themselves: its texture, drawn where the pose has it, must look like all views at
// once. Levenberg-Marquardt (base/least_squares.h) over turn, shift and the logarithm of its size, with a gain and an
// offset for each view and channel and Huber weights (Lucas & Kanade 1981; Baker & Matthews 2004, forward additive).
// Pure.
#pragma once
#include "objects/thing_model.h"

// ---------------------------------------------------------------- thing view

// One camera's image prepared for recognition: its pyramid and its features. Made once for an image, then only read.

enum { VIEW_LEVELS = 5, VIEW_MAX_FEATURES = 2500, VIEWS_MAX = 2 };

struct thing_view {
    struct lens lens;
    double largest_r2; // lens_max_radius2
    struct pose camera_from_left;
    struct texture_level level[VIEW_LEVELS]; // as in thing_model
    struct scale_feature *features[MODEL_CHANNELS];
    int feature_count[MODEL_CHANNELS];
};

// rgb: of the lens's size. features: false where they are not needed. ERR_MEMORY, ERR_SOLVER. On error *out is all 0.
MUST_CHECK enum status thing_view_make(const struct lens *lens, const struct pose *camera_from_left, const uint8_t *rgb,
                                       bool features, struct thing_view *out);
void thing_view_free(struct thing_view *view);

// ---------------------------------------------------------------- thing align

enum { ALIGN_UNKNOWNS = 7 }; // turn (radians), shift (metres), both in the left camera's axes; log of size

struct alignment {
    struct pose left_from_thing;
    double log_scale;
    double score[VIEWS_MAX];   // correlation with each view, at most 1; -1: too little of it is in the view
    double visible[VIEWS_MAX]; // share of the points that are in the view
    double tint[VIEWS_MAX]; // of its light against the picture's: largest over smallest channel's share of brightness
    double noise;           // of the residuals, grey levels
    double
        information[ALIGN_UNKNOWNS * ALIGN_UNKNOWNS]; // with the size's prior, for independent residuals of that noise
};

struct size_prior {
    double log_scale, sigma;
};

struct align_input {
    const struct thing_samples *samples;
    enum thing_shape shape;
    const struct thing_view *views;
    int view_count, level; // of the views' pyramids
    struct size_prior size;
    double variance_factor; // by which neighbouring residuals count less than if they were independent
};

// Improves *alignment in at most `steps` steps and fills the rest of it. False: it is not in sight of the views.
bool thing_align(const struct align_input *in, int steps, struct alignment *alignment);

// Score in one view only, as the pose stands; visible and tint of that view are written into *alignment.
double thing_score(const struct align_input *in, int view, struct alignment *alignment);
