// KLT: small patches of an image, found in the next one to a few hundredths of a pixel (Lucas & Kanade 1981; inverse
// compositional, Baker & Matthews, IJCV 2004: everything that depends on the patch is computed once), from coarse to
// fine levels of an image pyramid. Translation only; invariant to gain and offset of the brightness.
// Deterministic; a pyramid belongs to one thread.
#pragma once
#include "base/lens.h"

// The width is that of a vector register.
enum { KLT_WIDTH = 8, KLT_HEIGHT = 9, KLT_PIXELS = KLT_WIDTH * KLT_HEIGHT, KLT_LEVELS = 3 };

// A grey image and copies of it, each half as large as the last.
struct klt_pyramid {
    int width[KLT_LEVELS], height[KLT_LEVELS];
    uint8_t *level[KLT_LEVELS]; // malloc'ed
};

MUST_CHECK enum status klt_pyramid_open(struct klt_pyramid *pyramid, int width,
                                        int height); // ERR_MEMORY: *pyramid is zeroed
void klt_pyramid_close(struct klt_pyramid *pyramid); // zeroed is fine
void klt_pyramid_build(struct klt_pyramid *pyramid, const uint8_t *gray);

// One level of a patch: brightness less its mean, its gradient, and the inverse of the 2 x 2 gradient matrix (xx, xy,
// yy); sigma: standard deviation of the brightness, 0: too little texture at this level.
struct klt_level {
    float value[KLT_PIXELS], grad_x[KLT_PIXELS], grad_y[KLT_PIXELS];
    float inverse[3], sigma;
};

struct klt_patch {
    struct klt_level level[KLT_LEVELS];
};

// False, *out not to be used: at the image's edge, or too little texture to be found again.
bool klt_patch_extract(const struct klt_pyramid *pyramid, struct pixel at, struct klt_patch *out);

// Looks for the patch near *at: within about ten pixels; near_guess: within one or two, in a third of the time.
// False, *at untouched: not found.
bool klt_patch_track(const struct klt_pyramid *pyramid, const struct klt_patch *patch, bool near_guess,
                     struct pixel *at);
