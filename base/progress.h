// Progress and cancellation of long work, by callbacks of its caller.
#pragma once
#include "base/status.h"

struct progress_watch {
    // Called several times a second on the working thread with the share done, 0..1. False: stop, the result is not
    // needed.
    bool (*on_progress)(void *self, double share);
    void *self;
    // Called once for each step, on that thread; the header of the work numbers the steps. May be NULL.
    void (*on_step)(void *self, int step);
};

// False: the work is to stop. watch may be NULL.
static inline bool progress_continue(const struct progress_watch *watch, double share)
{
    return !watch || watch->on_progress(watch->self, share);
}

static inline void progress_begin_step(const struct progress_watch *watch, int step)
{
    if (watch && watch->on_step)
        watch->on_step(watch->self, step);
}
