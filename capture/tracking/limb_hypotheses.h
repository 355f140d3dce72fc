// Other poses that a picture may mean: a limb elsewhere, the body the other way round.
#pragma once
#include "capture/body/body_fit.h"

// Results are large; the caller lends room for them.
struct fit_scratch {
    struct fit_result best, trial, other;
};

enum { FIRST_LEG = 2, LIMB_COUNT = 4 }; // left arm, right arm, left leg, right leg

// In all of them scratch->best holds the fit of this picture.

// Tries other places for limbs that leave points unexplained or stand where nothing is, and
// keeps the likeliest, twice. Returns how many limbs moved.
int limb_search(const struct fit_task *task, struct fit_scratch *scratch);

// Fits one limb elsewhere into scratch->trial: to where the points are that the rest of the body
// does not explain, be they explained by this limb so far or, a little worse, by the trunk.
// Returns by how much that has less energy, negative when it has more or there is no other place.
double limb_alternative_log_odds(const struct fit_task *task, int limb, struct fit_scratch *scratch);

// Fits the body that looks the other way into scratch->trial. Returns by how much its energy is
// less, negative when it is more.
double flipped_log_odds(const struct fit_task *task, struct fit_scratch *scratch);

// The same for the body with its feet exchanged.
double legs_swapped_log_odds(const struct fit_task *task, struct fit_scratch *scratch);

// How far a limb's middle joint or its end, whichever more, is from where it was.
double limb_moved_m(int limb, const struct body_build *from, const struct body_build *to);
// Turns a limb's segments as they are in `from`.
void limb_copy(int limb, const struct body_pose *from, struct body_pose *to);
// Lays a limb of `to` where `from` has it in the camera's axes, as far as it reaches there from where its own trunk
// is: one trunk a little aside of another must not carry the limb with it.
void limb_transfer(int limb, const struct body_shape *shape, const struct body_build *from, struct body_pose *to);
