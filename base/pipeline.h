// Items that each go through the same stages, on a few threads: while some are in the last stage, others are in those
// before it. Nobody waits for anything but what the item itself needs.
#pragma once
#include "base/status.h"

enum { PIPELINE_MAX_STAGES = 4 };

struct pipeline {
    int items, stages;
    int in_flight;                      // items that are begun and not ended, at most
    bool in_order[PIPELINE_MAX_STAGES]; // the stage takes one item at a time, in their order; else as many as there
                                        // are threads, in any
    // What a stage does with an item, on any thread; what it did in the stage before is seen there. An error ends all.
    enum status (*work)(void *context, int stage, int item);
    // Told now and then, on the thread that called, which share is done; false: it is not wanted any more. Not NULL.
    bool (*went_on)(void *context, double share);
    void *context;
};

// On up to `threads` threads, the caller's among them, fewer where the system gives no more. NOTHING: it is not wanted
// any more; ERR_MEMORY. Else the first error that came up, with its sentence; no work goes on when it returns.
MUST_CHECK enum status pipeline_run(const struct pipeline *p, int threads);
