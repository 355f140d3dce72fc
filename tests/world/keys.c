#include "tests/world/keys.h"

// Key poses of the named motions, a pose a row; chosen by hand.
// clang-format off

// The directions of an upper arm and of its forearm.
#define DOWN        {0.20, 0.02, -1}, {0.12, -0.22, -1} // hanging, the elbows a little bent
#define WIDE        {1, -0.10, 0.02}, {1, -0.35, 0.16}
#define HIGH        {0.50, -0.15, 1}, {-0.28, -0.10, 1}
#define ROUND       {0.62, -0.75, -0.25}, {-0.75, -0.62, 0.05}
#define GUARD       {0.30, -0.55, -0.80}, {-0.22, -0.62, 0.75}
#define PUNCH       {0.05, -1, 0.02}, {-0.12, -1, 0.05}
#define CHAMBER     {0.32, 0.62, -0.75}, {-0.05, -1, -0.08}
#define CROSS       {0.34, -0.62, -0.58}, {-0.95, -0.22, 0.42}
#define REACH       {0.16, -0.95, -0.42}, {-0.05, -1, -0.25}
#define CARRY       {0.62, -0.75, -0.25}, {-0.25, -1, 0.1}
#define SWING_FORE  {0.16, -0.42, -1}, {0.04, -0.85, -1}
#define SWING_BACK  {0.18, 0.48, -1}, {0.12, 0.22, -1}
#define BACK        {0.22, 0.38, -1}, {-0.85, 0.42, 0.10} // the forearm behind the waist

#define ARMS(left, right) .left_arm = {left}, .right_arm = {right}

static const struct key still[] = {
    {.t = 0, ARMS(DOWN, DOWN)},
    {.t = 4, ARMS(DOWN, DOWN)},
};

static const struct key pirouette[] = {
    {.t = 0.0, .x = 0.10, .y = 0.95, .head_yaw = 0, ARMS(DOWN, DOWN)},
    {.t = 0.6, .x = 0.10, .y = 0.92, .sink = 0.02, ARMS(DOWN, DOWN)},
    {.t = 1.4, .x = 0.05, .y = 0.52, .chest_yaw = 12, .head_yaw = -4, ARMS(ROUND, DOWN)},
    {.t = 2.2, .x = -0.02, .y = 0.10, .chest_yaw = -14, .chest_roll = 5, .head_yaw = 6, ARMS(WIDE, ROUND)},
    {.t = 3.0, .x = 0.00, .y = -0.30, .chest_yaw = 6, .chest_roll = -6, .head_pitch = -6, ARMS(HIGH, WIDE)},
    {.t = 3.6, .x = 0.00, .y = -0.50, .sink = 0.06, .chest_yaw = -22, .head_yaw = 4, ARMS(WIDE, ROUND)},
    {.t = 4.4, .x = 0.00, .y = -0.52, .heading = 75, .chest_yaw = 14, .head_yaw = 24, ARMS(ROUND, WIDE)},
    {.t = 5.2, .x = 0.02, .y = -0.52, .heading = 170, .chest_yaw = 8, .chest_roll = 4, .head_yaw = 16,
     .head_pitch = -8, ARMS(HIGH, HIGH)},
    {.t = 6.0, .x = 0.02, .y = -0.50, .heading = 265, .chest_yaw = 10, .head_yaw = 26, ARMS(WIDE, HIGH)},
    {.t = 6.8, .x = 0.00, .y = -0.50, .heading = 345, .chest_yaw = 6, .head_yaw = 12, ARMS(WIDE, WIDE)},
    {.t = 7.4, .x = 0.00, .y = -0.50, .heading = 360, .sink = 0.03, ARMS(ROUND, WIDE)},
    {.t = 8.2, .x = 0.00, .y = -0.50, .heading = 360, .sink = 0.05, .pelvis_pitch = 8, .chest_pitch = 26,
     .head_pitch = 20, ARMS(ROUND, WIDE)},
    {.t = 9.0, .x = 0.00, .y = -0.50, .heading = 360, ARMS(DOWN, DOWN)},
};

