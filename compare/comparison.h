// Two movements compared: a reference A and an attempt B. What the command prints, and the app will show.
#pragma once
#include "compare/angles.h"
#include "compare/pieces.h"
#include "compare/score.h"

struct comparison {
    struct movement a, b;       // as they are; `b` is never mirrored
    uint16_t parts;             // known in both
    bool mirrored;              // B resembles A's mirror image far more than A: it was judged as that
    struct movement judged;     // B, mirrored if `mirrored`
    struct alignment alignment; // of a and judged
    struct timeline timeline;
    struct pace pace;
    struct score_terms terms;
    double score;
    struct angle_range range_a[BODY_ANGLES], range_b[BODY_ANGLES]; // over what is aligned; B's as judged
};

// Takes over both movements, also on failure. ERR_INPUT: no part is known in both. ERR_MEMORY. On failure *out is
// zeroed. Pure; two threads may compare at the same time.
MUST_CHECK enum status comparison_make(struct movement *a, struct movement *b, struct comparison *out);
void comparison_free(struct comparison *c); // zeroed is fine; leaves it zeroed
