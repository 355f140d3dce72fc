// Any bytes as a knowledge base's answer. What is understood of it is plain text, and can be printed and read again.
#include "base/text.h"
#include "objects/thing_knowledge.h"
#include "tests/fuzz/fuzz.h"

#include <stdio.h>
#include <string.h>

// Lines of text are allowed to end.
static void check_text(const char *text)
{
    char copy[1024];
    snprintf(copy, sizeof copy, "%s", text);
    for (char *c = copy; *c; c++)
        *c = *c == '\n' ? ' ' : *c;
    FUZZ_CHECK(text_is_printable(copy));
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static const char url[] = "http://knowledge.example/things/mug";
    struct thing_knowledge k, again;
    if (fuzz_said(thing_knowledge_parse((const char *)data, size, url, &k)) != OK)
        return 0;
    FUZZ_CHECK(*k.name != 0);
    const char *const texts[] = {k.name, k.description, k.material, k.instructions, k.weight, k.image, k.model};
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++)
        check_text(texts[i]);
    const char *const addresses[] = {k.image, k.model};
    for (int i = 0; i < 2; i++) // only on the server's own host
        FUZZ_CHECK(!*addresses[i] || !strncmp(addresses[i], "http://knowledge.example/", 25));
    char *printed = thing_knowledge_print(&k);
    FUZZ_CHECK(printed && thing_knowledge_parse(printed, strlen(printed), url, &again) == OK);
    FUZZ_CHECK(!strcmp(k.name, again.name) && !strcmp(k.description, again.description));
    free(printed);
    return 0;
}
