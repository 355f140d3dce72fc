// The figure's motion: named motions, as curves through key poses with planted steps, or a BVH file. Internal to
// tests/world. An open motion never changes: safe from any thread.
#pragma once
#include "tests/world/body.h"

struct figure_motion;

// whole: as retarget_open. ERR_INPUT: no such name (the message lists them), a bad BVH file. ERR_MISSING, ERR_IO,
// ERR_MEMORY.
MUST_CHECK enum status world_motion_open(struct figure_motion **out, const char *name, const struct physique *p,
                                         bool whole);
void world_motion_close(struct figure_motion **m);

double motion_seconds(const struct figure_motion *m);
struct stance world_motion_at(const struct figure_motion *m, const struct physique *p, double time_s);
