// Reading joints-csv files.
#include "compare/joint_axes.h"
#include "compare/joint_rows.h"

#include "base/text.h"
#include "formats/joints_csv.h"
#include "platform/files/text_file.h"

#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

static const char header[] = JOINTS_CSV_HEADER;

bool is_joints_csv(const char *path)
{
    static const char mark[] = "\xef\xbb\xbf", recording[] = "SQLite format 3";
    char begin[256] = "";
    FILE *file = fopen(path, "r");
    if (!file)
        return false;
    const size_t got = fread(begin, 1, sizeof begin - 1, file);
    fclose(file);
    const char *ending = strrchr(path, '.');
    const char *text = begin + (got >= 3 && !memcmp(begin, mark, 3) ? 3 : 0);
    return !strncmp(text, header, sizeof header - 1) ||
           !strncasecmp(text, JOINTS_CSV_MARK, sizeof JOINTS_CSV_MARK - 1) ||
           (ending && !strcasecmp(ending, ".csv") && strncmp(begin, recording, sizeof recording - 1));
}

enum { MOST_FIELDS = 8 };

// Cuts a line at its commas. Returns how many fields; more than MOST_FIELDS are one too many. Blanks round a field are
// not part of it.
static int split(char *line, char *field[MOST_FIELDS])
{
    int count = 0;
    for (char *at = line; at; count++) {
        if (count == MOST_FIELDS)
            return MOST_FIELDS + 1;
        at += strspn(at, " \t");
        field[count] = at;
        char *end = strchr(at, ',');
        at = end ? end + 1 : NULL;
        end = end ? end : field[count] + strlen(field[count]);
        while (end > field[count] && (end[-1] == ' ' || end[-1] == '\t'))
            end--;
        *end = 0;
    }
    return count;
}

// What other programs write for a number that there is none of: NaN, and nothing at all.
static bool is_none(const char *text)
{
    static const char *const none[] = {"", "nan", "-nan", "inf", "-inf", "+inf", "infinity", "-infinity", "na", "null"};
    for (size_t i = 0; i < COUNT_OF(none); i++)
        if (!strcasecmp(text, none[i]))
            return true;
    return false;
}

static bool number(const char *text, double *out)
{
    if (text_number(text + (*text == '+'), out))
        return true;
    *out = NAN;
    return is_none(text);
}

struct csv {
    const char *path;
    int line;
    int fields; // 0 before the header
    int axes;   // enum joints_csv_axes; -1: the file does not say them
    struct joint_rows rows;
    int64_t dropped, strange; // rows without finite numbers or of no joint; of these: of no joint
    char strange_name[48];    // the first of them
    int strange_line;
    bool named; // some row has a joint's name
};

// "Left Elbow", "leftElbow", "LEFT-ELBOW" are left_elbow.
static bool joint_of(const char *name, enum joint *out)
{
    if (joint_from_name(name, out))
        return true;
    for (int j = 0; j < JOINT_COUNT; j++) {
        const char *a = name, *b = joint_name((enum joint)j);
        for (;;) {
            a += strspn(a, " _-.");
            b += strspn(b, "_");
            if (!*a || tolower((unsigned char)*a) != *b)
                break;
            a++;
            b++;
        }
        if (!*a && !*b) {
            *out = (enum joint)j;
            return true;
        }
    }
    return false;
}

static const char *joints_known(char out[320])
{
    *out = 0;
    for (int j = 0; j < JOINT_COUNT; j++)
        snprintf(out + strlen(out), 320 - strlen(out), "%s%s", j ? ", " : "", joint_name((enum joint)j));
    return out;
}

static void take_strange(struct csv *c, const char *name)
{
    if (!c->strange++) {
        snprintf(c->strange_name, sizeof c->strange_name, "%s", name);
        c->strange_line = c->line;
    }
    c->dropped++;
}

enum { LARGEST = 100000000 }; // 100 km in millimetres: beyond it a row is damaged

static enum status take_row(struct csv *c, char *line)
{
    char *field[MOST_FIELDS];
    enum joint joint;
    double time, x[5] = {0, 0, 0, 0, -1};
    if (split(line, field) != c->fields)
        return fail(ERR_INPUT, "%s, line %d: a row has %d fields: %s%s", c->path, c->line, c->fields, header,
                    c->fields > 6 ? JOINTS_CSV_SIGMA : "");
    if (!*field[0] || !number(field[0], &time))
        return fail(ERR_INPUT, "%s, line %d: '%.40s' is no time in seconds", c->path, c->line, field[0]);
    for (int i = 2; i < c->fields; i++)
        if (!number(field[i], &x[i - 2]))
            return fail(ERR_INPUT, "%s, line %d: '%.40s' is no number", c->path, c->line, field[i]);
    if (!joint_of(field[1], &joint)) {
        take_strange(c, field[1]);
        return OK;
    }
    c->named = true;
    if (c->fields > 6 && !*field[6])
        x[4] = -1;
    else if (c->fields > 6 && x[4] < 0)
        x[4] = NAN;
    if (!*field[2] && !*field[3] && !*field[4]) // not seen
        return OK;
    // Far from every camera and clock: a damaged row. NaN fails all comparisons.
    if (!(fabs(time) < SECONDS_MOST * 1e9) || !(fabs(x[0]) < LARGEST && fabs(x[1]) < LARGEST && fabs(x[2]) < LARGEST) ||
        !(x[3] >= 0) || isnan(x[4])) {
        c->dropped++;
        return OK;
    }
    const struct joint_row row = {time, v3(x[0], x[1], x[2]), (float)fmin(x[3], 1), (float)x[4], (uint8_t)joint};
    return row.confidence > 0 ? joint_rows_add(&c->rows, &row) : OK;
}

