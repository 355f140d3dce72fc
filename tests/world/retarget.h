// Retargets a motion-capture file to our figure: directions of limbs, trunk and head are the file's, lengths the
// figure's; the feet keep their paths, scaled to its legs, so that feet on the floor stay on the floor. Internal to
// tests/world.
#pragma once
#include "tests/world/body.h"

struct retarget;

// Starts facing the sensor, the path centred in the room; of a motion that extends further than 2.6 m, the longest
// stretch that does not, unless `whole`: which one that is depends on the figure. ERR_MISSING, ERR_IO; ERR_INPUT: not a
// BVH file, or a needed joint is missing. ERR_MEMORY.
MUST_CHECK enum status retarget_open(struct retarget **out, const char *path, const struct physique *p, bool whole);
void retarget_close(struct retarget **r); // NULL is fine
double retarget_seconds(const struct retarget *r);
struct stance retarget_at(const struct retarget *r, const struct physique *p, double time_s);
