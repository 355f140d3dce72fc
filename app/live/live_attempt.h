// An attempt after it was made, or a take instead of it: compared with the reference (compare/comparison.h) on a thread
// of its own, so that the screen goes on, and held for the summary.
#pragma once
#include "compare/comparison.h"

enum { ATTEMPT_CELLS = 240, ATTEMPT_NOT_ALIGNED = 255 };

struct live_attempt {
    int number;
    bool mirrored;                // the reference was the actor's mirror image
    bool compared;                // `comparison` is filled; else `why` says why not
    struct comparison comparison; // the reference's part that was done, and the attempt
    struct joint_samples samples; // of the attempt, y down, times from 0
    int32_t first;                // frame of the whole reference at which comparison.a begins
    char why[200];
    char note[200]; // one sentence: what is expected of the reference and cannot be used; "": none. Of takes alone
    // Over its time, in cells: the worst verdict of each of its own parts; ATTEMPT_NOT_ALIGNED where it is aligned with
    // nothing
    uint8_t strip[ATTEMPT_CELLS][PART_COUNT];
};
void live_attempt_free(struct live_attempt *attempt); // zeroed is fine; leaves it zeroed

// The skeleton at that instant of the attempt: the nearest sample, world axes (z up). False: none within half a second.
bool live_attempt_skeleton(const struct live_attempt *attempt, int64_t time_ns, struct skeleton *out);

// The reference's frame that the attempt shows at that instant, in frames of the whole reference; NaN: none.
double live_attempt_reference(const struct live_attempt *attempt, int64_t time_ns);

struct attempt_judge;

struct attempt_task {
    const struct movement *reference;   // the whole; read while opening only
    bool mirrored;                      // it is the mirror image of what was recorded
    const struct expectation *expected; // what counts of it; NULL: everything. Read while opening only
    int32_t first, end;                 // of its frames: the part that was done
    int number;
    void (*notify)(void *self); // called on the thread at the end; may be NULL
    void *notify_self;
};
// Takes over the samples, also on failure. ERR_MEMORY: *out is NULL.
MUST_CHECK enum status attempt_judge_start(struct attempt_judge **out, const struct attempt_task *task,
                                           struct joint_samples *samples);

struct takes_task {
    const char *path, *reference;       // a recording, and a take of it; copied
    const char *attempt_path, *attempt; // the same or another one; copied
    int number;
    void (*notify)(void *self); // as above
    void *notify_self;
};
// Both are read on the thread, too. ERR_MEMORY: *out is NULL.
MUST_CHECK enum status attempt_judge_start_takes(struct attempt_judge **out, const struct takes_task *task);

void attempt_judge_close(struct attempt_judge **j); // NULL is fine; waits for the thread

// False: still judging. True, once: *out is the caller's.
bool attempt_judge_finished(struct attempt_judge *judge, struct live_attempt *out);
