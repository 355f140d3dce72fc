// How well an attempt matches a reference, as one number. 100: the same movement, by any person, anywhere.
//
// Of every part: the distance of its two directions over the pairs of the alignment (so that what only the reference
// goes through counts, too), with half of their constant offset taken out (it is build, dress and where a sensor puts
// the joints as often as it is posture); its mean by a fifth and its 75th percentile by four fifths: what is wrong for
// a while counts although most is right. Parts weigh by how much the reference moves them, plus 3 degrees: in an
// exercise of the arms the arms matter. Of a reference with repetitions only the movement that these have in common
// counts: what a part does otherwise each time, such as legs that a tracker loses, is not the exercise. The weighted
// mean is the deviation d, and the score is
//
//     100 / (1 + (d / 20 degrees)^1.5)
//
// after the shares of time in which something is missing or added were charged to d, and how unevenly in time the
// attempt goes; of repetitions d is at most the mean of theirs, each against the one that it resembles most, and only
// posture counts. The offset's half, the percentile, its share and the 3 degrees were
// chosen on movements 1 to 5 of UI-PRMD and exercises 1 and 2 of KIMORE, which therefore say little of other movements;
// 20 degrees and 1.5 by hand, so that another healthy person's good attempt has about 75.
#pragma once
#include "compare/difference.h"

struct score_terms {
    double posture_rad;          // d of the aligned frames
    double part_rad[PART_COUNT]; // each part's; NaN where unknown
    double weight[PART_COUNT];   // 0 where unknown
    double missing_share;        // of the reference's moving time
    double extra_share;          // of the attempt's
    double timing_s;             // root mean square of what is early or late beside an even pace
};

double score_from_terms(const struct score_terms *terms); // 0..100; 0 where no part can be compared

// What of B is scored: frames first..end - 1. moved: [PART_COUNT], how much the reference moves each part, rad; NULL:
// as its directions vary over the pairs.
struct score_scope {
    int32_t first, end;
    const double *moved;
};

// posture_rad, part_rad and weight, over the pairs within the scope; the rest of *out is zeroed. ERR_MEMORY.
MUST_CHECK enum status score_posture(const struct movement *a, const struct movement *b, const struct alignment *x,
                                     const struct score_scope *scope, struct score_terms *out);
