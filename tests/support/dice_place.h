// Where the actor, the furniture and the passer-by of a random film stand. Internal to dice_plan.c.
#pragma once
#include "tests/support/dice_plan.h"
#include "tests/support/random.h"

// The true joints of a film, world axes: as the motions prescribe them, before they are placed; then in their places.
struct dice_scene {
    struct skeleton actor[DICE_FRAMES_MOST], passerby[DICE_FRAMES_MOST];
};

// The joints of an actor of the plan in each frame of the film, as its spot places them.
MUST_CHECK enum status dice_preview(const struct dice_plan *plan, const struct dice_actor *actor, struct skeleton *out);

// Each draws places until one makes the plan's situation come true, and then writes it to the plan and moves the
// scene's joints there. NOTHING: none of a number of tries did.
MUST_CHECK enum status dice_place_actor(struct rng *rng, struct dice_plan *plan, struct dice_scene *scene);
MUST_CHECK enum status dice_place_furniture(struct rng *rng, struct dice_plan *plan, struct dice_scene *scene);
MUST_CHECK enum status dice_place_passerby(struct rng *rng, struct dice_plan *plan, struct dice_scene *scene);
