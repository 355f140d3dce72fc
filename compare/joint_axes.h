// Which way a file's axes point, by the body: a head is above the feet, knees bend forwards.
//
// Up is where a person who stands straight for a second points to. Of others it is the mean, over the samples in which
// a shin and the trunk point the same way, of the direction from the feet to the middle of the trunk, which is balanced
// above them, or of trunk and shins of one who sits; samples more than 45 degrees off are left out. A direction near an
// axis is that axis, and what remains is the tilt of a sensor. Handedness is the sense in which knees bend: from thigh
// to shin about the axis from the right hip to the left. It needs no up. Elbows, which turn further, are asked where
// the knees say nothing.
#pragma once
#include "compare/joint_samples.h"

// Turns, and mirrors, samples in a file's axes into those of joint_samples.h. said: enum joints_csv_axes, as the file
// says; -1: it does not. What it says is believed but for knees that would bend backwards; a person who
// then lies or is upside down is only noted. What was found out is noted. The tilt that remains is taken out as
// joint_samples_level() does, except in a room's axes. ERR_INPUT: nothing is said and it cannot be told; the sentence
// says why. Samples without hips and shoulders, which no movement is made of, are left as they are.
MUST_CHECK enum status joint_axes_settle(struct joint_samples *s, const char *path, int said);
