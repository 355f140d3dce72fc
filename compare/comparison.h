// Two movements compared: a reference A and an attempt B. What the command prints, and the app will show.
#pragma once
#include "compare/expectation.h"
#include "compare/movement.h"
#include "compare/pace.h"
#include "compare/repetitions.h"
#include "compare/score.h"

enum finding_kind { FINDING_POSTURE, FINDING_RANGE, FINDING_TIMING, FINDING_MISSING, FINDING_EXTRA, FINDING_MIRRORED };

// Which sides of the body a finding is about, as the attempt's own.
enum body_side { SIDE_NONE, SIDE_LEFT, SIDE_RIGHT, SIDE_BOTH };

// What a teacher would say, of one cause. Times are B's, except of a missing piece, where they are the reference's.
struct finding {
    enum finding_kind kind;
    const char *part; // a part's name, or "body"; of several parts the one that differs most
    uint16_t parts;   // all that it is about, as judged; 0: the whole body
    enum body_side side;
    const char *noun; // "elbow", or NULL: the sentence says all
    double from_s, to_s;
    double amount;      // signed as the sentence says
    const char *unit;   // "deg", "s", "%", "times"
    double cost;        // 0..1, beside what the parts' deviations cost (score.h)
    double loss;        // points of 100 that the score loses by it, worst first
    bool timed;         // the sentence says from when to when
    char predicate[96]; // behind the noun
    char sentence[160];
};

// Whether the two are the same movement at all; only then there is a score.
enum relation {
    RELATION_SAME,
    RELATION_OTHER, // another movement
    RELATION_MOVED, // the reference holds still, the attempt moves
    RELATION_STILL, // the reference moves, the attempt holds still
    RELATION_PART   // only a part of the reference was done, or much was done beside it
};

struct comparison {
    struct movement a, b;        // as they are; `b` is never mirrored
    struct expectation expected; // what counts; zeroed: everything, by the natural spreads
    struct tolerances by;        // the same as numbers
    uint16_t parts;              // known in both, and not ignored
    // The frames that count, of A and of `judged`: all, or where a stretch is expected that stretch and what of the
    // attempt shows it. All else is aligned with nothing.
    struct repetition_span counted_a, counted_b;
    bool mirrored;              // B resembles A's mirror image far more than A: it was judged as that
    struct movement judged;     // B, mirrored if `mirrored`; else it has b's frames
    struct alignment alignment; // of a and judged
    struct timeline timeline;
    struct pace pace;
    struct performances repetitions;
    struct similarity similarity; // over all aligned pairs
    double judged_share[2];       // of what A moves, of what B moves: how much lies in what is aligned
    enum relation relation;
    char relation_sentence[160]; // of what is not the same; else ""
    struct score_terms terms;
    double score_sigma;       // of the score for the joints' errors, points, score.h; NaN: unknown; 0 without a score
    double score;             // 0 where the relation is not RELATION_SAME: it says nothing then
    struct finding *findings; // malloc'ed, worst first; none where the relation is not RELATION_SAME
    int32_t finding_count;
    struct angle_range range_a[BODY_ANGLES], range_b[BODY_ANGLES]; // over what is aligned; B's as judged
};

const char *relation_name(enum relation relation); // "same", "other", "moved", "still", "part"

// Takes over both movements, also on failure. expected: NULL: everything counts. ERR_INPUT: no part that matters is
// known in both, or the stretch is not in the reference. ERR_MEMORY. On failure *out is zeroed. Pure; two threads may
// compare at the same time.
MUST_CHECK enum status comparison_make(struct movement *a, struct movement *b, const struct expectation *expected,
                                       struct comparison *out);
// part_differences of the reference and `b`, which is c->b or c->judged, by what is expected: parts that do not matter
// are unknown.
static inline void comparison_differences(const struct comparison *c, const struct movement *b, int32_t frame,
                                          struct part_difference out[PART_COUNT])
{
    part_differences(&c->a, b, &c->timeline, frame, out);
    part_differences_judge(out, &c->by);
}
void comparison_free(struct comparison *comparison); // zeroed is fine; leaves it zeroed
