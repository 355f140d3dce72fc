// A thread that works beside its owner until it is told to end: the thread, the lock on what both touch, and the
// condition by which one tells the other of a change. The owner's struct holds one.
#pragma once
#include "base/condition.h"

struct worker_thread {
    pthread_mutex_t lock;   // guards `closing` and what the owner says; best not held during work
    pthread_cond_t changed; // waits may be timed (condition.h)
    bool closing;           // the thread must end soon
    bool runs;
    pthread_t thread;
};

void worker_thread_open(struct worker_thread *w); // without the thread; once opened, it must be closed

// run(self) on the thread. ERR_MEMORY: there is none; the message names `task`, as "to look for body points".
MUST_CHECK enum status worker_thread_start(struct worker_thread *w, void *(*run)(void *), void *self, const char *task);
// Tells the thread, if it was started, and waits for its end. Lock and condition stay for others. More than once is
// fine.
void worker_thread_stop(struct worker_thread *w);
void worker_thread_close(struct worker_thread *w); // as worker_thread_stop, and lock and condition are gone

// With the lock held: tells the thread to end, and leaves its owner's memory to it, so that nobody waits for its end.
// It calls worker_thread_close itself. False: it does not run.
bool worker_thread_abandon(struct worker_thread *w);

bool worker_thread_must_end(struct worker_thread *w); // for the thread, while it works: `closing`
