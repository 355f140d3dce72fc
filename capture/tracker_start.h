// Finding a person's pose with nothing to go by but one picture, and finding a
// limb again that the motion lost.
#pragma once
#include "capture/body_fit.h"

// Results are large; the caller lends room for them.
struct fit_room {
    struct fit_result best, trial, other;
};

// Fills room->best and moves task->shape to the person's size. task's evidence
// and floor are in use; up must be set. False: no pose explains the points.
bool start_search(struct fit_task *task, struct fit_room *room);

// room->best holds the fit of this picture. Tries other places for limbs that
// leave points unexplained or stand where nothing is, and keeps the likeliest, twice.
// Returns how many limbs moved.
int limbs_search(const struct fit_task *task, struct fit_room *room);

// room->best holds the fit of this picture. Fits the body that looks the other
// way into room->trial. Returns by how much its energy is less, negative when it is more.
double turned_round_gain(const struct fit_task *task, struct fit_room *room);

// The same for the body with its feet exchanged.
double legs_swapped_gain(const struct fit_task *task, struct fit_room *room);

// The share of the points within `within_m` of the body.
double explained_share(const struct body_evidence *e, const struct fit_result *r, double within_m);
