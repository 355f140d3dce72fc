// Depth that is registered to colour, but of another size, at colour's pixels: telephones' depth is a quarter as wide
// as their colour. Pure; safe from any thread.
#pragma once
#include "base/lens.h"

#include <stdint.h>

// Whether depth is the colour camera's at another size, so that registered_depth_resize is needed for what reads depth
// at a colour pixel.
bool registered_depth_differs(const struct calibration *calibration);

// out: a value for each colour pixel, millimetres, 0 = no reading; interpolated between the four samples around it.
// Where one of them is missing, or they lie on two sides of an edge, there is no reading: nothing is made up.
void registered_depth_resize(const struct calibration *calibration, const uint16_t *depth, uint16_t *out);
