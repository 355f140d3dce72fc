// Any bytes as a network.
#include "neural/tflite.h"
#include "tests/fuzz/fuzz.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct tflite_model model;
    if (fuzz_said(tflite_read(&model, "input", data, size)) == OK)
        tflite_free(&model);
    return 0;
}
