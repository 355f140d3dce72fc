// The work of reenact-capture objects. Main thread.
#pragma once
#include "base/status.h"

struct objects_arguments {
    const char *pairs, *rig, *objects, *out;
    bool force, json;
};

// Recognises in all pairs, learns each thing's shape and size from all of them, aligns once more, writes and reports.
// ERR_… of what it reads and writes.
MUST_CHECK enum status objects_run(const struct objects_arguments *a);
