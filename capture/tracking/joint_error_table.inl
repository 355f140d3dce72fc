// Written by tools/calibrate_joint_error; see there. Fitted to random films of reenact-bench skeleton --dice 20: seeds
// 1001 and 1002 with and without --motions, 1003 with, 1004 without.
static const struct decision online_decision = {-3.21, {-0.195, 1.340}};
static const struct kind_weights online_kind[KINDS] = {
    [KIND_HEAD] = {{-1.988, -1.845}, {-9.569, -7.879}},     [KIND_NECK] = {{-1.710, -1.667}, {-8.718, -7.849}},
    [KIND_SHOULDER] = {{-0.190, -2.134}, {-7.327, -7.604}}, [KIND_ELBOW] = {{-0.031, -2.795}, {-5.556, -6.199}},
    [KIND_HAND] = {{0.446, -2.617}, {-5.314, -5.505}},      [KIND_TORSO] = {{-1.320, -1.735}, {-8.320, -7.856}},
    [KIND_WAIST] = {{-1.493, -1.910}, {-8.204, -7.644}},    [KIND_HIP] = {{-1.294, -2.352}, {-7.042, -7.931}},
    [KIND_KNEE] = {{-1.554, -3.385}, {-5.982, -5.852}},     [KIND_FOOT] = {{-1.303, -3.478}, {-5.710, -5.719}},
};
static const struct feature_weights online_feature[] = {
    [FEATURE_ENERGY] = {{0.289, 0.055}, {0.608, 0.268}},      [FEATURE_ENERGY_MEAN] = {{0.000, 0.000}, {0.000, 0.345}},
    [FEATURE_DENSITY] = {{1.173, 0.991}, {1.139, 1.098}},     [FEATURE_RESTART] = {{0.451, 0.707}, {1.014, 0.587}},
    [FEATURE_SHAPE] = {{0.186, 0.098}, {0.613, 0.114}},       [FEATURE_POSTURE] = {{0.317, 0.904}, {0.609, 0.511}},
    [FEATURE_INTRUSION] = {{0.000, 0.000}, {0.000, 0.000}},   [FEATURE_UNEXPLAINED] = {{0.971, 0.000}, {0.000, 0.000}},
    [FEATURE_FLIP] = {{0.656, 0.979}, {1.375, 1.156}},        [FEATURE_BACKWARDS] = {{0.982, 0.840}, {1.403, 1.748}},
    [FEATURE_START] = {{0.767, 0.153}, {0.704, 0.134}},       [FEATURE_SIDEWAYS] = {{0.047, 0.207}, {0.000, 0.000}},
    [FEATURE_BENT] = {{1.859, 0.257}, {1.988, 0.142}},        [FEATURE_TURNED] = {{0.275, 0.542}, {0.499, 0.000}},
    [FEATURE_CROPPED] = {{0.243, 0.309}, {0.131, 0.248}},     [FEATURE_FAR] = {{0.133, 0.240}, {0.156, 0.235}},
    [FEATURE_NEAR] = {{0.266, 0.000}, {0.000, 0.000}},        [FEATURE_SKIRT] = {{0.000, 0.009}, {0.000, 0.000}},
    [FEATURE_ALTERNATIVE] = {{0.507, 0.399}, {0.392, 0.300}}, [FEATURE_MISFIT] = {{0.000, 0.000}, {0.000, 0.971}},
    [FEATURE_STARVED] = {{0.724, 1.379}, {0.896, 1.914}},     [FEATURE_FREE_SPACE] = {{0.061, 0.495}, {0.000, 0.339}},
    [FEATURE_RELOCATED] = {{0.000, 0.162}, {0.000, 0.346}},   [FEATURE_PAIR_NEAR] = {{0.000, 0.000}, {0.000, 0.000}},
    [FEATURE_NOT_SHOWN] = {{0.000, 0.000}, {0.564, 0.000}},   [FEATURE_HIDDEN] = {{0.000, 0.000}, {0.244, 0.609}},
    [FEATURE_SPEED] = {{0.000, 0.000}, {0.000, 0.000}},       [FEATURE_FIT] = {{0.335, 0.000}, {1.245, 0.276}},
};
static const struct decision smoothed_decision = {-3.58, {-0.017, 2.000}};
static const struct kind_weights smoothed_kind[KINDS] = {
    [KIND_HEAD] = {{-4.444, -5.362}, {-11.249, -11.180}},     [KIND_NECK] = {{-4.532, -5.719}, {-11.424, -10.980}},
    [KIND_SHOULDER] = {{-4.035, -6.009}, {-11.396, -10.570}}, [KIND_ELBOW] = {{-6.205, -7.690}, {-11.805, -11.951}},
    [KIND_HAND] = {{-6.290, -8.336}, {-11.830, -11.854}},     [KIND_TORSO] = {{-4.196, -5.307}, {-11.267, -11.074}},
    [KIND_WAIST] = {{-4.397, -5.123}, {-11.275, -10.966}},    [KIND_HIP] = {{-4.529, -5.711}, {-10.963, -11.100}},
    [KIND_KNEE] = {{-6.631, -7.920}, {-11.857, -11.485}},     [KIND_FOOT] = {{-6.516, -8.599}, {-11.795, -11.571}},
};
static const struct feature_weights smoothed_feature[] = {
    [SMOOTHED_ODDS] = {{0.116, 0.143}, {0.218, 0.385}},
    [SMOOTHED_AROUND_ODDS] = {{0.198, 0.214}, {0.388, 0.527}},
    [SMOOTHED_WORSE_ODDS] = {{0.000, 0.000}, {0.000, 0.000}},
    [SMOOTHED_SCALE] = {{0.417, 0.767}, {0.428, 0.033}},
    [SMOOTHED_APART] = {{0.362, 0.200}, {0.208, 0.101}},
    [SMOOTHED_BODY_APART] = {{0.650, 0.420}, {0.000, 0.000}},
    [SMOOTHED_OPEN] = {{0.000, 0.000}, {0.000, 0.451}},
    [SMOOTHED_MOVED] = {{0.281, 0.171}, {0.109, 0.441}},
    [SMOOTHED_OPPOSITE] = {{0.000, 0.000}, {0.000, 0.000}},
    [SMOOTHED_FACING_DOUBT] = {{0.000, 0.000}, {0.742, 0.594}},
    [SMOOTHED_ONE_PASS] = {{2.260, 0.986}, {0.987, 0.328}},
    [SMOOTHED_NOT_SHOWN] = {{0.000, 0.000}, {0.000, 0.005}},
};
