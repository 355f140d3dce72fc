// Any bytes as the model that a knowledge base sends.
#include "formats/glb_reader.h"
#include "tests/fuzz/fuzz.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct glb_model model;
    if (fuzz_said(glb_read(data, size, &model)) != OK)
        return 0;
    FUZZ_CHECK(model.corner_count > 0 && model.corner_count <= 3 * GLB_MAX_TRIANGLES && model.part_count > 0);
    glb_model_free(&model);
    return 0;
}
