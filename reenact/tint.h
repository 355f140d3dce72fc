// Where the likeness's colours meet a frame's: what depth does not tell, how a round limb is turned about its bone and
// how far it is shifted along it, colours do. Pure.
#pragma once
#include "reenact/coat.h"

// All borrowed. rgb: the frame's own colours, nobody else's among them (sight_colors).
struct tint {
    const struct surface *surface;
    const struct skin *skins; // of its points
    const struct coat *coat;
    const struct calibration *calibration;
    const struct sight *sight;
    const uint8_t *rgb;
    struct pose world_from_camera;
};

// One point of part `part` at `at` (colour camera's axes, metres): moved by d, the difference between picture and
// likeness there changes by dot(along, d), and `value` is what it should change by. 1: black to white.
struct tint_row {
    int part;
    struct vec3 at, along;
    double value;
};

// At most `most` rows, spread over what the frame shows of the person in `posture`. reach: pixels over which the
// picture's slope is taken. Returns how many.
int tint_rows(const struct tint *t, const struct posture *posture, int reach, struct tint_row *rows, int most);
