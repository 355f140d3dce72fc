// Any bytes as a joints-csv file.
#include "compare/movement.h"
#include "tests/fuzz/fuzz.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct movement m;
    struct movement_source source;
    if (fuzz_said(movement_read(fuzz_file("joints.csv", data, size), NULL, &m, &source)) == OK)
        movement_free(&m);
    return 0;
}
