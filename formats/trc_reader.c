// Reads TRC: five lines of heading, then a row of tab-separated numbers a frame.
#include "base/text.h"
#include "formats/motion_file.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

struct trc_text {
    const char *name;
    char *next;
    int line;
};

// The next line, without what ends it; NULL: there is none.
static char *next_line(struct trc_text *text)
{
    char *line = text->next;
    if (!line || !*line)
        return NULL;
    char *end = line + strcspn(line, "\r\n");
    text->next = end + (*end == '\r' && end[1] == '\n' ? 2 : *end != 0);
    *end = 0;
    text->line++;
    return line;
}

// The next cell of a line, without blanks round it; NULL: there is none. *at is moved on.
static char *next_cell(char **at)
{
    char *cell = strsep(at, "\t");
    if (!cell)
        return NULL;
    cell += strspn(cell, " ");
    for (char *end = cell + strlen(cell); end > cell && end[-1] == ' ';)
        *--end = 0;
    return cell;
}

static double metres_of(const char *unit)
{
    static const struct {
        const char *name;
        double metres;
    } units[] = {{"mm", 0.001}, {"cm", 0.01}, {"m", 1}, {"meters", 1}, {"metres", 1}, {"in", 0.0254}};
    for (size_t k = 0; k < COUNT_OF(units); k++)
        if (!strcasecmp(unit, units[k].name))
            return units[k].metres;
    return 0;
}

// The third line: rates, counts, unit. The rates are not believed: each row has its time.
static void read_unit(char *line, struct motion_points *out)
{
    const char *cell = NULL;
    for (int k = 0; k <= 4; k++)
        cell = next_cell(&line);
    out->metres = cell ? metres_of(cell) : 0;
}

// Names stand above the first of their three columns; the cells between are empty.
static int read_names(const char *line, char (*names)[POINT_NAME_BYTES])
{
    int count = 0;
    const char *at = line;
    for (int column = 0; *at; column++) {
        const size_t length = strcspn(at, "\t"), blank = strspn(at, " ");
        if (column >= 2 && length > blank) {
            if (names) {
                snprintf(names[count], POINT_NAME_BYTES, "%.*s", (int)(length - blank), at + blank);
                text_make_printable(names[count]);
            }
            count++;
        }
        at += length + (at[length] != 0);
    }
    return count;
}

static bool is_blank(const char *line) { return !line[strspn(line, " \t")]; }

// An empty cell, or what is no number, is not known.
static float number_of(const char *cell)
{
    char *end;
    const double value = cell ? strtod(cell, &end) : NAN;
    return cell && *cell && end != cell && isfinite(value) && fabs(value) < 1e9 ? (float)value : NAN;
}

static enum status read_row(struct trc_text *text, char *line, struct motion_points *out, int64_t frame)
{
    char *end = NULL;
    next_cell(&line); // the frame's number
    const char *time = next_cell(&line);
    out->time_s[frame] = time ? strtod(time, &end) : NAN;
    if (!time || end == time || !isfinite(out->time_s[frame]))
        return fail(ERR_INPUT, "%s, line %d: no time in seconds in the second column", text->name, text->line);
    float *at = out->at + 3 * (size_t)frame * (size_t)out->points;
    for (int k = 0; k < 3 * out->points; k++)
        at[k] = number_of(next_cell(&line));
    return OK;
}

// How many rows there are at most. ERR_INPUT: they are too short for so many points, so that a small file would take
// much memory.
static enum status count_rows(const struct trc_text *text, int points, int64_t *rows)
{
    int64_t tabs = 0;
    *rows = 1;
    for (const char *at = text->next; at && *at; at++) {
        *rows += (*at == '\n' || *at == '\r') && at[1] && at[1] != '\n' && at[1] != '\r';
        tabs += *at == '\t';
    }
    if (3 * (int64_t)points * (*rows - 1) > 2 * tabs + 64)
        return fail(ERR_INPUT, "%s has rows that are too short for its %d points", text->name, points);
    return OK;
}

enum status trc_points_read(const char *name, char *text, size_t count, struct motion_points *out)
{
    struct trc_text reader = {.name = name, .next = text};
    out->format = "TRC";
    out->up = UP_Y; // OpenSim's
    if (memchr(text, 0, count))
        return fail(ERR_INPUT, "%s is no text, although it begins as a TRC file does; write it again", name);
    char *line = next_line(&reader);         // what kind of file it is
    line = line ? next_line(&reader) : NULL; // the headings of the next line
    line = line ? next_line(&reader) : NULL;
    if (line)
        read_unit(line, out);
    line = line ? next_line(&reader) : NULL;
    if (!line)
        return fail(ERR_INPUT, "%s ends in its heading; get a whole file", name);
    const int points = read_names(line, NULL);
    if (!points)
        return fail(ERR_INPUT, "%s, line %d names no point; columns have to be separated by tabs", name, reader.line);
    int64_t rows = 0;
    enum status status = count_rows(&reader, points, &rows);
    if (status == OK)
        status = motion_points_make_room(out, name, points, rows);
    if (status != OK)
        return status;
    read_names(line, out->names);
    int64_t frames = 0;
    next_line(&reader); // X1 Y1 Z1 …
    while (status == OK && frames < rows && (line = next_line(&reader)))
        if (!is_blank(line))
            status = read_row(&reader, line, out, frames++);
    if (status == OK && !frames)
        status = fail(ERR_INPUT, "%s is an empty TRC file: it has names, but no row of numbers", name);
    out->frames = frames;
    return status;
}
