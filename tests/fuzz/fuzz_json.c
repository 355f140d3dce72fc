// Any bytes as JSON; what is read is printed and read again.
#include "platform/files/json.h"
#include "tests/fuzz/fuzz.h"

#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct json *root, *again;
    if (fuzz_said(json_read(fuzz_file("input.json", data, size), &root)) != OK)
        return 0;
    int count = 0;
    for (const struct json *v = json_first(root); v; v = json_next(v), count++)
        (void)json_name(v);
    FUZZ_CHECK(count == json_count(root));
    char *text = json_print(root);
    FUZZ_CHECK(text);
    FUZZ_CHECK(fuzz_said(json_read(fuzz_file("input.json", (const uint8_t *)text, strlen(text)), &again)) == OK);
    FUZZ_CHECK(json_count(again) == count);
    json_free(&again);
    json_free(&root);
    free(text);
    return 0;
}
