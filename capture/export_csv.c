// Joints as CSV.
#include "capture/export.h"

#include "formats/joints_csv.h"

enum status export_joints_csv(const struct take *take, enum export_axes axes, FILE *out)
{
    int64_t printed = 0, people = 0;
    joints_csv_begin(out, axes == EXPORT_ROOM ? JOINTS_CSV_ROOM : JOINTS_CSV_CAMERA);
    for (int64_t i = 0; i < take_frame_count(take); i++) {
        const struct take_entry *entry = take_entry(take, i);
        people += entry->has_skeleton;
        if (!entry->has_skeleton || (axes == EXPORT_ROOM && !entry->located))
            continue;
        const struct skeleton s =
            axes == EXPORT_ROOM ? skeleton_transform(entry->world_from_camera, &entry->skeleton) : entry->skeleton;
        joints_csv_add(out, entry->time_ns, &s);
        printed++;
    }
    if (people && !printed)
        return fail(ERR_INPUT,
                    "the sensor was not located in a room, so there are no room's axes; export without them");
    return OK;
}
