// The report that verify and repair print.
#include "app/commands/recording_report.h"

#include "app/commands/command.h"
#include "platform/files/json.h"

#include <stdio.h>

void recording_report_print_rest(const struct recording_report *report)
{
    if (report->lost_covariances)
        printf("covariances of the joints in %lld frames, ", (long long)report->lost_covariances);
    if (report->lost_place)
        printf("the place with its views");
    else
        printf("%d views of the place", (int)report->lost_views);
    if (report->lost_map_covariances)
        printf(", covariances or viewing directions of its points and tags");
    if (report->lost_things)
        printf(", %d things in it or their pictures", report->lost_things);
}

enum status recording_report_print_json(const char *path, enum status status, const struct recording_report *r)
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
    json_add_number(root, "lost_frames", (double)r->lost_frames);
    json_add_number(root, "lost_covariances", (double)r->lost_covariances);
    json_add_number(root, "lost_takes", r->lost_takes);
    json_add_number(root, "lost_views", r->lost_views);
    json_add_bool(root, "lost_place", r->lost_place);
    json_add_bool(root, "lost_map_covariances", r->lost_map_covariances);
    json_add_number(root, "lost_things", r->lost_things);
    json_add_number(root, "findings", r->findings);
    struct json *list = json_add_array(root, "first_findings");
    for (int i = 0; i < r->findings && i < RECORDING_FINDINGS_MAX; i++)
        json_push_string(list, r->finding[i]);
    json_add_number(root, "bytes", (double)r->bytes);
    return command_print_json(&root);
}
