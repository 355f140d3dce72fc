// A person doing an exercise, as joints with exact truth: both arms are raised sideways and lowered while the knees
// bend, and the right hand does more than the left, so that left and right can be distinguished. One repetition takes 3
// s.
#pragma once
#include "compare/joint_samples.h"
#include "recording/skeleton.h"
#include "tests/support/random.h"

struct exercise {
    double seconds, rate_hz;
    double tempo;                   // 1; 2: twice as fast
    double begin_s;                 // where in the repetition it begins
    double size, yaw_rad, x_m, z_m; // of the person, and where they stand
    double noise_m;
    double right_elbow_rad; // bent more by this between wrong_from_s and wrong_to_s
    double left_elbow_rad, left_arm_rad, right_knee_rad, lean_rad; // the same: bent, raised, bent, forwards
    double turn_rad; // the same: shoulders and arms turned to the left against the hips
    double wrong_from_s, wrong_to_s;
    double right_arm_late_s;
    double range;               // 1: all of it
    double pause_at_s, pause_s; // stands still for pause_s at pause_at_s
    bool mirrored, still, walking;
};
struct exercise exercise_default(void); // 6 s at 30 Hz, a person 1.7 m tall, 3 m away, facing the camera

// Camera axes, y down. All joints are known.
struct skeleton exercise_at(const struct exercise *e, double time_s, struct rng *rng);
void exercise_samples(const struct exercise *e, struct rng *rng, struct joint_samples *out);
