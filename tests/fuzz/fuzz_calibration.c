// Any bytes as a calibration.json.
#include "platform/sensors/source.h"
#include "tests/fuzz/fuzz.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct calibration c;
    if (fuzz_said(calibration_read(fuzz_file("calibration.json", data, size), &c)) == OK) {
        FUZZ_CHECK(!c.color.width || lens_check(&c.color, "color") == OK);
        FUZZ_CHECK(!c.depth.width || lens_check(&c.depth, "depth") == OK);
    }
    return 0;
}
