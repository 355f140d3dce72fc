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
void worker_thread_close(struct worker_thread *w); // tells the thread, if it was started, and waits for its end
