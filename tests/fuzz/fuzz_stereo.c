// Any bytes as a rig.json, and as a list of a rig's pairs. A rig can be written and read again.
#include "capture/calibration/stereo_rig.h"
#include "objects/stereo_pairs.h"
#include "tests/fuzz/fuzz.h"

#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct stereo_rig rig, again;
    struct stereo_pair *pairs;
    int count;
    if (fuzz_said(stereo_rig_read(fuzz_file("rig.json", data, size), &rig)) == OK) {
        FUZZ_CHECK(lens_check(&rig.left, "left") == OK && lens_check(&rig.right, "right") == OK);
        FUZZ_CHECK(pose_finite(rig.left_from_right));
        char *text = stereo_rig_print(&rig);
        FUZZ_CHECK(text != NULL);
        FUZZ_CHECK(stereo_rig_read(fuzz_file("again.json", (uint8_t *)text, strlen(text)), &again) == OK);
        free(text);
    }
    if (fuzz_said(stereo_pairs_read(fuzz_file("pairs.txt", data, size), &pairs, &count)) == OK) {
        for (int i = 0; i < count; i++)
            FUZZ_CHECK(pose_finite(pairs[i].world_from_left) && *pairs[i].picture[0] && *pairs[i].picture[1]);
        free(pairs);
    }
    return 0;
}
