// A stretch of a motion, performed otherwise than the motion says, in a known way: what a comparison of two movements
// has to find.
#pragma once

enum world_edit_kind {
    EDIT_NONE,
    EDIT_TEMPO,   // `amount` times as fast, and unevenly: up to 0.12 s ahead or behind
    EDIT_PAUSE,   // stands still for `amount` seconds at from_s
    EDIT_LATE,    // the right arm comes `amount` seconds late
    EDIT_MISSING, // what lies between from_s and to_s is left out, bridged within 0.2 s
    EDIT_EXTRA,   // at from_s the figure stops and raises both arms sideways and lowers them again, in `amount` seconds
    EDIT_RANGE,   // the arms swing and the trunk sinks `amount` times as far about their means
    EDIT_MIRRORED,
    // Between from_s and to_s, by `amount` degrees:
    EDIT_LEFT_ELBOW, // more bent
    EDIT_RIGHT_ELBOW,
    EDIT_LEFT_ARM, // the upper arm lower, at most hanging
    EDIT_RIGHT_ARM,
    EDIT_LEFT_KNEE, // more bent; the ankle comes nearer to the hip
    EDIT_RIGHT_KNEE,
    EDIT_LEAN, // the trunk above the pelvis further forwards
    EDIT_KINDS
};
const char *world_edit_name(enum world_edit_kind kind); // "left elbow"

// Seconds. from_s and to_s count from the stretch's start; a posture comes and goes within 0.3 s of them.
struct world_edit {
    enum world_edit_kind kind;
    double start_s, seconds; // the stretch: what is before and after it in the motion is not performed
    double from_s, to_s;
    double amount;
};

double world_edit_seconds(const struct world_edit *e); // how long the performance lasts

// The instant of the stretch that the performance shows at `time_s`. NaN: none, something is added there.
double world_edit_reference_s(const struct world_edit *e, double time_s);
