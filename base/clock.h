// Time that only moves forward, for measuring and pacing. Nanoseconds.
#pragma once
#include "base/status.h"

int64_t clock_now_ns(void); // monotonic; the origin means nothing
int64_t clock_cpu_ns(void); // this thread's own processor time
void clock_sleep_until_ns(int64_t when_ns);
