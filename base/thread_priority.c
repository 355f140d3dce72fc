#include "base/thread_priority.h"

#include <pthread.h>
#include <sched.h>
#include <sys/resource.h>

enum { NICE_STEP = 5 }; // each step has a fifth less weight: 0.8^5 = 0.33

// On Linux PRIO_PROCESS with 0 is the calling thread alone, where POSIX says the process.
void thread_lower_priority(void)
{
    const struct sched_param none = {0};
    pthread_setschedparam(pthread_self(), SCHED_OTHER, &none); // a real-time thread's nice value has no effect
    setpriority(PRIO_PROCESS, 0, getpriority(PRIO_PROCESS, 0) + NICE_STEP);
}

void thread_wake_without_preempting(void)
{
    const struct sched_param none = {0};
    struct sched_param now;
    int policy;
    if (pthread_getschedparam(pthread_self(), &policy, &now) == 0 && policy == SCHED_OTHER)
        pthread_setschedparam(pthread_self(), SCHED_BATCH, &none);
}
