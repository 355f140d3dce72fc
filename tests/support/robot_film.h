// A robot's captures in the small world: panoramas, and on wish depth pictures, whose poses are known. Errors abort.
#pragma once
#include "surround/picture/surround_picture.h"
#include "tests/support/scratch.h"
#include "tests/world/world.h"

enum { ROBOT_CAPTURES = 2, ROBOT_PANORAMA = 768 /* rows */ };
static const double ROBOT_SIZE_M[3] = {0.7, 0.5, 1.3};

// The room's world from the robot's, which is its body at the first capture; where its body went there; and its head,
// x right, y down, z ahead, in its body's axes, x ahead, y left, z up.
extern const struct pose robot_truth, robot_world_from_body[ROBOT_CAPTURES], robot_body_from_head;
extern const struct lens robot_view; // of the operator's pictures

// What the head sees of the empty room at that capture, placed in the robot's world.
struct surround_picture robot_panorama(const struct world *w, int capture);

// The captures, a second apart, as a folder `name` to be played. depth: of that world; NULL: panoramas alone.
void robot_film(const struct scratch *scratch, const char *name, const struct surround_picture *panoramas,
                const struct world *depth);
