// Written by tools/calibrate_joint_error; see there. Fitted to random films of reenact-bench skeleton --dice 20, seeds
// 1001 to 1004, with and without --motions.
#define ONLINE_LIMIT (-3.36)
static const struct kind_weights online_kind[KINDS] = {
    [KIND_HEAD] = {{-2.701, -3.241}, {-10.644, -8.713}},    [KIND_NECK] = {{-2.557, -2.580}, {-9.516, -8.670}},
    [KIND_SHOULDER] = {{-1.483, -3.245}, {-8.373, -8.592}}, [KIND_ELBOW] = {{-1.632, -4.337}, {-5.662, -6.142}},
    [KIND_HAND] = {{-0.925, -4.124}, {-5.310, -5.495}},     [KIND_TORSO] = {{-1.990, -2.975}, {-8.883, -8.833}},
    [KIND_WAIST] = {{-2.136, -1.758}, {-8.760, -8.366}},    [KIND_HIP] = {{-1.808, -3.539}, {-7.792, -8.822}},
    [KIND_KNEE] = {{-2.484, -4.573}, {-5.793, -5.724}},     [KIND_FOOT] = {{-2.512, -4.682}, {-5.655, -5.375}},
};
static const struct feature_weights online_feature[] = {
    [FEATURE_ENERGY] = {{0.616, 0.548}, {0.573, 0.193}},      [FEATURE_ENERGY_MEAN] = {{0.000, 0.000}, {0.000, 0.157}},
    [FEATURE_DENSITY] = {{1.105, 0.733}, {1.174, 1.250}},     [FEATURE_CHALLENGE] = {{0.869, 0.715}, {0.799, 0.227}},
    [FEATURE_SHAPE] = {{0.579, 0.375}, {0.836, 0.163}},       [FEATURE_POSTURE] = {{0.111, 0.406}, {0.947, 0.670}},
    [FEATURE_INTRUSION] = {{0.086, 0.078}, {0.000, 0.000}},   [FEATURE_UNEXPLAINED] = {{0.000, 0.000}, {0.091, 0.357}},
    [FEATURE_FLIP] = {{0.554, 0.872}, {1.080, 1.000}},        [FEATURE_BACKWARDS] = {{0.210, 0.850}, {1.190, 1.610}},
    [FEATURE_START] = {{1.206, 1.497}, {0.249, 0.002}},       [FEATURE_SIDEWAYS] = {{0.207, 0.694}, {0.338, 0.094}},
    [FEATURE_BENT] = {{1.554, 1.537}, {1.581, 0.000}},        [FEATURE_TURNED] = {{0.000, 0.000}, {1.275, 0.000}},
    [FEATURE_CROPPED] = {{0.678, 1.144}, {0.070, 0.162}},     [FEATURE_FAR] = {{0.201, 0.474}, {0.185, 0.231}},
    [FEATURE_NEAR] = {{3.045, 0.000}, {0.000, 0.000}},        [FEATURE_SKIRT] = {{0.000, 0.000}, {0.000, 0.000}},
    [FEATURE_ALTERNATIVE] = {{0.037, 0.328}, {0.427, 0.382}}, [FEATURE_MISFIT] = {{0.427, 0.000}, {0.207, 0.926}},
    [FEATURE_STARVED] = {{0.531, 1.559}, {0.628, 1.458}},     [FEATURE_FREE_SPACE] = {{0.123, 0.459}, {0.019, 0.245}},
    [FEATURE_RELOCATED] = {{0.000, 0.000}, {0.000, 0.573}},   [FEATURE_PAIR_NEAR] = {{0.384, 0.233}, {0.000, 0.000}},
    [FEATURE_NOT_SHOWN] = {{0.469, 0.000}, {0.569, 0.000}},   [FEATURE_HIDDEN] = {{0.000, 0.000}, {0.209, 0.591}},
    [FEATURE_SPEED] = {{0.000, 0.000}, {0.000, 0.000}},       [FEATURE_FIT] = {{0.378, 0.000}, {1.799, 0.421}},
};
#define SMOOTHED_LIMIT (-3.44)
static const struct kind_weights smoothed_kind[KINDS] = {
    [KIND_HEAD] = {{-4.551, -5.381}, {-11.933, -11.857}},     [KIND_NECK] = {{-4.817, -6.048}, {-12.105, -11.816}},
    [KIND_SHOULDER] = {{-4.564, -6.146}, {-11.958, -11.299}}, [KIND_ELBOW] = {{-6.345, -7.598}, {-12.588, -12.741}},
    [KIND_HAND] = {{-6.128, -8.049}, {-12.659, -12.757}},     [KIND_TORSO] = {{-4.713, -4.947}, {-12.018, -11.521}},
    [KIND_WAIST] = {{-4.819, -3.972}, {-12.085, -11.918}},    [KIND_HIP] = {{-4.986, -5.757}, {-11.734, -11.829}},
    [KIND_KNEE] = {{-7.050, -7.746}, {-12.685, -12.265}},     [KIND_FOOT] = {{-6.730, -9.040}, {-12.619, -12.492}},
};
static const struct feature_weights smoothed_feature[] = {
    [SMOOTHED_ODDS] = {{0.110, 0.165}, {0.384, 0.450}},
    [SMOOTHED_WORSE_ODDS] = {{0.000, 0.000}, {0.000, 0.000}},
    [SMOOTHED_SCALE] = {{0.616, 0.872}, {0.341, 0.041}},
    [SMOOTHED_APART] = {{0.154, 0.127}, {0.074, 0.077}},
    [SMOOTHED_BODY_APART] = {{0.456, 0.419}, {0.000, 0.000}},
    [SMOOTHED_OPEN] = {{0.000, 0.000}, {0.000, 0.723}},
    [SMOOTHED_MOVED] = {{0.000, 0.281}, {0.006, 0.502}},
    [SMOOTHED_OPPOSITE] = {{0.262, 0.000}, {0.048, 0.000}},
    [SMOOTHED_FACING_DOUBT] = {{0.131, 1.229}, {0.959, 0.696}},
    [SMOOTHED_ONE_PASS] = {{0.698, 0.606}, {0.933, 0.710}},
    [SMOOTHED_NOT_SHOWN] = {{0.000, 0.000}, {0.000, 0.000}},
    [SMOOTHED_AROUND_ODDS] = {{0.172, 0.140}, {0.342, 0.517}},
};
