// Any bytes as a C3D file.
#include "formats/motion_file.h"
#include "tests/fuzz/fuzz.h"

#include <math.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct motion_points points = {.format = NULL};
    if (fuzz_said(c3d_points_read("any.c3d", data, size, &points)) == OK)
        FUZZ_CHECK(points.points >= 1 && points.frames >= 1 && isfinite(points.time_s[points.frames - 1]));
    motion_points_free(&points);
    return 0;
}