// The comments before the header may say the axes.
static enum status read_axes(struct csv *c, const struct text_file *file)
{
    c->axes = -1;
    for (const char *at = file->next; *at; at += strcspn(at, "\n"), at += *at == '\n') {
        const char *line = at + strspn(at, " \t\r");
        if (*line && *line != '\n' && *line != '#')
            return OK;
        if (strncasecmp(line, JOINTS_CSV_MARK, sizeof JOINTS_CSV_MARK - 1))
            continue;
        line += sizeof JOINTS_CSV_MARK - 1;
        line += strspn(line, " \t");
        char said[32];
        snprintf(said, sizeof said, "%.*s", (int)strcspn(line, " \t,;\r\n"), line);
        for (int k = 0; k < JOINTS_CSV_AXES && c->axes < 0; k++)
            if (!strcasecmp(said, joints_csv_axes_names[k]))
                c->axes = k;
        if (c->axes < 0)
            return fail(ERR_INPUT,
                        "%s has the axes '%s'; known are camera (y down) and room (z up); without the line they are "
                        "found out",
                        c->path, said);
    }
    return OK;
}

static enum status read_rows(struct csv *c, struct text_file *file)
{
    enum status status = read_axes(c, file);
    for (char *line; status == OK && (line = text_file_line(file));) {
        c->line = file->line;
        if (c->fields) {
            status = take_row(c, line);
            continue;
        }
        const char *rest = line + sizeof header - 1;
        if (strncmp(line, header, sizeof header - 1) || (*rest && strcmp(rest, JOINTS_CSV_SIGMA)))
            return fail(ERR_INPUT, "%s is neither a recording nor a joints-csv file, whose first line is %s", c->path,
                        header);
        c->fields = *rest ? 7 : 6;
    }
    return status;
}

static enum status check_names(const struct csv *c, struct joint_notes *notes)
{
    char known[320];
    if (c->strange && !c->named)
        return fail(ERR_INPUT, "%s, line %d: '%s' is no joint's name; known are %s", c->path, c->strange_line,
                    c->strange_name, joints_known(known));
    if (c->strange)
        joint_note(notes, "'%s' in line %d is no joint's name; %lld such rows were left out", c->strange_name,
                   c->strange_line, (long long)c->strange);
    return OK;
}

// The rows of each time as a sample.
static enum status make_samples(struct csv *c, const struct joint_units *units, struct joint_samples *out)
{
    const struct joint_rows *r = &c->rows;
    enum status status = OK;
    for (int64_t i = 0, end; i < r->count && status == OK; i = end) {
        end = joint_rows_group(r, i);
        const double time_s = r->at[i].time * units->seconds;
        if (!(fabs(time_s) < SECONDS_MOST)) {
            out->dropped += end - i;
            continue;
        }
        struct joint_sample sample = {.time_ns = (int64_t)(time_s * 1e9 + (time_s < 0 ? -0.5 : 0.5))};
        for (int64_t k = i; k < end; k++) {
            const struct joint_row *row = &r->at[k];
            sample.skeleton.joint[row->joint] = v3_scale(row->place, units->metres);
            sample.skeleton.confidence[row->joint] = row->confidence;
            sample.sigma_m[row->joint] =
                row->sigma < 0 ? default_sigma_m(row->confidence) : (float)fmin(row->sigma * units->metres, 10);
        }
        status = joint_samples_add(out, &sample);
    }
    return status;
}

static enum status settle(struct csv *c, struct joint_samples *out)
{
    struct joint_units units;
    enum status status = check_names(c, &out->notes);
    if (status == OK)
        status = joint_rows_sort(&c->rows, &out->notes);
    if (status == OK)
        joint_rows_drop_zeros(&c->rows, &out->notes);
    if (status == OK && !c->rows.count)
        status = fail(ERR_INPUT, "%s holds no joint that is known at any time", c->path);
    if (status == OK)
        status = joint_rows_units(&c->rows, c->path, &units, &out->notes);
    if (status == OK)
        status = make_samples(c, &units, out);
    joint_rows_free(&c->rows);
    if (status == OK && !out->count)
        status = fail(ERR_INPUT, "%s holds no joint that is known at any time", c->path);
    return status == OK ? joint_axes_settle(out, c->path, c->axes) : status;
}

enum status joint_samples_read_csv(const char *path, struct joint_samples *out)
{
    struct text_file file;
    *out = (struct joint_samples){0};
    struct csv c = {.path = path};
    enum status status = text_file_open(&file, path);
    if (status == OK) {
        status = read_rows(&c, &file);
        text_file_close(&file);
    }
    out->dropped = c.dropped;
    if (status == OK)
        status = settle(&c, out);
    joint_rows_free(&c.rows);
    out->sigma_given = c.fields > 6;
    if (status == OK)
        joint_samples_start_at_zero(out);
    else
        joint_samples_free(out);
    return status;
}
