// How many commands a driver needs for one path, with the first-person picture alone and with the map (after
// "Building Information-rich Maps for Intuitive Human Interface Using Networked Knowledge Base", section 5: 37 and 18
// on average, by people). The driver here is a script, so that the two are compared under the same rule:
//
//   it knows what the pictures that it was shown have shown, each put where the robot believed to be: the picture
//   ahead, tilted down, too, as the tablet is; with the map, also the view from above for what the picture does not
//   show. What was shown from nearby counts more than what was shown from afar, what was never seen from within 2 m is
//   doubted (from within less, where that leaves no way), and specks are overlooked. It turns towards the farthest
//   point of the best way (short, over floor that was seen, at ease from what stands there) that it can go to straight,
//   looks, and drives there, where the new look leaves that way, as far as it has seen the floor under the body and its
//   margin; where it has not, it goes 0.2 m and looks again.
//   Where the body's corners have no room to turn it first goes straight to where they have. Each turn and each way is
//   one command.
//
// It reads nothing of the simulated world but what is drawn. Deterministic.
#pragma once
#include "surround/drive/simulated_rover.h"

enum trial_view { TRIAL_PICTURE, TRIAL_MAP, TRIAL_VIEWS };

struct trial_result {
    int commands;
    bool arrived;
    bool touched;
    double length_m; // driven
};

// A simulated robot before the bent passage (rover_stage_world(2)), at start `number` from 0 on: starts differ in place
// across the passage, in heading and in the sensors' noise, by fixed steps. The caller closes it. ERR_MEMORY.
MUST_CHECK enum status drive_trial_open(struct simulated_rover *r, int number);
// Drives that passage from its start to its end. ERR_MEMORY.
MUST_CHECK enum status drive_trial_run(struct simulated_rover *r, enum trial_view view, struct trial_result *out);

// The trial of Okura 2014, section 5, by a scripted driver that sees nothing but the nearest distance in the drawn
// picture from above: it approaches what is ahead as closely as it dares. *clearance_m: the true distance at the end, 0
// or less: it touched.
MUST_CHECK enum status drive_trial_approach(struct simulated_rover *r, double *clearance_m);
