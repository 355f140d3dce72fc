// Reading joints-csv files.
#include "compare/joint_samples.h"

#include "base/text.h"
#include "platform/text_file.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

static const char header[] = "timestamp,joint,x_m,y_m,z_m,confidence";

bool is_joints_csv(const char *path)
{
    static const char mark[] = "\xef\xbb\xbf", recording[] = "SQLite format 3";
    char begin[sizeof mark + sizeof header] = "";
    FILE *file = fopen(path, "r");
    if (!file)
        return false;
    const size_t got = fread(begin, 1, sizeof begin - 1, file);
    fclose(file);
    const char *ending = strrchr(path, '.');
    const char *text = begin + (got >= 3 && !memcmp(begin, mark, 3) ? 3 : 0);
    return !strncmp(text, header, sizeof header - 1) ||
           (ending && !strcasecmp(ending, ".csv") && strncmp(begin, recording, sizeof recording - 1));
}

enum { MOST_FIELDS = 8 };

// Cuts a line at its commas. Returns how many fields; more than MOST_FIELDS are one too many.
static int split(char *line, char *field[MOST_FIELDS])
{
    int count = 0;
    for (char *at = line; at; count++) {
        if (count == MOST_FIELDS)
            return MOST_FIELDS + 1;
        field[count] = at;
        at = strchr(at, ',');
        if (at)
            *at++ = 0;
    }
    return count;
}

static bool number(const char *text, double *out)
{
    char *end;
    *out = strtod(text, &end);
    while (*end == ' ' || *end == '\t')
        end++;
    return end != text && !*end;
}

struct csv {
    const char *path;
    int line;
    int fields; // 0 before the header
    struct joint_sample sample;
    bool begun;
    struct joint_samples *out;
};

static enum status flush(struct csv *c)
{
    bool any = false;
    for (int j = 0; j < JOINT_COUNT; j++)
        any = any || c->sample.skeleton.confidence[j] > 0;
    enum status status = OK;
    if (c->begun && any)
        status = joint_samples_add(c->out, &c->sample);
    c->begun = false;
    return status;
}

static enum status take_row(struct csv *c, char *line)
{
    char *field[MOST_FIELDS];
    enum joint joint;
    double time, x[5] = {0, 0, 0, 0, 0};
    if (split(line, field) != c->fields)
        return fail(ERR_INPUT, "%s, line %d: a row has %d fields: %s%s", c->path, c->line, c->fields, header,
                    c->fields > 6 ? ",sigma_m" : "");
    bool good = number(field[0], &time);
    if (!good)
        return fail(ERR_INPUT, "%s, line %d: '%.40s' is no time in seconds", c->path, c->line, field[0]);
    for (int i = 2; i < c->fields; i++)
        if (!number(field[i], &x[i - 2]))
            return fail(ERR_INPUT, "%s, line %d: '%.40s' is no number", c->path, c->line, field[i]);
    // Far from every camera and clock: a damaged row. NaN fails all comparisons.
    if (!(fabs(time) < SECONDS_MOST) || !joint_from_name(field[1], &joint)) {
        c->out->dropped++;
        return OK;
    }
    const int64_t time_ns = (int64_t)(time * 1e9 + (time < 0 ? -0.5 : 0.5));
    enum status status = OK;
    if (c->begun && time_ns != c->sample.time_ns)
        status = flush(c);
    if (!c->begun) {
        c->sample = (struct joint_sample){.time_ns = time_ns};
        c->begun = true;
    }
    if (!(fabs(x[0]) < 1000 && fabs(x[1]) < 1000 && fabs(x[2]) < 1000 && x[3] >= 0 && x[4] >= 0)) {
        c->out->dropped++;
        return status;
    }
    c->sample.skeleton.joint[joint] = v3(x[0], x[1], x[2]);
    c->sample.skeleton.confidence[joint] = (float)fmin(x[3], 1);
    c->sample.sigma_m[joint] = c->fields > 6 ? (float)fmin(x[4], 10) : default_sigma_m((float)x[3]);
    return status;
}

static enum status read_rows(struct csv *c, struct text_file *file)
{
    enum status status = OK;
    for (char *line; status == OK && (line = text_file_line(file));) {
        c->line = file->line;
        if (c->fields) {
            status = take_row(c, line);
            continue;
        }
        const char *rest = line + sizeof header - 1;
        if (strncmp(line, header, sizeof header - 1) || (*rest && strcmp(rest, ",sigma_m")))
            return fail(ERR_INPUT, "%s is neither a recording nor a joints-csv file, whose first line is %s", c->path,
                        header);
        c->fields = *rest ? 7 : 6;
    }
    return status == OK ? flush(c) : status;
}

enum status joint_samples_read_csv(const char *path, struct joint_samples *out)
{
    struct text_file file;
    *out = (struct joint_samples){0};
    struct csv c = {.path = path, .out = out};
    enum status status = text_file_open(&file, path);
    if (status == OK) {
        status = read_rows(&c, &file);
        text_file_close(&file);
    }
    if (status == OK && !out->count)
        status = fail(ERR_INPUT, "%s holds no joint that is known at any time", path);
    out->sigma_given = c.fields > 6;
    if (status == OK)
        joint_samples_start_at_zero(out);
    else
        joint_samples_free(out);
    return status;
}
