#include "base/level_of_detail.h"

#include <math.h>

const char *const detail_names[DETAIL_COUNT] = {[DETAIL_PAPER] = "paper",
                                                [DETAIL_PARTS] = "parts",
                                                [DETAIL_FUSED] = "fused",
                                                [DETAIL_FULL] = "full",
                                                [DETAIL_AUTO] = "auto"};

bool detail_needs_avatar(enum detail detail) { return detail >= DETAIL_FUSED; }

// ---------------------------------------------------------------- costs

// Costs that differ by less than this share are the same: clocks of busy machines are no finer. Chosen by hand.
static const double SAME_COST = 0.02;

// Between the sizes linear in the actor's area, beyond them as at the nearer one.
static double cost_at(const struct detail_costs *costs, const double ms[2], double px_per_m)
{
    const double near = costs->px_per_m[0] * costs->px_per_m[0], far = costs->px_per_m[1] * costs->px_per_m[1];
    const double share = near > far ? fmin(fmax((px_per_m * px_per_m - far) / (near - far), 0), 1) : 0;
    return (share > 0 ? share * ms[0] : 0) + (share < 1 ? (1 - share) * ms[1] : 0); // either may be infinite
}

double detail_share_of_full(const struct detail_costs *costs, enum detail level, double px_per_m)
{
    const double full = cost_at(costs, costs->playing_ms[DETAIL_FULL], px_per_m);
    const double share = costs->measured ? cost_at(costs, costs->playing_ms[level], px_per_m) / full : NAN;
    return share > 0 ? share : NAN;
}

enum detail detail_choose(const struct detail_costs *costs, const double error_px[DETAIL_LEVELS], double px_per_m,
                          double allowed_px, enum detail finest)
{
    enum detail best = finest;
    for (int level = (int)finest - 1; level >= 0; level--) {
        if (!(error_px[level] <= allowed_px))
            continue;
        const bool still = !costs->measured || cost_at(costs, costs->still_ms[level], px_per_m) <=
                                                   cost_at(costs, costs->still_ms[finest], px_per_m);
        const bool playing =
            !costs->measured || cost_at(costs, costs->playing_ms[level], px_per_m) <
                                    (1 - SAME_COST) * cost_at(costs, costs->playing_ms[best], px_per_m);
        if (still && playing)
            best = (enum detail)level;
    }
    return best;
}
