// Written by tools/calibrate_joint_error; see there. Fitted to 160 random films of reenact-bench skeleton --dice 40,
// depth alone: seeds 1001 and 1003 with six motion-capture files as --motions, 1002 and 1004 without.
static const struct decision online_decision = {-2.81, -0.138, 0.343, 0.137};
static const struct kind_weights online_kind[KINDS] = {
    [KIND_HEAD] = {{-3.029, -3.229}, {-10.354, -9.316}},    [KIND_NECK] = {{-2.683, -3.219}, {-9.711, -8.903}},
    [KIND_SHOULDER] = {{-2.213, -3.667}, {-8.323, -8.930}}, [KIND_ELBOW] = {{-0.567, -3.270}, {-6.113, -6.771}},
    [KIND_HAND] = {{-0.021, -3.176}, {-5.945, -6.232}},     [KIND_TORSO] = {{-2.455, -3.030}, {-9.302, -8.875}},
    [KIND_WAIST] = {{-2.634, -2.502}, {-9.182, -8.834}},    [KIND_HIP] = {{-2.910, -3.437}, {-8.055, -8.719}},
    [KIND_KNEE] = {{-2.238, -3.686}, {-6.402, -6.015}},     [KIND_FOOT] = {{-1.441, -4.093}, {-6.106, -6.170}},
};
static const struct feature_weights online_feature[] = {
    [FEATURE_ENERGY] = {{0.245, 0.000}, {0.157, 0.037}},      [FEATURE_ENERGY_MEAN] = {{0.000, 0.000}, {0.000, 0.048}},
    [FEATURE_DENSITY] = {{0.730, 0.915}, {1.034, 1.058}},     [FEATURE_RESTART] = {{0.000, 0.000}, {0.057, 0.130}},
    [FEATURE_SHAPE] = {{0.180, 0.000}, {0.643, 0.221}},       [FEATURE_POSTURE] = {{1.400, 1.711}, {1.567, 1.241}},
    [FEATURE_INTRUSION] = {{0.000, 0.000}, {0.000, 0.000}},   [FEATURE_UNEXPLAINED] = {{1.686, 2.889}, {2.615, 2.795}},
    [FEATURE_FLIP] = {{1.185, 0.955}, {1.100, 0.873}},        [FEATURE_BACKWARDS] = {{0.099, 0.319}, {1.049, 1.832}},
    [FEATURE_START] = {{1.577, 0.925}, {1.612, 0.543}},       [FEATURE_SIDEWAYS] = {{0.526, 0.415}, {0.512, 0.000}},
    [FEATURE_BENT] = {{0.484, 0.000}, {0.997, 0.000}},        [FEATURE_TURNED] = {{0.000, 0.000}, {0.000, 0.000}},
    [FEATURE_CROPPED] = {{0.048, 0.047}, {0.089, 0.158}},     [FEATURE_FAR] = {{0.000, 0.005}, {0.182, 0.149}},
    [FEATURE_NEAR] = {{0.421, 0.000}, {0.000, 0.000}},        [FEATURE_SKIRT] = {{0.323, 0.495}, {0.000, 0.000}},
    [FEATURE_ALTERNATIVE] = {{0.504, 0.445}, {0.302, 0.346}}, [FEATURE_MISFIT] = {{0.000, 0.000}, {0.178, 0.695}},
    [FEATURE_STARVED] = {{0.508, 1.656}, {0.515, 1.603}},     [FEATURE_FREE_SPACE] = {{0.003, 0.436}, {0.000, 0.206}},
    [FEATURE_RELOCATED] = {{0.059, 0.269}, {0.152, 0.646}},   [FEATURE_PAIR_NEAR] = {{0.355, 0.000}, {0.000, 0.000}},
    [FEATURE_NOT_SHOWN] = {{0.000, 0.000}, {0.507, 0.000}},   [FEATURE_HIDDEN] = {{0.000, 0.000}, {0.138, 0.478}},
    [FEATURE_SPEED] = {{0.813, 0.239}, {0.149, 0.195}},       [FEATURE_FIT] = {{0.915, 0.000}, {2.101, 0.570}},
};
static const struct decision smoothed_decision = {-3.49, -0.026, -0.026, 0.308};
static const struct kind_weights smoothed_kind[KINDS] = {
    [KIND_HEAD] = {{-4.647, -6.310}, {-11.757, -11.777}},     [KIND_NECK] = {{-4.487, -5.853}, {-11.982, -11.549}},
    [KIND_SHOULDER] = {{-4.854, -6.045}, {-11.935, -11.331}}, [KIND_ELBOW] = {{-5.504, -7.230}, {-11.831, -11.837}},
    [KIND_HAND] = {{-5.123, -7.601}, {-11.908, -11.754}},     [KIND_TORSO] = {{-4.306, -5.441}, {-11.829, -11.527}},
    [KIND_WAIST] = {{-4.483, -5.062}, {-11.765, -11.546}},    [KIND_HIP] = {{-4.702, -5.912}, {-11.639, -11.747}},
    [KIND_KNEE] = {{-6.172, -7.390}, {-12.038, -11.364}},     [KIND_FOOT] = {{-5.981, -8.228}, {-11.940, -11.535}},
};
static const struct feature_weights smoothed_feature[] = {
    [SMOOTHED_ODDS] = {{0.116, 0.123}, {0.198, 0.310}},
    [SMOOTHED_AROUND_ODDS] = {{0.160, 0.181}, {0.472, 0.552}},
    [SMOOTHED_WORSE_ODDS] = {{0.000, 0.000}, {0.000, 0.000}},
    [SMOOTHED_SCALE] = {{0.495, 0.699}, {0.380, 0.077}},
    [SMOOTHED_APART] = {{0.264, 0.217}, {0.248, 0.174}},
    [SMOOTHED_BODY_APART] = {{0.815, 0.514}, {0.000, 0.000}},
    [SMOOTHED_OPEN] = {{0.000, 0.000}, {0.000, 0.506}},
    [SMOOTHED_MOVED] = {{0.228, 0.419}, {0.603, 0.774}},
    [SMOOTHED_OPPOSITE] = {{0.000, 0.000}, {0.000, 0.000}},
    [SMOOTHED_FACING_DOUBT] = {{0.000, 0.000}, {0.952, 1.009}},
    [SMOOTHED_ONE_PASS] = {{2.233, 2.105}, {1.046, 0.993}},
    [SMOOTHED_NOT_SHOWN] = {{0.000, 0.000}, {0.000, 0.000}},
};
