// A motion-capture file on our figure: directions of limbs, trunk and head are the
// file's, lengths the figure's; the feet keep their paths, scaled to its legs, so
// that what stood on the floor stands on the floor. Internal to tests/world.
#pragma once
#include "tests/world/body.h"

struct retarget;

// Starts facing the sensor, the way covered centred in the room; of a motion that goes
// further than 2.6 m, the longest stretch that does not.
// ERR_MISSING, ERR_IO; ERR_INPUT: no BVH file, or a joint we need is not in it. ERR_MEMORY.
MUST_CHECK enum status retarget_open(struct retarget **out, const char *path, const struct physique *p);
void retarget_close(struct retarget **r); // NULL is fine
double retarget_seconds(const struct retarget *r);
struct stance retarget_at(const struct retarget *r, const struct physique *p, double time_s);
