// Written by tools/calibrate_joint_error; see there. Fitted to 160 random films of reenact-bench skeleton --dice 40,
// depth alone: seeds 1001 and 1003 with six motion-capture files as --motions, 1002 and 1004 without.
static const struct decision online_decision = {-2.60, {0.114, 1.254}};
static const struct kind_weights online_kind[KINDS] = {
    [KIND_HEAD] = {{-1.030, -1.678}, {-10.618, -9.560}},    [KIND_NECK] = {{-0.836, -2.245}, {-9.937, -9.167}},
    [KIND_SHOULDER] = {{-2.412, -2.353}, {-8.568, -9.156}}, [KIND_ELBOW] = {{-2.557, -2.572}, {-6.143, -6.817}},
    [KIND_HAND] = {{-1.941, -2.015}, {-5.973, -6.272}},     [KIND_TORSO] = {{-0.861, -2.425}, {-9.496, -9.124}},
    [KIND_WAIST] = {{-0.852, -2.004}, {-9.425, -9.022}},    [KIND_HIP] = {{-1.879, -2.337}, {-8.283, -8.940}},
    [KIND_KNEE] = {{-2.311, -2.615}, {-6.412, -6.025}},     [KIND_FOOT] = {{-1.592, -2.178}, {-6.123, -6.147}},
};
static const struct feature_weights online_feature[] = {
    [FEATURE_ENERGY] = {{0.000, 0.000}, {0.202, 0.000}},      [FEATURE_ENERGY_MEAN] = {{0.000, 0.000}, {0.000, 0.204}},
    [FEATURE_DENSITY] = {{0.000, 0.231}, {1.065, 1.086}},     [FEATURE_RESTART] = {{0.000, 0.000}, {0.091, 0.110}},
    [FEATURE_SHAPE] = {{0.106, 0.000}, {0.734, 0.201}},       [FEATURE_POSTURE] = {{0.192, 0.997}, {1.581, 1.193}},
    [FEATURE_INTRUSION] = {{0.000, 0.000}, {0.000, 0.000}},   [FEATURE_UNEXPLAINED] = {{0.057, 0.892}, {2.387, 2.697}},
    [FEATURE_FLIP] = {{0.000, 0.000}, {1.102, 0.854}},        [FEATURE_BACKWARDS] = {{0.000, 0.530}, {1.170, 1.727}},
    [FEATURE_START] = {{0.080, 0.355}, {1.713, 0.495}},       [FEATURE_SIDEWAYS] = {{0.241, 0.000}, {0.464, 0.000}},
    [FEATURE_BENT] = {{0.745, 0.402}, {1.049, 0.000}},        [FEATURE_TURNED] = {{0.000, 0.000}, {0.000, 0.000}},
    [FEATURE_CROPPED] = {{0.028, 0.135}, {0.071, 0.152}},     [FEATURE_FAR] = {{0.000, 0.000}, {0.226, 0.171}},
    [FEATURE_NEAR] = {{0.000, 0.000}, {0.000, 0.000}},        [FEATURE_SKIRT] = {{0.541, 0.439}, {0.000, 0.000}},
    [FEATURE_ALTERNATIVE] = {{0.000, 0.000}, {0.282, 0.377}}, [FEATURE_MISFIT] = {{0.000, 0.146}, {0.214, 0.718}},
    [FEATURE_STARVED] = {{0.000, 0.207}, {0.487, 1.599}},     [FEATURE_FREE_SPACE] = {{0.000, 0.000}, {0.000, 0.194}},
    [FEATURE_RELOCATED] = {{0.474, 0.322}, {0.151, 0.649}},   [FEATURE_PAIR_NEAR] = {{0.000, 0.000}, {0.000, 0.000}},
    [FEATURE_NOT_SHOWN] = {{0.000, 0.000}, {0.485, 0.000}},   [FEATURE_HIDDEN] = {{0.000, 0.000}, {0.163, 0.487}},
    [FEATURE_SPEED] = {{0.368, 0.218}, {0.000, 0.160}},       [FEATURE_FIT] = {{0.639, 0.189}, {2.197, 0.572}},
};
static const struct decision smoothed_decision = {-1.40, {0.033, 2.413}};
static const struct kind_weights smoothed_kind[KINDS] = {
    [KIND_HEAD] = {{-1.589, -2.075}, {-11.000, -11.309}},     [KIND_NECK] = {{-1.470, -2.544}, {-11.258, -11.128}},
    [KIND_SHOULDER] = {{-2.625, -2.565}, {-11.277, -10.963}}, [KIND_ELBOW] = {{-3.486, -3.687}, {-11.732, -11.866}},
    [KIND_HAND] = {{-3.337, -3.262}, {-11.806, -11.862}},     [KIND_TORSO] = {{-1.780, -2.604}, {-11.050, -11.121}},
    [KIND_WAIST] = {{-1.702, -1.984}, {-11.019, -11.063}},    [KIND_HIP] = {{-2.500, -2.610}, {-11.068, -11.342}},
    [KIND_KNEE] = {{-3.359, -3.782}, {-11.928, -11.468}},     [KIND_FOOT] = {{-3.038, -3.448}, {-11.845, -11.668}},
};
static const struct feature_weights smoothed_feature[] = {
    [SMOOTHED_ODDS] = {{0.000, 0.000}, {0.358, 0.361}},
    [SMOOTHED_AROUND_ODDS] = {{0.000, 0.035}, {0.500, 0.546}},
    [SMOOTHED_WORSE_ODDS] = {{0.000, 0.000}, {0.000, 0.000}},
    [SMOOTHED_SCALE] = {{0.353, 0.515}, {0.000, 0.000}},
    [SMOOTHED_APART] = {{0.375, 0.131}, {0.201, 0.168}},
    [SMOOTHED_BODY_APART] = {{0.060, 0.391}, {0.000, 0.000}},
    [SMOOTHED_OPEN] = {{0.000, 0.000}, {0.000, 0.449}},
    [SMOOTHED_MOVED] = {{0.161, 0.273}, {0.689, 0.768}},
    [SMOOTHED_OPPOSITE] = {{0.000, 0.000}, {0.000, 0.000}},
    [SMOOTHED_FACING_DOUBT] = {{0.762, 1.415}, {1.125, 0.999}},
    [SMOOTHED_ONE_PASS] = {{0.141, 0.630}, {0.902, 0.968}},
    [SMOOTHED_NOT_SHOWN] = {{0.000, 0.026}, {0.000, 0.000}},
};
