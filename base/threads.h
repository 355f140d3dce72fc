// Threads and what they wait on: conditions, priorities, a worker beside its owner, parallel loops, queues, pipelines.
#pragma once
#include "base/status.h"

#include <pthread.h>

// ---------------------------------------------------------------- condition

// Condition variables whose timed waits are measured on the clock of clock_now_ns(), so that a change of the wall clock
// neither shortens nor prolongs a wait. For untimed waits, signals and pthread_cond_destroy use pthread itself.

void condition_open(pthread_cond_t *condition);

// As pthread_cond_timedwait: `lock` is held, and may have been released meanwhile. True: woken, perhaps without a
// signal. False: when_ns (as from clock_now_ns()) has passed.
bool condition_wait_until_ns(pthread_cond_t *condition, pthread_mutex_t *lock, int64_t when_ns);

// ---------------------------------------------------------------- thread priority

// Priority of background threads, which may be delayed in favour of drawing or of reading a sensor.

// Sets the calling thread to SCHED_OTHER (no real-time policy, even where its parent has one) and its nice value 5
// higher, about a third of an ordinary thread's share of a busy processor. Threads that it starts inherit this. Where
// the system does not permit it, nothing changes.
void thread_lower_priority(void);

// The calling thread keeps its share of the processor (SCHED_BATCH), but when it wakes up it takes the processor from
// no running thread: that costs the other thread a time slice, about 3 ms. Threads that it starts inherit this. From a
// real-time policy nothing changes.
void thread_wake_without_preempting(void);

// ---------------------------------------------------------------- worker thread

// A thread that works beside its owner until it is told to end: the thread, the lock on what both touch, and the
// condition by which one tells the other of a change. The owner's struct holds one.

struct worker_thread {
    pthread_mutex_t lock;   // guards `closing` and what the owner says; best not held during work
    pthread_cond_t changed; // waits may be timed (condition_wait_until_ns)
    bool closing;           // the thread must end soon
    bool runs;
    pthread_t thread;
};

void worker_thread_open(struct worker_thread *thread); // without the thread; once opened, it must be closed

// run(self) on the thread. ERR_MEMORY: there is none; the message names `task`, as "to look for body points".
MUST_CHECK enum status worker_thread_start(struct worker_thread *thread, void *(*run)(void *), void *self,
                                           const char *task);
// Tells the thread, if it was started, and waits for its end. Lock and condition stay for others. More than once is
// fine.
void worker_thread_stop(struct worker_thread *thread);
void worker_thread_close(struct worker_thread *thread); // as worker_thread_stop, and lock and condition are gone

// With the lock held: tells the thread to end and detaches it, so that nobody waits for its end. It owns its owner's
// struct from then on, and calls worker_thread_close itself. False: it does not run.
bool worker_thread_abandon(struct worker_thread *thread);

bool worker_thread_must_end(struct worker_thread *thread); // for the thread, while it works: `closing`

// ---------------------------------------------------------------- parallel

// A parallel loop. The threads are created by the call and joined before it returns; no pool outlives it.

// Calls work(context, i) once for every i in [0, count), on up to `threads` threads, at most 16, the caller's among
// them (fewer where the system gives no more), and returns when all are done. Thread t takes t, t + threads, t + 2
// threads and so on.
void parallel_for(int threads, int count, void (*work)(void *context, int i), void *context);

// ---------------------------------------------------------------- queue

// A bounded first-in first-out queue of pointers between threads: some put, another takes. It has a lock and no thread
// of its own.

struct queue;

MUST_CHECK enum status queue_open(struct queue **out, int capacity); // ERR_MEMORY; *out is then NULL
void queue_close(struct queue **queue); // no thread may use it any more; items left in it are not freed. NULL is fine

// Waits until an item fits. False: the queue was stopped; the item stays the caller's.
bool queue_put(struct queue *queue, void *item);

// Does not wait. False: full or stopped; the item stays the caller's.
bool queue_try_put(struct queue *queue, void *item);

// Waits for an item. NULL: stopped and empty.
void *queue_take(struct queue *queue);

// How many items are in it now.
int queue_count(struct queue *queue);

bool queue_is_stopped(struct queue *queue);

// From any thread: puts fail from now on; takes continue until the queue is empty.
void queue_stop(struct queue *queue);

// ---------------------------------------------------------------- pipeline

// Items that pass through the same stages on several threads: while some are in the last stage, others are in the
// stages before it. An item waits only for the stage before it and, in an ordered stage, for the item before it.
//
// The threads are created by pipeline_run and joined before it returns; no pool outlives it.

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
MUST_CHECK enum status pipeline_run(const struct pipeline *pipeline, int threads);
