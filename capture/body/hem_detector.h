// Detects the hem of a skirt or a coat that hides the legs: the level below which much less of the person is visible
// than above. Trousers get narrower gradually, and hanging hands move. A heuristic of its own, with
// thresholds chosen by hand. Pure.
#pragma once
#include "capture/body/body_fit.h"

struct hem {
    double level_m; // over the floor
    double wide_m;  // visible width of the person just above, gaps not counted
    double narrow;  // 0 to 1: the share of that width which is missing below
};

// The sharpest narrowing between the ankles and the middle of the thighs of a person of that height. Uses task's
// evidence, floor and up. Of a person cropped below, only the visible part counts. False: the person is cropped at the
// image's sides, too little is visible, or the floor is unknown; *out is then all 0.
bool hem_detect(const struct fit_task *task, double height_m, struct hem *out);

// The estimate from several frames.
struct hem_estimate {
    int count;                      // of frames, at most 60
    double below_m, wide_m, narrow; // running means; below_m: from the waist joint down to the hem
};
void hem_update(struct hem_estimate *estimate, const struct hem *hem, double waist_level_m);
// True if one frame, or the mean of several, shows a person of that height in a skirt or a coat. `wears`: the decision
// so far; to keep it takes less (hysteresis).
bool hem_is_worn(double narrow, double wide_m, double height_m, bool wears);
