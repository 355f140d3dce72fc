// One camera's image prepared for recognition: its pyramid and its features. Made once for an image, then only read.
#pragma once
#include "objects/thing_model.h"

enum { VIEW_LEVELS = 5, VIEW_MOST_FEATURES = 2500, VIEWS_MOST = 2 };

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
void thing_view_free(struct thing_view *v);
