#include "platform/files/text_file.h"

#include "platform/files/file.h"

#include <stdlib.h>
#include <string.h>

enum status text_file_open(struct text_file *out, const char *path)
{
    static const char mark[] = "\xef\xbb\xbf";
    uint8_t *bytes;
    size_t count;
    *out = (struct text_file){0};
    enum status status = file_read(path, &bytes, &count);
    if (status != OK)
        return status;
    if (memchr(bytes, 0, count)) {
        free(bytes);
        return fail(ERR_INPUT, "%s is not a text file in UTF-8", path);
    }
    for (size_t i = 0; i + 1 < count;
         i++) // lines that end with a carriage return alone, as old spreadsheets write them
        if (bytes[i] == '\r' && bytes[i + 1] != '\n')
            bytes[i] = '\n';
    *out = (struct text_file){.text = (char *)bytes};
    out->next = out->text + (strncmp(out->text, mark, 3) ? 0 : 3);
    return OK;
}

char *text_file_line(struct text_file *file)
{
    static const char blanks[] = " \t\r\v\f";
    while (*file->next) {
        char *line = file->next + strspn(file->next, blanks), *end = line + strcspn(line, "\n");
        file->next = *end ? end + 1 : end;
        file->line++;
        while (end > line && strchr(blanks, end[-1]))
            end--;
        *end = 0;
        if (*line && *line != '#')
            return line;
    }
    return NULL;
}

size_t text_file_lines_left(const struct text_file *file)
{
    size_t lines = 1;
    for (const char *at = file->next; (at = strchr(at, '\n')); at++)
        lines++;
    return lines;
}

void text_file_close(struct text_file *file)
{
    free(file->text);
    *file = (struct text_file){0};
}
