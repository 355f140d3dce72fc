// Any bytes as a list of poses, a list of files, a robot's calibration.json and a PLY file of points: what surroundings
// are read from.
#include "formats/ply.h"
#include "surround/reading/surround_set.h"
#include "tests/fuzz/fuzz.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static void read_lists(void)
{
    struct timed_pose *poses;
    struct timed_file *files;
    int count;
    if (fuzz_said(pose_list_read(fuzz_path("input"), &poses, &count)) == OK) {
        FUZZ_CHECK(count > 0);
        for (int i = 0; i < count; i++)
            FUZZ_CHECK(pose_finite(poses[i].pose) && (!i || poses[i].time_ns >= poses[i - 1].time_ns));
        FUZZ_CHECK(pose_finite(pose_list_at(poses, count, poses[0].time_ns)));
        FUZZ_CHECK(pose_finite(pose_list_at(poses, count, poses[count - 1].time_ns - 1)));
        free(poses);
    }
    char folder[128];
    snprintf(folder, sizeof folder, "%s", fuzz_path("input"));
    *strrchr(folder, '/') = 0;
    if (fuzz_said(file_list_read(folder, "input", &files, &count)) == OK) {
        FUZZ_CHECK(count > 0);
        free(files);
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    float(*points)[3];
    struct surround_set rig;
    int count;
    fuzz_file("input", data, size);
    if (fuzz_said(ply_points_read(fuzz_path("input"), &points, &count)) == OK) {
        for (int i = 0; i < count; i++)
            FUZZ_CHECK(isfinite(points[i][0]) && isfinite(points[i][1]) && isfinite(points[i][2]));
        free(points);
    }
    if (fuzz_said(surround_rig_read(&rig, fuzz_path("input"))) == OK)
        FUZZ_CHECK(lens_check(&rig.view, "view") == OK);
    surround_set_free(&rig);
    read_lists();
    return 0;
}
