// The skeleton stage's trials: tables of error alone, by motion, by body, by chance, by sequence, by empty rooms.
// Errors: as the stage, and ERR_MISSING where said.
#pragma once
#include "tests/bench/bench.h"

// The small world's figure moving as the BVH files of `folder` say, seen by a Kinect (320x240, 30 Hz) from the front
// and from 45 degrees aside; at most the first eight seconds of each file. ERR_MISSING: no such file there.
MUST_CHECK enum status trial_motions(struct bench *b, const char *folder);

// The same with figures of all sizes and clothes, in the world's own motions.
MUST_CHECK enum status trial_bodies(struct bench *b);

// Random short films (tests/support/dice_plan.h) in the world's own motions and, where `motions` is not NULL, those of
// its BVH files: how often the skeleton is wrong, by cause, and the command that makes each of the worst films again.
// ERR_MISSING: no such file there. ERR_IO: what the films could not be written to.
MUST_CHECK enum status trial_dice(struct bench *b, const struct bench_dice *dice, const char *motions);

// Real people in the folders of `folder` (TUM layout), next to the Kinect SDK's tracker: a reference, not truth.
// ERR_MISSING: no such folder there.
MUST_CHECK enum status trial_sequences(struct bench *b, const char *folder);

// The person in a folder with truth (bench_skeleton_data.h), joint by joint, as `record` stores them: the errors, and
// the errors with each joint's constant part in the axes of trunk or pelvis removed.
MUST_CHECK enum status trial_joints(struct bench *b, const char *folder);

// Images of rooms without a person (TUM layout), 30 of each folder: how many are taken for a person as the first of a
// film, by depth alone and, where the networks are there, with body points of the colour image. ERR_MISSING: no such
// folder.
MUST_CHECK enum status trial_empty(struct bench *b, const struct bench_folders *folders);