static const struct key kata[] = {
    {.t = 0.0, ARMS(DOWN, DOWN)},
    {.t = 0.8, .sink = 0.08, .apart = 0.10, ARMS(GUARD, GUARD)},
    {.t = 1.2, .sink = 0.10, .apart = 0.12, .chest_yaw = 30, ARMS(CHAMBER, PUNCH)},
    {.t = 1.5, .sink = 0.10, .apart = 0.12, .chest_yaw = 30, ARMS(CHAMBER, PUNCH)},
    {.t = 1.9, .sink = 0.10, .apart = 0.12, .chest_yaw = -30, ARMS(PUNCH, CHAMBER)},
    {.t = 2.2, .sink = 0.10, .apart = 0.12, .chest_yaw = -30, ARMS(PUNCH, CHAMBER)},
    {.t = 2.7, .sink = 0.05, .apart = 0.04, ARMS(GUARD, GUARD)},
    {.t = 3.1, .sink = 0.05, .apart = 0.03, .chest_pitch = -6, .hips = {-0.07, 0.02, 0},
     .left_foot = {-0.03, -0.10, 0.45}, .left_toes = 40, ARMS(GUARD, GUARD)},
    {.t = 3.4, .sink = 0.05, .apart = 0.03, .chest_pitch = -16, .hips = {-0.08, 0.04, 0},
     .left_foot = {-0.06, -0.80, 0.80}, .left_toes = -35, ARMS(GUARD, GUARD)},
    {.t = 3.8, .sink = 0.05, .apart = 0.03, .chest_pitch = -6, .hips = {-0.07, 0.02, 0},
     .left_foot = {-0.03, -0.10, 0.40}, .left_toes = 30, ARMS(GUARD, GUARD)},
    {.t = 4.3, .sink = 0.06, .apart = 0.03, ARMS(GUARD, GUARD)},
    {.t = 4.7, .sink = 0.05, .apart = 0.03, .chest_pitch = -6, .hips = {0.07, 0.02, 0},
     .right_foot = {0.03, -0.10, 0.45}, .right_toes = 40, ARMS(GUARD, GUARD)},
    {.t = 5.0, .sink = 0.05, .apart = 0.03, .chest_pitch = -16, .hips = {0.08, 0.04, 0},
     .right_foot = {0.06, -0.80, 0.80}, .right_toes = -35, ARMS(GUARD, GUARD)},
    {.t = 5.4, .sink = 0.05, .apart = 0.03, .chest_pitch = -6, .hips = {0.07, 0.02, 0},
     .right_foot = {0.03, -0.10, 0.40}, .right_toes = 30, ARMS(GUARD, GUARD)},
    {.t = 5.9, .sink = 0.08, .apart = 0.10, ARMS(GUARD, GUARD)},
    {.t = 6.6, .sink = 0.08, .apart = 0.10, .chest_pitch = 8, .head_pitch = 6, ARMS(CROSS, CROSS)},
    {.t = 7.4, .sink = 0.08, .apart = 0.10, .chest_pitch = 8, .head_pitch = 6, ARMS(CROSS, CROSS)},
    {.t = 8.0, .sink = 0.02, .apart = 0.02, ARMS(DOWN, DOWN)},
};

static const struct key bend[] = {
    {.t = 0.0, ARMS(DOWN, DOWN)},
    {.t = 0.8, .apart = 0.06, ARMS(DOWN, DOWN)},
    {.t = 2.2, .sink = 0.30, .apart = 0.10, .hips = {0, 0.20, 0}, .pelvis_pitch = 45, .chest_pitch = 72,
     .head_pitch = 50, ARMS(REACH, REACH)},
    {.t = 2.7, .sink = 0.30, .apart = 0.10, .hips = {0, 0.20, 0}, .pelvis_pitch = 45, .chest_pitch = 72,
     .head_pitch = 50, ARMS(REACH, REACH)},
    {.t = 4.2, .apart = 0.06, .chest_pitch = -4, ARMS(CARRY, CARRY)},
    {.t = 4.8, .apart = 0.06, .chest_pitch = -4, ARMS(CARRY, CARRY)},
    {.t = 6.0, .apart = 0.02, ARMS(DOWN, DOWN)},
};

// A stride with the left or the right arm in front.
#define STRIDE_LEFT(time, px, py, h) \
    {.t = time, .x = px, .y = py, .heading = h, .chest_yaw = -8, .pelvis_yaw = 6, ARMS(SWING_FORE, SWING_BACK)}
#define STRIDE_RIGHT(time, px, py, h) \
    {.t = time, .x = px, .y = py, .heading = h, .chest_yaw = 8, .pelvis_yaw = -6, ARMS(SWING_BACK, SWING_FORE)}

static const struct key walk[] = {
    {.t = 0.0, .x = 1.3, .y = 0.3, .heading = -80, ARMS(DOWN, DOWN)},
    STRIDE_LEFT(0.60, 1.05, 0.26, -80),
    STRIDE_RIGHT(1.10, 0.60, 0.18, -80),
    STRIDE_LEFT(1.60, 0.10, 0.08, -80),
    STRIDE_RIGHT(2.10, -0.40, -0.02, -75),
    STRIDE_LEFT(2.60, -0.85, -0.12, -50),
    STRIDE_RIGHT(3.10, -1.12, -0.32, 0),
    STRIDE_LEFT(3.60, -1.05, -0.60, 50),
    STRIDE_RIGHT(4.10, -0.70, -0.78, 80),
    STRIDE_LEFT(4.60, -0.20, -0.80, 90),
    STRIDE_RIGHT(5.10, 0.30, -0.80, 90),
    STRIDE_LEFT(5.60, 0.75, -0.80, 90),
    {.t = 6.4, .x = 1.0, .y = -0.80, .heading = 60, ARMS(DOWN, DOWN)},
};

