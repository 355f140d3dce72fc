// Where a skirt or a coat ends: at its hem, of what is seen of the person much less is below than above, the legs.
// Trousers grow narrow little by little, and hands that hang move. Pure.
#pragma once
#include "capture/body/body_fit.h"

struct hem {
    double level_m; // over the floor
    double wide_m;  // so much of the person is seen just above, gaps not counted
    double narrow;  // 0 to 1: by this share less is below
};

// The sharpest narrowing between the ankles and the middle of the thighs of somebody of that
// height. task's evidence, floor and up are in use. Of who is cut off below, only what is in sight counts. False: the
// picture's sides cut them off, or too little is in sight.
bool hem_detect(const struct fit_task *task, double height_m, struct hem *out);

// What several pictures say.
struct hem_estimate {
    int count;                      // of the pictures, at most 60
    double below_m, wide_m, narrow; // means; below_m: how far below the waist joint
};
void hem_update(struct hem_estimate *estimate, const struct hem *hem, double waist_level_m);
// One picture, or the mean of several, shows somebody of that height in a skirt or a coat. `wears`: as it was
// believed so far, which needs less.
bool hem_is_worn(double narrow, double wide_m, double height_m, bool wears);
