// Any bytes as a motion file of any format, whose joints are found by their names.
#include "compare/movement.h"
#include "tests/fuzz/fuzz.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct joint_samples samples;
    struct movement movement;
    if (fuzz_said(joint_samples_read_motion(fuzz_file("motion", data, size), &samples)) == OK) {
        FUZZ_CHECK(samples.count >= 1);
        if (fuzz_said(movement_from_samples(&samples, &movement)) == OK)
            movement_free(&movement);
        joint_samples_free(&samples);
    }
    return 0;
}
