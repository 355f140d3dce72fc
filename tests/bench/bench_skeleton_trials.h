// The skeleton's trials: tables of error alone, by motion, by body, by sequence.
#pragma once
#include "tests/bench/bench.h"

// Somebody in the small world who moves as the BVH files of `folder` say, seen by
// a Kinect (320x240, 30 Hz) from the front and from 45 degrees aside; of each file at
// most the first eight seconds. ERR_MISSING: no such file there.
MUST_CHECK enum status trial_motions(struct bench *b, const char *folder);

// The same with people of all sizes and clothes, in the world's own motions.
MUST_CHECK enum status trial_bodies(struct bench *b);

// Real people in the folders of `folder` (TUM layout), next to what Kinect's own
// tracker made of them: a reference and no truth. ERR_MISSING: no such folder there.
MUST_CHECK enum status trial_sequences(struct bench *b, const char *folder);

// The person in a folder that has truth (bench_skeleton_data.h), joint by joint, as `record` has them: errors as they
// are, and less what is constant of each joint's in the axes of trunk or pelvis.
MUST_CHECK enum status trial_joints(struct bench *b, const char *folder);
