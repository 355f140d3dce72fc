// Written by tools/calibrate_joint_error; see there. Fitted to 132 random films of reenact-bench skeleton --seconds 3,
// depth alone: --dice 36 of seeds 1001 and 1003 with six motion-capture files as --motions, of 1002 without; --dice 24
// --postures of 1004.
static const struct decision online_decision = {-1.34, -0.013, 3.484, 0.365};
static const struct kind_weights online_kind[KINDS] = {
    [KIND_HEAD] = {{-2.867, -3.625}, {-11.983, -11.216}},     [KIND_NECK] = {{-2.634, -2.933}, {-11.670, -11.445}},
    [KIND_SHOULDER] = {{-2.697, -3.570}, {-10.494, -10.659}}, [KIND_ELBOW] = {{-3.735, -5.281}, {-7.913, -8.485}},
    [KIND_HAND] = {{-3.127, -5.086}, {-7.863, -7.642}},       [KIND_TORSO] = {{-2.477, -3.571}, {-11.930, -12.003}},
    [KIND_WAIST] = {{-2.759, -3.733}, {-11.036, -11.226}},    [KIND_HIP] = {{-2.853, -3.439}, {-10.304, -10.729}},
    [KIND_KNEE] = {{-4.019, -5.949}, {-8.116, -8.244}},       [KIND_FOOT] = {{-3.360, -6.241}, {-8.077, -7.996}},
};
static const struct feature_weights online_feature[] = {
    [FEATURE_ENERGY] = {{0.000, 0.000}, {0.000, 0.000}},     [FEATURE_ENERGY_MEAN] = {{0.000, 0.000}, {0.000, 0.000}},
    [FEATURE_DENSITY] = {{0.489, 0.679}, {0.901, 0.368}},    [FEATURE_NO_PERSON] = {{8.283, 0.626}, {21.689, 22.247}},
    [FEATURE_SHAPE] = {{0.322, 0.022}, {0.746, 0.000}},      [FEATURE_POSTURE] = {{0.466, 0.542}, {0.764, 0.739}},
    [FEATURE_INTRUSION] = {{0.102, 0.004}, {0.201, 0.000}},  [FEATURE_UNEXPLAINED] = {{3.679, 3.885}, {1.202, 1.323}},
    [FEATURE_FLIP] = {{2.716, 4.358}, {3.821, 2.852}},       [FEATURE_BACKWARDS] = {{1.735, 0.476}, {2.058, 1.340}},
    [FEATURE_START] = {{0.375, 0.000}, {0.260, 0.067}},      [FEATURE_SIDEWAYS] = {{0.000, 0.083}, {0.000, 0.000}},
    [FEATURE_BENT] = {{0.000, 0.000}, {0.000, 0.000}},       [FEATURE_TURNED] = {{0.000, 0.000}, {0.000, 0.000}},
    [FEATURE_CROPPED] = {{0.127, 0.592}, {0.517, 0.324}},    [FEATURE_FAR] = {{0.280, 0.594}, {0.752, 0.279}},
    [FEATURE_NEAR] = {{2.108, 0.302}, {0.600, 0.000}},       [FEATURE_SKIRT] = {{0.136, 0.086}, {0.072, 0.000}},
    [FEATURE_MISFIT] = {{0.000, 0.000}, {0.000, 0.909}},     [FEATURE_STARVED] = {{0.397, 2.139}, {0.708, 3.242}},
    [FEATURE_FREE_SPACE] = {{0.051, 0.483}, {0.000, 0.637}}, [FEATURE_RELOCATED] = {{0.102, 0.156}, {0.000, 0.000}},
    [FEATURE_PAIR_NEAR] = {{0.000, 0.229}, {0.000, 0.000}},  [FEATURE_ELSEWHERE] = {{1.172, 0.915}, {1.982, 1.170}},
    [FEATURE_VAGUE] = {{0.000, 0.348}, {0.000, 0.226}},      [FEATURE_NOT_SHOWN] = {{0.000, 0.000}, {0.000, 0.000}},
    [FEATURE_HIDDEN] = {{0.000, 0.000}, {0.000, 0.513}},     [FEATURE_SPEED] = {{0.345, 0.268}, {0.279, 0.395}},
    [FEATURE_FIT] = {{0.000, 0.000}, {0.000, 0.011}},
};
static const struct decision smoothed_decision = {-0.55, -0.034, 4.322, 0.386};
static const struct kind_weights smoothed_kind[KINDS] = {
    [KIND_HEAD] = {{-3.917, -5.631}, {-12.276, -12.238}},     [KIND_NECK] = {{-3.835, -4.643}, {-12.328, -12.952}},
    [KIND_SHOULDER] = {{-4.845, -5.953}, {-12.985, -12.627}}, [KIND_ELBOW] = {{-6.544, -8.135}, {-12.053, -12.013}},
    [KIND_HAND] = {{-6.348, -8.569}, {-12.226, -11.979}},     [KIND_TORSO] = {{-3.587, -4.782}, {-12.651, -12.816}},
    [KIND_WAIST] = {{-4.421, -5.845}, {-12.476, -13.362}},    [KIND_HIP] = {{-5.055, -5.992}, {-12.564, -13.359}},
    [KIND_KNEE] = {{-6.476, -8.269}, {-11.770, -11.893}},     [KIND_FOOT] = {{-6.028, -9.294}, {-11.557, -12.094}},
};
static const struct feature_weights smoothed_feature[] = {
    [SMOOTHED_ODDS] = {{0.284, 0.254}, {0.226, 0.412}},
    [SMOOTHED_AROUND_ODDS] = {{0.418, 0.371}, {0.493, 0.499}},
    [SMOOTHED_WORSE_ODDS] = {{0.000, 0.000}, {0.000, 0.000}},
    [SMOOTHED_SCALE] = {{0.000, 0.304}, {0.428, 0.000}},
    [SMOOTHED_APART] = {{0.000, 0.271}, {0.328, 0.261}},
    [SMOOTHED_BODY_APART] = {{0.000, 0.000}, {0.000, 0.000}},
    [SMOOTHED_OPEN] = {{0.000, 0.000}, {0.000, 0.737}},
    [SMOOTHED_MOVED] = {{0.000, 0.004}, {0.303, 0.326}},
    [SMOOTHED_OPPOSITE] = {{0.089, 0.401}, {0.000, 0.000}},
    [SMOOTHED_FACING_DOUBT] = {{0.000, 0.000}, {1.200, 0.000}},
    [SMOOTHED_ONE_PASS] = {{2.467, 3.370}, {4.526, 3.996}},
    [SMOOTHED_NOT_SHOWN] = {{0.081, 0.000}, {0.000, 0.004}},
};
