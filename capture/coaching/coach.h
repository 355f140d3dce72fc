// The coach: from what the sensor and the tracker deliver, what to say to the person who films: faults of sensor and
// picture, framing, and what of the body is still unseen; and after a take, a verdict in words. Pure; no allocation; a
// frame costs about a millisecond.
//
//     coach_start, coach_next for each frame of the take, coach_verdict
//
// A fault is raised when it has lasted 0.4 s and taken back when it has been gone as long, so that one bad frame says
// nothing. Times are the frames' own.
#pragma once
#include "base/lens.h"
#include "capture/coaching/coverage.h"
#include "recording/recorded_verdict.h"
#include "recording/skeleton.h"

// ---------------------------------------------------------------- framing

// How the actor stands in the picture, from the mask: cut off at an edge, too near, too far. Pure.

struct framing {
    bool feet_outside, head_outside, side_outside, too_near, too_far;
    double distance_m; // of the trunk, level; 0: unknown
};

struct framing_view {
    const struct calibration *calibration;
    const uint8_t *mask;             // of the depth image
    const struct skeleton *skeleton; // colour camera's axes
};

// ---------------------------------------------------------------- scene watch

// Watches the pictures of a sensor on a stand: another person who comes in, a sensor that was pushed, one that delivers
// the same picture again and again, no depth, bad light. From a coarse grid of depth samples and their background.
// Pure; no allocation; one frame takes some tens of microseconds.
//
// The background is the farthest depth that a grid cell has shown, outside the actor's mask; what stands in front of it
// without moving for three seconds becomes background. Who is in the picture from the first frame on and does not move
// is therefore not noticed.

enum { SCENE_COLUMNS = 80, SCENE_ROWS = 60, SCENE_CELLS = SCENE_COLUMNS * SCENE_ROWS };

struct scene_watch {
    uint16_t background[SCENE_CELLS], last[SCENE_CELLS]; // millimetres; 0: unknown
    uint16_t still[SCENE_CELLS];                         // frames since the cell last changed
    int frames, same_frames, moved_frames;               // of the sensor
};

struct scene_view {
    const struct calibration *calibration;
    const uint8_t *color;  // RGB; NULL: none
    const uint16_t *depth; // millimetres; NULL: none
    const uint8_t *mask;   // not 0: the actor; NULL: no person
    int skipped;           // sensor frames dropped since the previous view
};

struct scene_state {
    bool second_person, pushed, frozen, no_depth, dark, bright;
    double luma; // mean grey level of the actor, else of the picture; -1: no colour
};

void scene_watch_reset(struct scene_watch *watch);

// ---------------------------------------------------------------- pose advice

// What a person should do next so that more of the body is seen: turn, lift the arms, spread the legs, or nothing.
// Pure.
//
// A side that the sensor has not faced yet is asked for by a turn. One that it has faced and yet not seen is hidden by
// the body itself, so that a further turn would not show it: then a pose is asked for, and when that was held before
// the same side, or was not taken for some seconds, no more. What is less than the picture shows is not asked for at
// all.

enum pose_advice {
    ADVICE_ENOUGH,
    ADVICE_TURN_LEFT, // of the person
    ADVICE_TURN_RIGHT,
    ADVICE_LIFT_ARMS,
    ADVICE_SPREAD_LEGS,
    ADVICE_SHOW_SOLES, // where the take shows them: who kneels, lies or kicks
};

struct advisor {
    uint32_t lifted[SURFACE_ANGLES],
        spread[SURFACE_ANGLES]; // as coverage.facing, with the arms lifted, the legs spread
    enum pose_advice last;
    int64_t asked_ns; // since when, for a pose
    bool lift_refused, spread_refused, soles_refused;
    int soles[2]; // how often the left, the right shin lay so that its sole faced the side
};

// After each coverage_add. The answer's reason is in `coverage`: cells unseen.
enum pose_advice advisor_next(struct advisor *advisor, const struct coverage *coverage, const struct skeleton *skeleton,
                              int64_t time_ns);

// ---------------------------------------------------------------- coach

enum coach_fault {
    FAULT_FROZEN,      // the sensor repeats its picture
    FAULT_NO_COLOR,    // of a sensor that has a colour camera
    FAULT_NO_DEPTH,    // hardly a pixel has depth
    FAULT_DEPTH_WRONG, // it contradicts the tags' sizes
    FAULT_SLOW,        // fewer than 20 frames a second
    FAULT_DARK,
    FAULT_BRIGHT,
    FAULT_SENSOR_PUSHED,
    FAULT_SECOND_PERSON,
    FAULT_NO_PERSON,
    FAULT_FEET_OUTSIDE,
    FAULT_HEAD_OUTSIDE,
    FAULT_SIDE_OUTSIDE,
    FAULT_TOO_NEAR,
    FAULT_TOO_FAR,
    FAULT_BLUR, // most of the body moves so fast that the picture is blurred
    FAULT_COUNT
};

const char *coach_fault_text(enum coach_fault fault); // what to do: "step back: your feet are outside the picture"

struct coach_fault_record {
    bool raised;
    int64_t seen_ns, missed_ns; // when the present state began: the fault there, or gone; 0: not
    double first_s, total_s;    // from the take's start; first_s < 0: never raised
    double longest_s, longest_from_s, raised_s;
};

struct coach {
    struct calibration calibration;
    struct coverage coverage;
    struct scene_watch scene;
    struct scene_state said; // by the images that were looked at last, as are the next two
    struct framing framing;
    bool no_color;
    struct advisor advisor;
    struct coach_fault_record fault[FAULT_COUNT];
    enum pose_advice advice;
    enum verdict_purpose purpose; // for comparing no turns and poses are asked for
    int64_t first_ns, last_ns;
    int frames, unread_frames, slow_frames, sensor_moves; // unread: since the last look
    struct skeleton last_skeleton;
    bool has_last;
    double blur_px, luma, distance_m, share;
    char text[160];
};

// Images of a frame that nobody looked at: what those said that were looked at last still holds. The joints count.
enum coach_unread { UNREAD_NONE, UNREAD_COLOR, UNREAD_ALL };

struct coach_frame {
    int64_t time_ns;
    const uint8_t *color;            // RGB; NULL: none
    const uint16_t *depth;           // millimetres; NULL: none
    const uint8_t *mask;             // not 0: the actor; NULL: no person
    const struct skeleton *skeleton; // colour camera's axes; NULL: no person
    int sensor_moves;                // as the recorder counts them
    double step_s;                   // since the frame before it, given or left out; 0: since the last one given
    double depth_scale;              // measured depth over the one that the tags say; 0: not known
    enum coach_unread unread;        // these images are NULL and not missed
};

void coach_start(struct coach *coach, const struct calibration *calibration, enum verdict_purpose purpose);
void coach_next(struct coach *coach, const struct coach_frame *frame);

// The sentence for the frame before: the worst fault, else what to do next, else that all is seen. Never empty.
const char *coach_text(const struct coach *coach);
bool coach_any_fault(const struct coach *coach); // one is raised now

// What the coach saw, in sentences; for the purpose that it was started with.
void coach_verdict(const struct coach *coach, struct take_verdict *out);

// The outline (intersection over union) that the take's picture is expected to have all round; 0: no person.
double coach_grade(const struct coach *coach);
