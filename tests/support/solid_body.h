// Depth images of the tracker's body model in a known pose, drawn without the product's own distances: each solid as
// many balls along its axis and across it.
#pragma once
#include "base/lens.h"
#include "capture/body/body_model.h"

// Draws the body before a wall `wall_m` away; both images are of the lens's size. mask: 255 where the body is seen.
void solid_body_draw(const struct body_build *build, const struct lens *lens, double wall_m, uint16_t *depth,
                     uint8_t *mask);

// The distance of a point from the nearest ball, metres; negative inside. *solid: which solid that is.
double solid_body_distance(const struct body_build *build, struct vec3 point, int *solid);
