// Levels of detail at which a recorded actor is drawn (reenact/render/actor_renderer.h): what commands, settings and
// the renderer call them. From coarse to fine; what each costs depends on the device. Pure.
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
