// Small pieces of a picture, found again in the next one to a few hundredths of a
// pixel by their brightness alone (Lucas and Kanade 1981, as Baker and Matthews, IJCV
// 2004, turn it round: everything that depends on the piece is computed once), from
// coarse to fine copies of the picture. Dimmer or brighter is the same piece.
#pragma once
#include "base/lens.h"

// As wide as the vectors that processors add up at once.
enum { PATCH_ACROSS = 8, PATCH_DOWN = 9, PATCH_PIXELS = PATCH_ACROSS * PATCH_DOWN, PATCH_LEVELS = 3 };

// A grey picture and copies of it, each half as large as the last.
struct patch_picture {
    int width[PATCH_LEVELS], height[PATCH_LEVELS];
    uint8_t *level[PATCH_LEVELS]; // malloc'ed
};

MUST_CHECK enum status patch_picture_open(struct patch_picture *p, int width, int height); // ERR_MEMORY: *p is zeroed
void patch_picture_close(struct patch_picture *p);                                         // zeroed is fine
void patch_picture_fill(struct patch_picture *p, const uint8_t *gray);

// One level of a patch: brightness less its mean, its slopes, and the inverse of their
// 2 x 2 matrix; spread 0: there is nothing to hold on to at this level.
struct patch_level {
    float value[PATCH_PIXELS], by_x[PATCH_PIXELS], by_y[PATCH_PIXELS];
    float inverse[3], spread;
};

struct patch {
    struct patch_level level[PATCH_LEVELS];
};

// False, *out not to be used: at the picture's edge, or too even to be found again.
bool patch_cut(const struct patch_picture *p, struct pixel at, struct patch *out);

// Looks for the patch near *at: within about ten pixels; near: within one or two, in a third of the
// time. False, *at untouched: not there.
bool patch_follow(const struct patch_picture *p, const struct patch *patch, bool near, struct pixel *at);
