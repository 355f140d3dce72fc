#define ONLINE_LIMIT (-4.6)
#define SMOOTHED_LIMIT (-4.6)
static const struct kind_weights online_kind[KINDS] = {{{0, 0}, {0, 0}}};
static const struct feature_weights online_feature[FEATURE_COUNT] = {{{0, 0}, {0, 0}}};
static const struct kind_weights smoothed_kind[KINDS] = {{{0, 0}, {0, 0}}};
static const struct feature_weights smoothed_feature[SMOOTHED_COUNT] = {{{0, 0}, {0, 0}}};
