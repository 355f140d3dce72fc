// Any bytes as a TRC file.
#include "formats/motion_file.h"
#include "tests/fuzz/fuzz.h"

#include <math.h>
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct motion_points points = {.format = NULL};
    char *text = malloc(size + 1);
    FUZZ_CHECK(text);
    memcpy(text, data, size);
    text[size] = 0;
    if (fuzz_said(trc_points_read("any.trc", text, size, &points)) == OK)
        FUZZ_CHECK(points.points >= 1 && points.frames >= 1 && isfinite(points.time_s[points.frames - 1]));
    motion_points_free(&points);
    free(text);
    return 0;
}
