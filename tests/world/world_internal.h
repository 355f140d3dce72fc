// What an open world holds. Internal to tests/world.
#pragma once
#include "tests/world/figure.h"
#include "tests/world/motion.h"
#include "tests/world/scene.h"

struct world {
    struct world_options options;
    struct physique physique;
    struct figure_motion *motion;
    struct world_scene scene;
    struct figure figure;
};

// The figure's stance at `time_s`, positioned by the options. world.c
struct stance world_stance(const struct world *w, double time_s);
