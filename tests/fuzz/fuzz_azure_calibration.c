// Any text as an Azure Kinect's calibration.json: what is accepted are lenses that can be used, and what resamples to
// them stays inside the image.
#include "platform/sensors/azure_kinect.h"
#include "tests/fuzz/fuzz.h"

#include <math.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static const int color[2] = {64, 36}, depth[2] = {320, 288};
    struct azure_calibration c;
    if (fuzz_said(azure_calibration_parse((const char *)data, size, "an input", color, depth, &c)) != OK)
        return 0;
    FUZZ_CHECK(lens_check(&c.lenses.color, "color") == OK && lens_check(&c.lenses.depth, "depth") == OK);
    FUZZ_CHECK(pose_finite(c.lenses.color_from_depth));
    const struct azure_remap *remaps[] = {&c.color, &c.depth};
    for (int k = 0; k < 2; k++)
        for (int i = 0; remaps[k]->from && i < remaps[k]->width * remaps[k]->height; i++) {
            const float x = remaps[k]->from[2 * i], y = remaps[k]->from[2 * i + 1];
            FUZZ_CHECK((x == -1 && y == -1) ||
                       (x >= 0 && y >= 0 && x <= (float)(remaps[k]->width - 1) && y <= (float)(remaps[k]->height - 1)));
        }
    azure_calibration_free(&c);
    return 0;
}
