// A text file from outside, line by line: lists of files, poses, tables. Any thread may call, one thread each file.
#pragma once
#include "base/status.h"

struct text_file {
    char *text; // of the whole file; lines point into it
    char *next;
    int line; // of the line read last, from 1
};

// Skips the byte order mark that some editors and spreadsheets put before a text. ERR_INPUT: it is not UTF-8 or ASCII,
// as it holds a 0 (UTF-16, or no text at all); and file_read's. On error there is nothing to close.
MUST_CHECK enum status text_file_open(struct text_file *out, const char *path);

// The next line that is neither blank nor a comment (#), without blanks round it and whatever ends lines; it may be
// changed, and lives until text_file_close. NULL: there is none.
char *text_file_line(struct text_file *file);

// How many lines are left, comments included: room for what they hold.
size_t text_file_lines_left(const struct text_file *file);

void text_file_close(struct text_file *file);
