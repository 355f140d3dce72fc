// Priority of background threads, which may be delayed in favour of drawing.
#pragma once

// Sets the calling thread to SCHED_OTHER (no real-time policy, even where its parent has one) and its nice value 5
// higher, about a third of an ordinary thread's share of a busy processor. Threads that it starts inherit this. Where
// the system does not permit it, nothing changes.
void thread_lower_priority(void);
