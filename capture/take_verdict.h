// The one verdict on a take: what record, studio, library, info and the shelf say. Made from the frames in the file by
// the coach (coaching/coach.h) and kept beside them (recording/recorded_verdict.h); made anew wherever it is missing,
// as in older files, or the frames have changed since. The same frames give the same verdict.
//
// The joints of all frames count. Images are looked at ten times a second, of a take shorter than VERDICT_LOOKS_MIN
// such looks more often, of one longer than VERDICT_LOOKS_MAX less.
#pragma once
#include "capture/coaching/coach.h"
#include "capture/recorder.h"
#include "capture/tracking/skeleton_smoother.h"
#include "recording/recorded_verdict.h"

// ---------------------------------------------------------------- take frames

// The frames of a take as they come from its source: damaged ones are counted and left out, those of a pause thrown
// away, and the pause is closed in the frames' times.

struct take_clock {
    int64_t frames, first_ns, last_ns; // of the take
    int64_t closed_ns;                 // what pauses took from the source's times
    bool after_pause;                  // the frame is the first one after a pause
};

// OK: *frame with its time in the take, which rises; borrowed as source_next's. NOTHING: the end, or stopped. Errors as
// source_next.
MUST_CHECK enum status take_frames_next(struct take_clock *clock, struct source *source,
                                        const struct recorder_options *options, struct frame *frame,
                                        struct recorder_result *result);

// ---------------------------------------------------------------- take smoothing

// The backward pass after a take was recorded: its depth is read again from the end to the beginning, and its online
// joints are replaced by smoothed ones (skeleton_smoother.h); the body is measured again by them (body_radii.h).

// `name` is the take that the writer ended last, and `smoother` has seen all of its frames. NOTHING: stopped; the take
// keeps the online joints, as after any error. ERR_IO, ERR_MEMORY.
MUST_CHECK enum status take_smooth(struct smoother *smoother, struct tracker *tracker, struct recording_writer *writer,
                                   const char *name, const struct recorder_options *options);

// ---------------------------------------------------------------- take verdict

// Chosen by hand. MOST: 30 s of film; what a longer one adds was mostly seen before.
enum { VERDICT_LOOKS_MIN = 60, VERDICT_LOOKS_MAX = 300 };

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

// The same for each take that has none, or one of other frames. ERR_CORRUPT, ERR_IO, ERR_MEMORY: the rest has none.
MUST_CHECK enum status take_verdict_keep_missing(const char *path);

// Asked before each frame, where it is not NULL: false ends the judging.
struct take_verdict_patience {
    bool (*goes_on)(void *self);
    void *self;
};

// The verdict that is kept, or a new one, which is not written. patience NULL: there is time. NOTHING: it was ended.
// ERR_CORRUPT, ERR_IO, ERR_MEMORY, ERR_MISSING.
MUST_CHECK enum status take_verdict_get(struct recording *recording, const char *name,
                                        const struct take_verdict_patience *patience, struct take_verdict *out);
