// Every repetition of an attempt judged on its own, against the reference's repetitions, or against the reference
// where that is one performance.
#pragma once
#include "compare/repetitions.h"
#include "compare/score.h"

struct judged_repetition {
    struct repetition_span attempt, reference; // frames of B and A
    struct score_terms terms;
    double score;
};

struct judged_repetitions {
    struct judged_repetition *at; // malloc'ed, in B's order
    int32_t count;                // 0: B does not repeat anything
    int32_t reference_count;      // repetitions of A; 1: it is one performance
    double moved[PART_COUNT];     // how much A's repetitions move each part alike, rad; only where there are several
};
void judged_repetitions_free(struct judged_repetitions *r); // zeroed is fine; leaves it zeroed

// Of the reference's repetitions (at most 12 are tried) each of B's is judged against the one that it resembles most.
// prices: of the alignment. ERR_MEMORY; *out is then zeroed.
MUST_CHECK enum status judge_repetitions(const struct movement *a, const struct movement *b, uint16_t parts,
                                         const struct alignment_prices *prices, struct judged_repetitions *out);
