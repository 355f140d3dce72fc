// What the program did, beside the clock: processor time of whoever draws and of all others, and what the machine
// kept from it meanwhile. Linux; zeros where it does not tell. Asking costs some tenths of a millisecond.
#pragma once
#include "base/status.h"

struct work {
    double cpu_ms;           // processor time of those that draw: the program's first thread and the driver's
    double waited_ms;        // that they were ready and had no processor
    double other_threads_ms; // processor time of all others: loading, looking for the camera, preparing
    double faults;           // pages that were touched for the first time
    double stolen_ms; // of all processors, that the host of a virtual machine gave them to others; in steps of 10 ms.
                      // Times of whatever kind hold it.
};

// So far; stolen: since the machine was started.
struct work work_so_far(void);
struct work work_since(const struct work *before);
