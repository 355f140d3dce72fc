// Two movements compared: a reference A and an attempt B. What the command prints, and the app will show.
#pragma once
#include "compare/movement.h"
#include "compare/repetitions.h"
#include "compare/score.h"

enum finding_kind { FINDING_POSTURE, FINDING_RANGE, FINDING_TIMING, FINDING_MISSING, FINDING_EXTRA, FINDING_MIRRORED };

// What a teacher would say. Times are B's, except of a missing piece, where they are the reference's.
struct finding {
    enum finding_kind kind;
    const char *part; // a part's name, or "body"
    double from_s, to_s;
    double amount;    // signed as the sentence says
    const char *unit; // "deg", "s", "%", "times"
    double weight;    // for the order: worst first
    char sentence[160];
};

struct comparison {
    struct movement a, b;       // as they are; `b` is never mirrored
    uint16_t parts;             // known in both
    bool mirrored;              // B resembles A's mirror image far more than A: it was judged as that
    struct movement judged;     // B, mirrored if `mirrored`; else it has b's frames
    struct alignment alignment; // of a and judged
    struct timeline timeline;
    struct pace pace;
    struct judged_repetitions repetitions;
    struct score_terms terms;
    double score;
    struct finding *findings; // malloc'ed, worst first
    int32_t finding_count;
    struct angle_range range_a[BODY_ANGLES], range_b[BODY_ANGLES]; // over what is aligned; B's as judged
};

// Takes over both movements, also on failure. ERR_INPUT: no part is known in both. ERR_MEMORY. On failure *out is
// zeroed. Pure; two threads may compare at the same time.
MUST_CHECK enum status comparison_make(struct movement *a, struct movement *b, struct comparison *out);
void comparison_free(struct comparison *comparison); // zeroed is fine; leaves it zeroed
