// Why a take shows no person, or one that cannot be: depth that is mirrored against colour, in another unit, with its
// bytes swapped, inverted, or disparity; a sensor that hangs upside down, lies on its side or looks straight down.
//
// Method: where few frames have a person, some frames are read as each of these would have made them, and tracked again
// from depth alone. A person of a human size, who moves as people do, then appears under the likely cause and under no
// other. Where a person was found, his or her stature is judged by the lengths of the bones, whatever the posture.
#pragma once
#include "locate/stream_turn.h"
#include "recording/recorded_verdict.h"

enum depth_cause {
    CAUSE_NONE,
    CAUSE_TURNED, // depth against colour, by `turn`
    CAUSE_UNIT,   // the depth is `factor` times what it should be
    CAUSE_NOTHING_IN_REACH,
    CAUSE_BYTES_SWAPPED,
    CAUSE_INVERTED,
    CAUSE_DISPARITY,
    CAUSE_UPSIDE_DOWN,
    CAUSE_ON_ITS_SIDE,
    CAUSE_FROM_ABOVE,
};

struct depth_finding {
    enum depth_cause cause;
    enum depth_turn turn;
    double factor;    // of CAUSE_UNIT, nominal: 5, 0.5 ...; 0: not known which
    double stature_m; // of the person as tracked, median; 0: none
};

// Reads at most 36 frames; where no person was tracked, tracks them a dozen times: some seconds. A damaged frame is
// left out. ERR_IO, ERR_MEMORY.
MUST_CHECK enum status depth_cause_find(struct take *take, struct depth_finding *out);

// The likely cause, and what to do.
void depth_cause_say(const struct depth_finding *finding, struct take_verdict *out);
