// Condition variables whose timed waits are measured on the clock of clock_now_ns(), so that a change of the wall clock
// neither shortens nor prolongs a wait. For untimed waits, signals and pthread_cond_destroy use pthread itself.
#pragma once
#include "base/status.h"

#include <pthread.h>

void condition_open(pthread_cond_t *condition);

// As pthread_cond_timedwait: `lock` is held, and may have been released meanwhile. True: woken, perhaps without a
// signal. False: when_ns (as from clock_now_ns()) has passed.
bool condition_wait_until_ns(pthread_cond_t *condition, pthread_mutex_t *lock, int64_t when_ns);
