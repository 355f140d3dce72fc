// Findings of a comparison in plain English, worst first, kinds kept apart: a slow pupil does not read that the elbow
// is wrong.
//
//   posture   a joint or part is held differently. Judged joint by joint, each against the part that carries it (thighs
//             against the hips, a forearm against the upper arm), so that a leaning trunk is one finding and not five.
//   range     a joint goes through less than in the reference, otherwise alike
//   timing    a limb early or late beside the rest of the body; the pace; pauses
//   missing, extra   a piece, a turn or repetitions
//   mirrored  the other side was used
//
// An arm's or leg's posture is judged at the limb's own time: where shifting it by up to 0.5 s explains much of the
// difference, the finding is the lateness, and only what remains is posture. A posture is held: what lasts less than a
// third of a second, in either movement, is taken for the tracker's mistake.
//
// One cause is one finding: both sides alike, and a knee with its hip, are joined; a limb that moves less, or further,
// is neither late nor early. What the score lacks (score.h) is shared among the findings as their `loss`: what the
// parts they name cost, and what a finding costs beside, because parts cost by their means over the whole movement.
#pragma once
#include "compare/comparison.h"

// ---------------------------------------------------------------- not judged

// What a comparison says nothing of, because its joints are not there.

// "could not be judged: the knees are not in the attempt; the head is hardly ever in the reference". "": all parts
// were.
enum { NOT_JUDGED_BYTES = 600 };
const char *not_judged_text(const struct comparison *comparison, char out[NOT_JUDGED_BYTES]);

// ---------------------------------------------------------------- findings

const char *finding_kind_name(enum finding_kind kind);
const char *part_name(enum part part); // "left_forearm"
int part_by_name(const char *name);    // -1: no part's name, as "body"
// The part of the reference that the attempt's own is judged against: another one where it was mirrored. -1: -1.
int judged_part(const struct comparison *comparison, int part);
// The instant of the attempt, s, at which the finding's part differs most; the finding's middle where it names none.
double finding_worst_s(const struct comparison *comparison, const struct finding *finding);

// Fills c->findings from the rest of *c. ERR_MEMORY.
MUST_CHECK enum status findings_make(struct comparison *c);
