// A text of any length that is printed into memory. One handle, one thread.
#pragma once
#include <stdio.h>

struct text_stream {
    FILE *to;
    char *bytes;
    size_t size;
};

FILE *text_begin(struct text_stream *text); // NULL: no memory

// The malloc'ed text, which the caller frees; NULL: no memory, or text_begin had none. Once after each text_begin.
char *text_end(struct text_stream *text);
