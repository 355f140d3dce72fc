// How many commands a driver needs for one path, with the first-person picture alone and with the map (after
// "Building Information-rich Maps for Intuitive Human Interface Using Networked Knowledge Base", section 5: 37 and 18
// on average, by people). The driver here is a script, so that the two are compared under the same rule:
//
//   it knows what the pictures that it was shown have shown, each put where the robot believed to be; it turns towards
//   the farthest point of the shortest way that it knows and can go to straight, and drives there, as far as it has
//   seen the floor under the body; where it has not, it goes 0.2 m and looks again. Each turn and each way is one
//   command.
//
// Deterministic.
#pragma once
#include "reenact/surround/drive/simulated_rover.h"

enum trial_view { TRIAL_PICTURE, TRIAL_MAP, TRIAL_VIEWS };

struct trial_result {
    int commands;
    bool arrived;
    bool touched;
    double length_m; // driven
};

// Drives the bent passage (rover_trial_world(2)) from its start to its end. ERR_MEMORY.
MUST_CHECK enum status drive_trial_run(struct simulated_rover *r, enum trial_view view, struct trial_result *out);
