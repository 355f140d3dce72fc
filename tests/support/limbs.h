// A synthetic skeleton in continual motion: every bone swings on its own in sums of slow waves, and the whole body
// turns. No pose recurs, which makes it the hardest motion for pose retrieval.
#pragma once
#include "recording/skeleton.h"
#include "tests/support/random.h"

enum { LIMB_WAVES = 4 };

struct limbs {
    struct limb_wave {
        double amplitude, hertz, phase;
    } heading[LIMB_WAVES], swing[JOINT_COUNT][2][LIMB_WAVES];
};

struct limbs limbs_random(struct rng *rng);

// All joints known, in the axes of a camera 3 m away (y down, z forward), with Gaussian noise of noise_m in each
// coordinate.
struct skeleton limbs_at(const struct limbs *l, double time_s, double noise_m, struct rng *rng);

// The same pose seen by a camera moved round the person by `angle` (radians).
struct skeleton limbs_rotated(const struct skeleton *s, double angle, double noise_m, struct rng *rng);
