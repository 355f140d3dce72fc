// Time for measuring and pacing. Nanoseconds. Any thread may call.
#pragma once
#include "base/status.h"

int64_t clock_now_ns(void);                 // CLOCK_MONOTONIC: never runs backwards; its origin has no meaning
int64_t clock_cpu_ns(void);                 // processor time of the calling thread
int64_t clock_process_ns(void);             // of all threads of the process
void clock_sleep_until_ns(int64_t when_ns); // when_ns as from clock_now_ns()
