// How long work says how far it is, and asks whether its result is still wanted.
#pragma once
#include "base/status.h"

struct progress_watch {
    // Called several times a second on the thread that works, with the share done, 0..1. False: stop, the result is not
    // wanted any more.
    bool (*went_on)(void *self, double share);
    void *self;
    void (*began)(void *self,
                  int step); // each step once, on that thread, as the work's header numbers them; may be NULL
};

// False: the result is not wanted any more. watch may be NULL.
static inline bool progress_continue(const struct progress_watch *watch, double share)
{
    return !watch || watch->went_on(watch->self, share);
}

static inline void progress_begin_step(const struct progress_watch *watch, int step)
{
    if (watch && watch->began)
        watch->began(watch->self, step);
}
