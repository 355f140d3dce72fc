// Written by tools/calibrate_joint_error; see there. Fitted to 132 random films of reenact-bench skeleton --seconds 3,
// depth alone: --dice 36 of seeds 1001 and 1003 with six motion-capture files as --motions, of 1002 without; --dice 24
// --postures of 1004.
static const struct decision online_decision = {-1.44, -0.032, 0.845, 0.159};
static const struct kind_weights online_kind[KINDS] = {
    [KIND_HEAD] = {{-2.825, -3.403}, {-12.108, -11.463}},     [KIND_NECK] = {{-2.509, -3.033}, {-11.946, -11.525}},
    [KIND_SHOULDER] = {{-2.634, -3.622}, {-10.199, -10.918}}, [KIND_ELBOW] = {{-3.442, -4.830}, {-7.203, -7.743}},
    [KIND_HAND] = {{-2.772, -4.827}, {-7.090, -6.725}},       [KIND_TORSO] = {{-2.329, -3.299}, {-11.407, -11.637}},
    [KIND_WAIST] = {{-2.420, -3.839}, {-10.706, -11.412}},    [KIND_HIP] = {{-2.514, -3.366}, {-9.921, -11.399}},
    [KIND_KNEE] = {{-3.540, -5.427}, {-7.662, -7.605}},       [KIND_FOOT] = {{-3.157, -5.879}, {-7.473, -7.679}},
};
static const struct feature_weights online_feature[] = {
    [FEATURE_ENERGY] = {{0.131, 0.000}, {0.955, 0.075}},     [FEATURE_ENERGY_MEAN] = {{0.000, 0.143}, {0.000, 0.000}},
    [FEATURE_DENSITY] = {{0.617, 0.528}, {0.878, 0.630}},    [FEATURE_NO_PERSON] = {{13.707, 9.106}, {21.798, 30.522}},
    [FEATURE_SHAPE] = {{0.220, 0.063}, {0.407, 0.000}},      [FEATURE_POSTURE] = {{0.119, 0.278}, {0.000, 0.152}},
    [FEATURE_INTRUSION] = {{0.066, 0.000}, {0.178, 0.000}},  [FEATURE_UNEXPLAINED] = {{1.489, 0.296}, {0.000, 0.666}},
    [FEATURE_FLIP] = {{2.750, 3.731}, {3.962, 2.711}},       [FEATURE_BACKWARDS] = {{0.754, 0.182}, {1.410, 0.844}},
    [FEATURE_START] = {{0.073, 0.000}, {0.018, 0.000}},      [FEATURE_SIDEWAYS] = {{0.000, 0.000}, {0.000, 0.000}},
    [FEATURE_BENT] = {{0.000, 0.017}, {0.000, 0.000}},       [FEATURE_TURNED] = {{0.000, 0.000}, {0.000, 0.000}},
    [FEATURE_CROPPED] = {{0.109, 0.575}, {0.649, 0.251}},    [FEATURE_FAR] = {{0.130, 0.520}, {1.097, 0.070}},
    [FEATURE_NEAR] = {{0.540, 0.808}, {0.525, 0.000}},       [FEATURE_SKIRT] = {{0.000, 0.000}, {0.000, 0.000}},
    [FEATURE_MISFIT] = {{0.000, 0.000}, {0.000, 0.651}},     [FEATURE_STARVED] = {{0.501, 1.656}, {0.475, 2.729}},
    [FEATURE_FREE_SPACE] = {{0.031, 0.570}, {0.059, 0.549}}, [FEATURE_RELOCATED] = {{0.182, 0.498}, {0.000, 0.415}},
    [FEATURE_PAIR_NEAR] = {{0.000, 0.130}, {0.000, 0.000}},  [FEATURE_ELSEWHERE] = {{1.411, 0.993}, {2.067, 1.268}},
    [FEATURE_VAGUE] = {{0.096, 0.498}, {0.170, 0.329}},      [FEATURE_NOT_SHOWN] = {{0.000, 0.000}, {0.000, 0.000}},
    [FEATURE_HIDDEN] = {{0.000, 0.000}, {0.000, 0.501}},     [FEATURE_SPEED] = {{0.019, 0.170}, {0.518, 0.295}},
    [FEATURE_FIT] = {{0.507, 0.000}, {0.094, 0.004}},
};
static const struct decision smoothed_decision = {0.11, 0.011, 1.010, 0.138};
static const struct kind_weights smoothed_kind[KINDS] = {
    [KIND_HEAD] = {{-3.996, -4.492}, {-13.853, -13.880}},     [KIND_NECK] = {{-3.809, -4.350}, {-13.909, -14.270}},
    [KIND_SHOULDER] = {{-4.263, -4.791}, {-13.283, -13.697}}, [KIND_ELBOW] = {{-5.418, -6.713}, {-11.514, -11.784}},
    [KIND_HAND] = {{-5.210, -6.725}, {-11.888, -11.586}},     [KIND_TORSO] = {{-3.775, -4.330}, {-13.700, -13.544}},
    [KIND_WAIST] = {{-3.921, -4.443}, {-13.592, -14.011}},    [KIND_HIP] = {{-4.213, -4.451}, {-13.257, -13.995}},
    [KIND_KNEE] = {{-5.357, -6.479}, {-11.490, -11.445}},     [KIND_FOOT] = {{-5.217, -7.290}, {-11.496, -11.573}},
};
static const struct feature_weights smoothed_feature[] = {
    [SMOOTHED_ODDS] = {{0.051, 0.092}, {0.230, 0.383}},
    [SMOOTHED_AROUND_ODDS] = {{0.194, 0.165}, {0.476, 0.467}},
    [SMOOTHED_WORSE_ODDS] = {{0.000, 0.000}, {0.000, 0.000}},
    [SMOOTHED_SCALE] = {{0.550, 0.704}, {0.680, 0.073}},
    [SMOOTHED_APART] = {{0.000, 0.539}, {0.000, 0.193}},
    [SMOOTHED_BODY_APART] = {{0.179, 0.000}, {0.000, 0.000}},
    [SMOOTHED_OPEN] = {{0.000, 0.000}, {0.000, 0.554}},
    [SMOOTHED_MOVED] = {{0.191, 0.290}, {0.906, 0.820}},
    [SMOOTHED_OPPOSITE] = {{0.244, 0.000}, {0.000, 0.000}},
    [SMOOTHED_FACING_DOUBT] = {{0.000, 0.000}, {2.498, 1.535}},
    [SMOOTHED_ONE_PASS] = {{2.838, 2.707}, {1.160, 0.000}},
    [SMOOTHED_NOT_SHOWN] = {{0.000, 0.000}, {0.000, 0.008}},
};
