// Joints as CSV.
#include "capture/export.h"

#include "base/text.h"

static void print_skeleton(FILE *out, int64_t time_ns, const struct skeleton *s)
{
    char time[SECONDS_TEXT_BYTES];
    seconds_text(time_ns, 6, time);
    for (int j = 0; j < JOINT_COUNT; j++) {
        struct vec3 p = s->joint[j];
        const double sigma_m = joint_sigma_m(s, (enum joint)j);
        fprintf(out, "%s,%s,%.5f,%.5f,%.5f,%.2f,", time, joint_name((enum joint)j), p.x, p.y, p.z,
                (double)s->confidence[j]);
        fprintf(out, isnan(sigma_m) ? "\n" : "%.5f\n", sigma_m);
    }
}

enum status export_joints_csv(const struct take *take, enum export_axes axes, FILE *out)
{
    int64_t printed = 0, people = 0;
    fputs("timestamp,joint,x_m,y_m,z_m,confidence,sigma_m\n", out);
    for (int64_t i = 0; i < take_frame_count(take); i++) {
        const struct take_entry *entry = take_entry(take, i);
        people += entry->has_skeleton;
        if (!entry->has_skeleton || (axes == EXPORT_ROOM && !entry->located))
            continue;
        const struct skeleton s =
            axes == EXPORT_ROOM ? skeleton_transform(entry->world_from_camera, &entry->skeleton) : entry->skeleton;
        print_skeleton(out, entry->time_ns, &s);
        printed++;
    }
    if (people && !printed)
        return fail(ERR_INPUT,
                    "the sensor was not located in a room, so there are no room's axes; export without them");
    return OK;
}
