#include "tests/bench/bench_record.h"

#include "capture/recorder.h"

enum status bench_record(const char *uri, const char *file)
{
    struct recording_writer *writer = NULL;
    struct source *source = NULL;
    const struct recorder_options options = {0};
    struct recorder_result result;
    enum status status = recording_create(&writer, file);
    if (status == OK)
        status = source_open(&source, uri, SOURCE_SENSOR);
    if (status == OK)
        status = recorder_run(source, writer, "take", NULL, &options, &result);
    source_close(&source);
    enum status closed = recording_close(&writer);
    return status == OK ? closed : status;
}
