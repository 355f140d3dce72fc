// One exposure for all pictures of a view: a gain for each channel of each picture, from what two pictures both see.
// Between two pictures the median of the ratios of a few hundred points decides, so that things that moved, highlights
// and wrong depth do not; over all pictures least squares with a weak pull to 1, so that what is seen by one picture
// alone, or was taken with one exposure, keeps its colours. Pure but for memory; one caller at a time.
#pragma once
#include "surround/picture/surround_picture.h"

struct exposure_pair {
    int a, b;
    bool measured;         // else too little is seen by both
    double log_ratio[3];   // of a's gain over b's
    double information[3]; // 1 / variance
};

struct exposure {
    struct exposure_pair *pairs; // each two once
    int pair_count, pair_capacity;
    double (*log_gain)[3]; // of each picture
    int picture_count, picture_capacity;
};

void exposure_free(struct exposure *exposure); // a zeroed one is fine

// Sets the gains of all pictures of `all` that have been met; `some` of them, which have depth and are sorted by
// nearness, may be new: each is compared with the nearest four others, once. ERR_MEMORY.
MUST_CHECK enum status exposure_even(struct exposure *exposure, struct surround_picture *all,
                                     const struct surround_picture *const *some, int count);

// Scales the gains of all pictures alike so that a view has the exposure with which the pictures nearest to it were
// taken: a camera that adapts to the light has one beside the window and another in the corner, and what was saturated
// is not drawn grey. ranked: by surround_view_rank; the first `near` of them, which exposure_even has met, count, with
// weights that fade out at the distance of the next.
void exposure_suit_view(const struct exposure *exposure, struct surround_picture *all,
                        const struct surround_picture *const *ranked, int count, int near, struct pose world_from_view);
