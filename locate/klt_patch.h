// Small pieces of a picture, found again in the next one to a few hundredths of a
// pixel by their brightness alone (Lucas and Kanade 1981, as Baker and Matthews, IJCV
// 2004, turn it round: everything that depends on the piece is computed once), from
// coarse to fine copies of the picture. Dimmer or brighter is the same piece.
#pragma once
#include "base/lens.h"

// As wide as the vectors that processors add up at once.
enum { KLT_WIDTH = 8, KLT_HEIGHT = 9, KLT_PIXELS = KLT_WIDTH * KLT_HEIGHT, KLT_LEVELS = 3 };

// A grey picture and copies of it, each half as large as the last.
struct klt_pyramid {
    int width[KLT_LEVELS], height[KLT_LEVELS];
    uint8_t *level[KLT_LEVELS]; // malloc'ed
};

MUST_CHECK enum status klt_pyramid_open(struct klt_pyramid *p, int width, int height); // ERR_MEMORY: *p is zeroed
void klt_pyramid_close(struct klt_pyramid *p);                                         // zeroed is fine
void klt_pyramid_build(struct klt_pyramid *p, const uint8_t *gray);

// One level of a patch: brightness less its mean, its slopes, and the inverse of their
// 2 x 2 matrix; sigma 0: there is nothing to hold on to at this level.
struct klt_level {
    float value[KLT_PIXELS], grad_x[KLT_PIXELS], grad_y[KLT_PIXELS];
    float inverse[3], sigma;
};

struct klt_patch {
    struct klt_level level[KLT_LEVELS];
};

// False, *out not to be used: at the picture's edge, or too even to be found again.
bool klt_patch_extract(const struct klt_pyramid *p, struct pixel at, struct klt_patch *out);

// Looks for the patch near *at: within about ten pixels; near_guess: within one or two, in a third of the
// time. False, *at untouched: not there.
bool klt_patch_track(const struct klt_pyramid *p, const struct klt_patch *patch, bool near_guess, struct pixel *at);
