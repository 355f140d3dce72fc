// What an open world holds. Internal to tests/world.
#pragma once
#include "tests/world/edit.h"
#include "tests/world/figure.h"
#include "tests/world/motion.h"
#include "tests/world/scene.h"
#include "tests/world/still_view.h"

struct world {
    struct world_options options; // `motion` and `edit` are the caller's: NULL
    bool edited;
    struct world_edit edit; // where `edited`
    struct physique physique;
    struct figure_motion *motion;
    struct world_scene scene;
    struct figure figure;
    struct still_views *views; // the only thing that a render changes
};

// The figure's stance at `time_s`, positioned by the options. world.c
struct stance world_stance(const struct world *w, double time_s);

// The stance of an edited motion, not yet positioned. edit.c
struct stance world_edit_at(const struct world_edit *e, const struct figure_motion *motion,
                            const struct physique *physique, double time_s);
