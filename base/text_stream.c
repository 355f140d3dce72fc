#include "base/text_stream.h"

#include <stdbool.h>
#include <stdlib.h>

FILE *text_begin(struct text_stream *text)
{
    *text = (struct text_stream){0};
    return text->to = open_memstream(&text->bytes, &text->size);
}

char *text_end(struct text_stream *text)
{
    if (!text->to)
        return NULL;
    const bool broken = ferror(text->to);
    if (!fclose(text->to) && !broken)
        return text->bytes;
    free(text->bytes);
    return NULL;
}
