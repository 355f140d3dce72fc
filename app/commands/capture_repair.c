// reenact-capture repair FILE: saves what can be read of a damaged recording.
#include "app/commands/commands.h"

#include "app/commands/recording_report.h"

#include <stdio.h>

static void print_report(const struct file_arguments *a, enum status status, const struct recording_report *r)
{
    if (a->json)
        recording_report_print_json(a->path, status, r);
    else if (status == OK)
        printf("%s: %d takes (%d were interrupted), %lld frames, %lld of them damaged or lost, %.1f MB\n", a->path,
               r->takes, r->interrupted_takes, (long long)r->frames, (long long)r->damaged_frames,
               (double)r->bytes / 1e6);
}

int capture_repair(int argc, char **argv)
{
    struct file_arguments a;
    command_parse_file(
        argc, argv,
        "Saves what can be read of a damaged recording into FILE; what was there stays as FILE.damaged. A "
        "sound file is left as it is, but that interrupted takes count as complete from then on.",
        &a);
    struct recording_report report;
    enum status status = recording_repair(a.path, &report);
    print_report(&a, status, &report);
    return status == OK ? 0 : command_failed(argv[0]);
}
