// What the files of the findings share.
#pragma once
#include "compare/findings.h"

// Appends; times in frames. `sentence` without its times, which are added where `timed`. ERR_MEMORY.
MUST_CHECK enum status finding_add(struct comparison *c, const struct finding *f, bool timed);

MUST_CHECK enum status find_postures(struct comparison *c); // posture, range and a limb's timing
MUST_CHECK enum status find_pieces(struct comparison *c);   // missing, extra, pauses, pace, repetitions, mirrored
