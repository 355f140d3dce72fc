#include "base/thread_priority.h"

#include <pthread.h>
#include <sched.h>
#include <sys/resource.h>

enum { NICE_STEP = 5 }; // each step weighs a fifth less

// Linux counts a thread where POSIX counts a process: 0 is the calling one alone.
void thread_lower_priority(void)
{
    const struct sched_param none = {0};
    pthread_setschedparam(pthread_self(), SCHED_OTHER, &none); // of a thread in real time a third would be as much
    setpriority(PRIO_PROCESS, 0, getpriority(PRIO_PROCESS, 0) + NICE_STEP);
}
