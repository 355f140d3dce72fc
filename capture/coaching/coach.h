// The coach: from what the sensor and the tracker deliver, what to say to the person who films: faults of sensor and
// picture, framing, and what of the body is still unseen; and after a take, a verdict in words. Pure; no allocation; a
// frame costs about a millisecond.
//
//     coach_start, coach_next for each frame of the take, coach_verdict
//
// A fault is raised when it has lasted 0.4 s and taken back when it has been gone as long, so that one bad frame says
// nothing. Times are the frames' own.
#pragma once
#include "capture/coaching/framing.h"
#include "capture/coaching/pose_advice.h"
#include "capture/coaching/scene_watch.h"
#include "recording/recorded_verdict.h"

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

void coach_start(struct coach *c, const struct calibration *calibration, enum verdict_purpose purpose);
void coach_next(struct coach *c, const struct coach_frame *frame);

// The sentence for the frame before: the worst fault, else what to do next, else that all is seen. Never empty.
const char *coach_text(const struct coach *c);
bool coach_any_fault(const struct coach *c); // one is raised now

// What the coach saw, in sentences; for the purpose that it was started with.
void coach_verdict(const struct coach *c, struct take_verdict *out);

// The outline (intersection over union) that the take's picture is expected to have all round; 0: no person.
double coach_grade(const struct coach *c);
