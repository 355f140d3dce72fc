// Any bytes as a BVH motion file.
#include "formats/bvh_reader.h"
#include "tests/fuzz/fuzz.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct bvh *b;
    if (fuzz_said(bvh_parse(&b, "any.bvh", data, size)) != OK)
        return 0;
    const int joints = bvh_joint_count(b), frames = bvh_frame_count(b);
    FUZZ_CHECK(joints >= 1 && frames >= 1 && bvh_frame_s(b) > 0);
    struct vec3 *positions = malloc((size_t)joints * sizeof *positions);
    FUZZ_CHECK(positions);
    bvh_positions(b, 0, positions);
    bvh_positions(b, frames - 1, positions);
    for (int j = 0; j < joints; j++) {
        FUZZ_CHECK(isfinite(positions[j].x) && isfinite(positions[j].y) && isfinite(positions[j].z));
        FUZZ_CHECK(bvh_find(b, bvh_joint_name(b, j)) >= 0);
    }
    free(positions);
    bvh_free(&b);
    return 0;
}
