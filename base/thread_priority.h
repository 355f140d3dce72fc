// Priority of background threads, which may be delayed in favour of drawing or of reading a sensor.
#pragma once

// Sets the calling thread to SCHED_OTHER (no real-time policy, even where its parent has one) and its nice value 5
// higher, about a third of an ordinary thread's share of a busy processor. Threads that it starts inherit this. Where
// the system does not permit it, nothing changes.
void thread_lower_priority(void);

// The calling thread keeps its share of the processor (SCHED_BATCH), but when it wakes up it takes the processor from
// no running thread: that costs the other thread a time slice, about 3 ms. Threads that it starts inherit this. From a
// real-time policy nothing changes.
void thread_wake_without_preempting(void);
