// What the program used besides wall-clock time: processor time of the drawing threads and of all others, and time that
// the machine withheld. Linux only; zeros where the kernel does not report it. A call costs some tenths of a
// millisecond.
#pragma once
#include "base/status.h"

struct work {
    double cpu_ms;           // processor time of the drawing threads: the program's first thread and the driver's
    double waited_ms;        // while they were ready and had no processor
    double other_threads_ms; // processor time of all other threads: loading, localising, preparing
    double faults;           // pages touched for the first time
    double stolen_ms; // of all processors, given to others by the host of a virtual machine; in steps of 10 ms. All
                      // other times include it.
};

// Since the program began; stolen: since the machine was started.
struct work work_so_far(void);
struct work work_since(const struct work *before);
