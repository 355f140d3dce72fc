// Records a take for a stage to work on.
#pragma once
#include "base/status.h"

// Records the source `uri` as "take" into the new file `file`, without a place. Errors as recording_create, source_open
// and recorder_run.
MUST_CHECK enum status bench_record(const char *uri, const char *file);