static const struct key hide[] = {
    {.t = 0.0, ARMS(DOWN, DOWN)},
    {.t = 0.5, ARMS(WIDE, DOWN)},
    {.t = 0.8, ARMS(DOWN, DOWN)},
    {.t = 1.1, ARMS(BACK, DOWN)},
    {.t = 1.8, ARMS(BACK, DOWN)},
    {.t = 2.0, ARMS(DOWN, DOWN)},
    {.t = 2.2, ARMS(WIDE, DOWN)},
    {.t = 2.8, ARMS(WIDE, DOWN)},
};

static const struct key visit[] = {
    {.t = 0.0, .x = 2.35, .y = 0.05, .heading = -90, ARMS(DOWN, DOWN)},
    {.t = 0.4, .x = 2.35, .y = 0.05, .heading = -90, ARMS(DOWN, DOWN)},
    STRIDE_LEFT(0.90, 2.15, 0.04, -90),
    STRIDE_RIGHT(1.40, 1.70, 0.03, -90),
    STRIDE_LEFT(1.90, 1.25, 0.02, -85),
    STRIDE_RIGHT(2.40, 0.80, 0.01, -80),
    STRIDE_LEFT(2.90, 0.38, 0.01, -60),
    {.t = 3.5, .x = 0.02, .heading = -5, ARMS(DOWN, DOWN)},
    {.t = 4.1, ARMS(WIDE, WIDE)},
    {.t = 4.8, .chest_yaw = 18, ARMS(HIGH, WIDE)},
    {.t = 5.5, .chest_yaw = -18, ARMS(WIDE, HIGH)},
    {.t = 6.2, .heading = -20, ARMS(DOWN, DOWN)},
    STRIDE_LEFT(6.80, -0.25, 0.01, -75),
    STRIDE_RIGHT(7.30, -0.70, 0.02, -90),
    STRIDE_LEFT(7.80, -1.15, 0.03, -90),
    STRIDE_RIGHT(8.30, -1.60, 0.04, -90),
    STRIDE_LEFT(8.80, -2.05, 0.04, -90),
    {.t = 9.3, .x = -2.35, .y = 0.05, .heading = -90, ARMS(DOWN, DOWN)},
    {.t = 9.8, .x = -2.35, .y = 0.05, .heading = -90, ARMS(DOWN, DOWN)},
};

// An exercise as it is shown, and with two known mistakes: the right elbow is bent while the arms are held out and up
// (FOLDED: by about 55 degrees), and the knees are bent by a third as much.
#define HIGH_OPEN   {0.42, -0.10, 1}, {0.22, -0.10, 1}
#define FOLDED      {1, -0.10, 0.02}, {0.52, -0.30, 0.95}
#define HIGH_FOLDED {0.42, -0.10, 1}, {-0.62, -0.28, 0.85}

static const struct key exercise[] = {
    {.t = 0.0, .apart = 0.04, ARMS(DOWN, DOWN)},
    {.t = 0.4, .apart = 0.04, ARMS(DOWN, DOWN)},
    {.t = 1.3, .apart = 0.04, ARMS(WIDE, WIDE)},
    {.t = 1.7, .apart = 0.04, ARMS(WIDE, WIDE)},
    {.t = 2.5, .apart = 0.04, ARMS(HIGH_OPEN, HIGH_OPEN)},
    {.t = 2.8, .apart = 0.04, ARMS(HIGH_OPEN, HIGH_OPEN)},
    {.t = 3.7, .apart = 0.08, .sink = 0.26, .hips = {0, 0.12, 0}, .pelvis_pitch = 18, .chest_pitch = 24,
     ARMS(REACH, REACH)},
    {.t = 4.0, .apart = 0.08, .sink = 0.26, .hips = {0, 0.12, 0}, .pelvis_pitch = 18, .chest_pitch = 24,
     ARMS(REACH, REACH)},
    {.t = 5.0, .apart = 0.04, ARMS(WIDE, WIDE)},
    {.t = 5.9, .apart = 0.04, ARMS(DOWN, DOWN)},
    {.t = 6.4, .apart = 0.04, ARMS(DOWN, DOWN)},
};

