// Levels of detail at which a recorded actor is drawn (reenact/render/actor_renderer.h): what commands, settings and
// the renderer call them, what they cost on this device, and which of them is the cheapest whose error is not seen.
// Pure.
#pragma once
#include <stdbool.h>

enum detail {
    DETAIL_PAPER, // [D14] to the letter, the yardstick: open cylinders, one source frame for the whole body (eq. 5),
                  // its unmodified colours
    DETAIL_PARTS, // rounded cylinders, for each the frame whose skeleton is nearest about that part, in the colours
                  // that it shows of that part; interpolated skeleton
    DETAIL_FUSED, // the avatar in its own shape and colours, without a frame layer
    DETAIL_FULL,  // the avatar with the shown frame's layer
    DETAIL_AUTO,  // the cheapest of these whose error is not seen
    DETAIL_COUNT,
};
enum { DETAIL_LEVELS = DETAIL_AUTO }; // those that are drawn

// As in --detail.
extern const char *const detail_names[DETAIL_COUNT];

// Whether an avatar is drawn, or may be.
bool detail_needs_avatar(enum detail detail);

// ---------------------------------------------------------------- costs

// What an image takes at two sizes of the actor, milliseconds, as measured on a device (renderer_measure_costs).
struct detail_costs {
    bool measured;                       // false: levels cost more in their order
    double px_per_m[2];                  // the sizes: pixels a metre at the actor; the first is the larger
    double still_ms[DETAIL_LEVELS][2];   // the same image again; infinite: cannot be drawn
    double playing_ms[DETAIL_LEVELS][2]; // each image another recorded frame: reading and preparing it included
};

// What a level takes, playing, of what DETAIL_FULL takes; NAN: not measured.
double detail_share_of_full(const struct detail_costs *costs, enum detail level, double px_per_m);

// The cheapest level up to `finest`, playing, of those whose error is at most `allowed_px` and that take no longer than
// `finest` when still; `finest` where there is none. error_px: predicted, of each level. px_per_m: of the actor.
enum detail detail_choose(const struct detail_costs *costs, const double error_px[DETAIL_LEVELS], double px_per_m,
                          double allowed_px, enum detail finest);
