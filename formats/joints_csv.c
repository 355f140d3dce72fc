#include "formats/joints_csv.h"

#include "base/text.h"

const char *const joints_csv_axes_names[JOINTS_CSV_AXES] = {[JOINTS_CSV_CAMERA] = "camera", [JOINTS_CSV_ROOM] = "room"};

void joints_csv_begin(FILE *out, enum joints_csv_axes axes)
{
    fprintf(out, JOINTS_CSV_MARK " %s\n" JOINTS_CSV_HEADER JOINTS_CSV_SIGMA "\n", joints_csv_axes_names[axes]);
}

void joints_csv_add(FILE *out, int64_t time_ns, const struct skeleton *skeleton)
{
    char time[SECONDS_TEXT_BYTES];
    seconds_text(time_ns, 6, time);
    for (int j = 0; j < JOINT_COUNT; j++) {
        const struct vec3 p = skeleton->joint[j];
        const double sigma_m = joint_sigma_m(skeleton, (enum joint)j);
        fprintf(out, "%s,%s,%.5f,%.5f,%.5f,%.2f,", time, joint_name((enum joint)j), p.x, p.y, p.z,
                (double)skeleton->confidence[j]);
        fprintf(out, isnan(sigma_m) ? "\n" : "%.5f\n", sigma_m);
    }
}