static const struct key exercise_wrong[] = {
    {.t = 0.0, .apart = 0.04, ARMS(DOWN, DOWN)},
    {.t = 0.4, .apart = 0.04, ARMS(DOWN, DOWN)},
    {.t = 1.3, .apart = 0.04, ARMS(WIDE, FOLDED)},
    {.t = 1.7, .apart = 0.04, ARMS(WIDE, FOLDED)},
    {.t = 2.5, .apart = 0.04, ARMS(HIGH_OPEN, HIGH_FOLDED)},
    {.t = 2.8, .apart = 0.04, ARMS(HIGH_OPEN, HIGH_FOLDED)},
    {.t = 3.7, .apart = 0.08, .sink = 0.05, .hips = {0, 0.04, 0}, .pelvis_pitch = 8, .chest_pitch = 22,
     ARMS(REACH, REACH)},
    {.t = 4.0, .apart = 0.08, .sink = 0.05, .hips = {0, 0.04, 0}, .pelvis_pitch = 8, .chest_pitch = 22,
     ARMS(REACH, REACH)},
    {.t = 5.0, .apart = 0.04, ARMS(WIDE, FOLDED)},
    {.t = 5.9, .apart = 0.04, ARMS(DOWN, DOWN)},
    {.t = 6.4, .apart = 0.04, ARMS(DOWN, DOWN)},
};

// One hand above the head, then the other: the gesture that starts and stops a take.
#define ABOVE       {0.22, -0.10, 1}, {0.02, -0.06, 1}

static const struct key raise_hand[] = {
    {.t = 0.0, ARMS(DOWN, DOWN)},
    {.t = 0.5, ARMS(DOWN, DOWN)},
    {.t = 1.0, ARMS(DOWN, ABOVE)},
    {.t = 2.0, ARMS(DOWN, ABOVE)},
    {.t = 2.6, ARMS(DOWN, DOWN)},
    {.t = 3.0, ARMS(DOWN, DOWN)},
    {.t = 3.5, ARMS(ABOVE, DOWN)},
    {.t = 4.5, ARMS(ABOVE, DOWN)},
    {.t = 5.1, ARMS(DOWN, DOWN)},
};

// Postures in which legs are hidden by the trunk or by themselves, arms moving: on both knees, in a deep crouch, and on a
// seat of 0.45 m, which is not there.
#define KNEELING .sink = 0.44, .left_foot = {0, 0.42, 0.06}, .right_foot = {0, 0.42, 0.06}, \
    .left_toes = 60, .right_toes = 60
#define CROUCHED .sink = 0.56, .apart = 0.08, .hips = {0, 0.18, 0}, \
    .pelvis_pitch = 30, .chest_pitch = 40, .head_pitch = 10
#define SEATED   .sink = 0.43, .apart = 0.05, .hips = {0, 0.42, 0}

static const struct key kneel[] = {
    {.t = 0.0, KNEELING, ARMS(DOWN, DOWN)},
    {.t = 0.7, KNEELING, ARMS(WIDE, DOWN)},
    {.t = 1.4, KNEELING, ARMS(WIDE, WIDE)},
    {.t = 2.4, KNEELING, .chest_yaw = 15, ARMS(DOWN, DOWN)},
};

static const struct key crouch[] = {
    {.t = 0.0, ARMS(DOWN, DOWN)},
    {.t = 0.4, ARMS(DOWN, DOWN)},
    {.t = 1.0, CROUCHED, ARMS(REACH, REACH)},
    {.t = 2.4, CROUCHED, .chest_yaw = 15, ARMS(REACH, REACH)},
};

static const struct key sit[] = {
    {.t = 0.0, SEATED, ARMS(DOWN, DOWN)},
    {.t = 0.7, SEATED, ARMS(DOWN, WIDE)},
    {.t = 1.4, SEATED, ARMS(WIDE, WIDE)},
    {.t = 2.4, SEATED, .chest_yaw = -15, ARMS(DOWN, DOWN)},
};

const struct named_motion named_motions[] = {
    {"pirouette", 0.40, pirouette, COUNT_OF(pirouette)},
    {"kata", 0.45, kata, COUNT_OF(kata)},
    {"still", 0.5, still, COUNT_OF(still)},
    {"bend", 0.5, bend, COUNT_OF(bend)},
    {"walk", 0.5, walk, COUNT_OF(walk)},
    {"hide", 0.5, hide, COUNT_OF(hide)},
    {"visit", 0.5, visit, COUNT_OF(visit)},
    {"exercise", 0.5, exercise, COUNT_OF(exercise)},
    {"exercise-wrong", 0.5, exercise_wrong, COUNT_OF(exercise_wrong)},
    {"raise-hand", 0.5, raise_hand, COUNT_OF(raise_hand)}, // from here on not in world_motion_names: random films stay
    {"kneel", 0.5, kneel, COUNT_OF(kneel)},
    {"crouch", 0.5, crouch, COUNT_OF(crouch)},
    {"sit", 0.5, sit, COUNT_OF(sit)},
};
const size_t named_motion_count = COUNT_OF(named_motions);
