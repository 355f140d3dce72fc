// Joints as CSV.
#include "capture/export.h"

#include "platform/file.h"

#include <stdio.h>
#include <stdlib.h>

enum status export_joints_csv(const struct take *take, const char *path)
{
    char *text = NULL;
    size_t size = 0;
    FILE *out = open_memstream(&text, &size);
    if (!out)
        return fail(ERR_MEMORY, "no memory to export the joints");
    fputs("timestamp,joint,x_m,y_m,z_m,confidence,sigma_m\n", out);
    for (int64_t i = 0; i < take_frame_count(take); i++) {
        const struct take_entry *entry = take_entry(take, i);
        if (!entry->has_skeleton)
            continue;
        for (int j = 0; j < JOINT_COUNT; j++) {
            struct vec3 p = entry->skeleton.joint[j];
            const double sigma_m = joint_sigma_m(&entry->skeleton, (enum joint)j);
            fprintf(out, "%lld.%06lld,%s,%.5f,%.5f,%.5f,%.2f,", (long long)(entry->time_ns / 1000000000),
                    (long long)(entry->time_ns % 1000000000 / 1000), joint_name((enum joint)j), p.x, p.y, p.z,
                    (double)entry->skeleton.confidence[j]);
            fprintf(out, isnan(sigma_m) ? "\n" : "%.5f\n", sigma_m);
        }
    }
    bool written = !ferror(out);
    written = fclose(out) == 0 && written;
    enum status status = written ? file_write(path, text, size) : fail(ERR_MEMORY, "no memory to export the joints");
    free(text);
    return status;
}
