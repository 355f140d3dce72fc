// Films the small world as a telephone does, and writes one film as a folder in the TUM layout, as Record3D's .r3d and
// as a folder of Stray Scanner: the same JPEG images, the same depth, a fifth of it with low confidence and wrong,
// which the TUM folder has as no reading. Errors abort.
#pragma once
#include "tests/support/scratch.h"
#include "tests/world/world.h"

enum { TELEPHONE_WIDTH = 640, TELEPHONE_HEIGHT = 480, TELEPHONE_DEPTH_WIDTH = 256, TELEPHONE_DEPTH_HEIGHT = 192 };

struct telephone_film;

// `frames` images from first_s on, each step_s later. sweep: carried through the empty room (world_sweep_pose); else on
// the sensor's stand, with the actor. blind_rows: the lowest rows of depth have no reading. The odometry that the
// telephone writes down begins elsewhere, turned by a radian, and drifts by 3 cm and a degree over the film.
struct telephone_shooting {
    bool sweep;
    double first_s, step_s;
    int frames, blind_rows;
    double lean_rad; // of what the odometry takes for gravity
};
struct telephone_film *telephone_film_shoot(const struct world *world, const struct telephone_shooting *shooting);
void telephone_film_free(struct telephone_film *film);

void telephone_film_as_tum(const struct telephone_film *film, const struct scratch *scratch, const char *name);
void telephone_film_as_record3d(const struct telephone_film *film, const struct scratch *scratch, const char *name);
// on_side: the telephone was held upright, so that what it stores lies on its side.
void telephone_film_as_stray(const struct telephone_film *film, const struct scratch *scratch, const char *name,
                             bool on_side);
