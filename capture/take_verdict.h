// The one verdict on a take: what record, studio, library, info and the shelf say. Made from the frames in the file by
// the coach (coaching/coach.h) and kept beside them (recording/recorded_verdict.h); made anew wherever it is missing,
// as in older files, or the frames have changed since. The same frames give the same verdict.
//
// Of a take longer than VERDICT_FRAMES_MOST frames as many are looked at, evenly. That takes about as long as playing
// them.
#pragma once
#include "capture/coaching/coach.h"
#include "capture/recording/recorded_verdict.h"

enum { VERDICT_FRAMES_MOST = 900 }; // 30 s of film: what a longer one adds was mostly seen before

// What only who filmed it knows.
struct take_filming {
    enum verdict_purpose purpose;
    const struct coach *coach; // that watched; NULL: none
};

struct take_judgement {
    struct take_verdict verdict;
    struct coverage seen; // of the body
    int64_t frames;
};

// Judges the take of the file and keeps the verdict there. filming NULL: purpose and what was seen while filming are
// those of the verdict before. *out is valid with OK. A file that cannot be
// written to keeps what it has: the verdict is then made anew when it is asked for. ERR_MISSING, ERR_CORRUPT, ERR_IO,
// ERR_MEMORY: the take cannot be judged.
MUST_CHECK enum status take_verdict_keep(const char *path, const char *name, const struct take_filming *filming,
                                         struct take_judgement *out);

// The verdict that is kept, or a new one. ERR_CORRUPT, ERR_IO, ERR_MEMORY, ERR_MISSING.
MUST_CHECK enum status take_verdict_get(struct recording *r, const char *name, struct take_verdict *out);
