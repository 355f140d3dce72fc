#include "capture/tracking/joint_error.h"

static const char *const feature_names[FEATURE_COUNT] = {
    "energy",    "energy_mean", "unexplained", "flip",   "backwards",   "start",  "sideways", "bent",
    "cropped",   "far",         "near",        "skirt",  "alternative", "misfit", "starved",  "free_space",
    "relocated", "pair_near",   "not_shown",   "hidden", "speed",       "fit",
};
static const char *const smoothed_names[SMOOTHED_COUNT] = {
    "odds",  "worse_odds", "scale",        "apart",    "body_apart", "open",
    "moved", "opposite",   "facing_doubt", "one_pass", "not_shown",
};

const char *joint_feature_name(enum joint_feature f) { return feature_names[f]; }
const char *smoothed_feature_name(enum smoothed_feature f) { return smoothed_names[f]; }

struct joint_error joint_error_online(enum joint j, bool shown, const struct joint_features *f)
{
    (void)j;
    (void)shown;
    (void)f;
    return (struct joint_error){0, -10};
}

struct joint_error joint_error_smoothed(enum joint j, bool shown, const struct smoothed_features *f)
{
    (void)j;
    (void)shown;
    (void)f;
    return (struct joint_error){0, -10};
}

bool joint_error_is_seen(const struct joint_error *e) { return e->wrong_log_odds < -4.6F; }
