// The report that verify and repair print.
#include "app/commands/recording_report.h"

#include "app/commands/command.h"
#include "platform/json.h"

void recording_report_print_json(const char *path, enum status status, const struct recording_report *r)
{
    struct json *root = json_new_object();
    json_add_string(root, "file", path);
    json_add_string(root, "status", status_name(status));
    if (status != OK)
        json_add_string(root, "reason", status_message());
    json_add_number(root, "takes", r->takes);
    json_add_number(root, "interrupted_takes", r->interrupted_takes);
    json_add_number(root, "frames", (double)r->frames);
    json_add_number(root, "damaged_frames", (double)r->damaged_frames);
    json_add_number(root, "bytes", (double)r->bytes);
    (void)!command_print_json(&root); // the exit code is about the recording, not this
}
