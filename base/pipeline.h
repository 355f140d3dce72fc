// Items that pass through the same stages on several threads: while some are in the last stage, others are in the
// stages before it. An item waits only for the stage before it and, in an ordered stage, for the item before it.
//
// The threads are created by pipeline_run and joined before it returns; no pool outlives it.
#pragma once
#include "base/status.h"

enum { PIPELINE_MAX_STAGES = 4 };

struct pipeline {
    int items, stages;
    int in_flight;                      // the most items that have begun and not ended
    bool in_order[PIPELINE_MAX_STAGES]; // the stage takes one item at a time, in order; otherwise any number, in any
                                        // order
    // Runs a stage on an item, on any thread; what the stage before it wrote is visible. An error ends the run.
    enum status (*work)(void *context, int stage, int item);
    // Called repeatedly on the caller's thread with the share done, 0..1. False: stop, the result is not needed.
    // Not NULL.
    bool (*on_progress)(void *context, double share);
    void *context;
};

// Runs on up to `threads` threads, at most 17, the caller's among them; fewer where the system gives no more.
// NOTHING: on_progress returned false. ERR_MEMORY. Otherwise the first error that a stage returned, with its sentence.
// No stage is running when it returns.
MUST_CHECK enum status pipeline_run(const struct pipeline *p, int threads);
