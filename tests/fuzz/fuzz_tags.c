// Any bytes as a tags.json.
#include "capture/mapping/mapper.h"
#include "tests/fuzz/fuzz.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct mapper_tag *tags;
    int32_t count;
    if (fuzz_said(mapper_read_tags(fuzz_file("tags.json", data, size), &tags, &count)) == OK)
        FUZZ_CHECK(count > 0 && tags[0].side_m > 0);
    free(tags);
    return 0;
}
