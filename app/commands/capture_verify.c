// reenact-capture verify FILE: reads every byte of a recording.
#include "app/commands/commands.h"
#include "app/commands/recording_report.h"
#include "base/text.h"

#include <stdio.h>

static enum status print_report(const struct file_arguments *arguments, enum status status,
                                const struct recording_report *report)
{
    char shown[TEXT_SHOWN_BYTES];
    if (arguments->json) {
        return recording_report_print_json(arguments->path, status, report);
    } else if (status == OK) {
        printf("%s is sound: %d takes (%d interrupted), %lld frames, %.1f MB\n", text_shown(arguments->path, shown),
               report->takes, report->interrupted_takes, (long long)report->frames, (double)report->bytes / 1e6);
    } else if (report->findings) {
        printf("%s is damaged: %lld frames cannot be read, %lld lack an image, of %lld that are there; ",
               text_shown(arguments->path, shown), (long long)report->lost_frames, (long long)report->damaged_frames,
               (long long)report->frames);
        recording_report_print_rest(report);
        putchar('\n');
        for (int i = 1; i < report->findings && i < RECORDING_FINDINGS_MAX; i++)
            printf("  %s\n", report->finding[i]); // the first goes to stderr
        if (report->findings > RECORDING_FINDINGS_MAX)
            printf("  and %d more\n", report->findings - RECORDING_FINDINGS_MAX);
    }
    return OK;
}

int capture_verify(int argc, char **argv)
{
    struct file_arguments a;
    command_parse_file(argc, argv,
                       "Reads every byte of a recording and says whether all of it is sound: its structure, counts, "
                       "checksums, pictures, the order of times, ranges. The file is only read.",
                       &a);
    struct recording_report report;
    enum status status = recording_verify(a.path, &report);
    struct failure found;
    failure_keep(&found, status);
    const enum status printed = print_report(&a, status, &report);
    status = found.status == OK ? printed : failure_restore(&found);
    return status == OK ? 0 : command_failed(argv[0]);
}
