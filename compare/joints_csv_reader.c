// Reading joints-csv files.
#include "base/text.h"
#include "compare/joint_rows.h"
#include "formats/joints_csv.h"
#include "platform/files/text_file.h"

#include <ctype.h>
#include <stdio.h>
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

enum { MAX_FIELDS = 8 };

// Cuts a line at its commas. Returns how many fields; more than MAX_FIELDS are one too many. Blanks round a field are
// not part of it.
static int split_fields(char *line, char *field[MAX_FIELDS])
{
    int count = 0;
    for (char *at = line; at; count++) {
        if (count == MAX_FIELDS)
            return MAX_FIELDS + 1;
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

static bool parse_number(const char *text, double *out)
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

static void take_strange(struct csv *csv, const char *name)
{
    if (!csv->strange++) {
        snprintf(csv->strange_name, sizeof csv->strange_name, "%s", name);
        csv->strange_line = csv->line;
    }
    csv->dropped++;
}

enum { LARGEST = 100000000 }; // 100 km in millimetres: beyond it a row is damaged

static enum status take_row(struct csv *csv, char *line)
{
    char *field[MAX_FIELDS];
    enum joint joint;
    double time, x[5] = {0, 0, 0, 0, -1};
    if (split_fields(line, field) != csv->fields)
        return fail(ERR_INPUT, "%s, line %d: a row has %d fields: %s%s", csv->path, csv->line, csv->fields, header,
                    csv->fields > 6 ? JOINTS_CSV_SIGMA : "");
    if (!*field[0] || !parse_number(field[0], &time))
        return fail(ERR_INPUT, "%s, line %d: '%.40s' is no time in seconds", csv->path, csv->line, field[0]);
    for (int i = 2; i < csv->fields; i++)
        if (!parse_number(field[i], &x[i - 2]))
            return fail(ERR_INPUT, "%s, line %d: '%.40s' is no number", csv->path, csv->line, field[i]);
    if (!joint_of(field[1], &joint)) {
        take_strange(csv, field[1]);
        return OK;
    }
    csv->named = true;
    if (csv->fields > 6 && !*field[6])
        x[4] = -1;
    else if (csv->fields > 6 && x[4] < 0)
        x[4] = NAN;
    if (!*field[2] && !*field[3] && !*field[4]) // not seen
        return OK;
    // Far from every camera and clock: a damaged row. NaN fails all comparisons.
    if (!(fabs(time) < SECONDS_MAX * 1e9) || !(fabs(x[0]) < LARGEST && fabs(x[1]) < LARGEST && fabs(x[2]) < LARGEST) ||
        !(x[3] >= 0) || isnan(x[4])) {
        csv->dropped++;
        return OK;
    }
    const struct joint_row row = {time, v3(x[0], x[1], x[2]), (float)fmin(x[3], 1), (float)x[4], (uint8_t)joint};
    return row.confidence > 0 ? joint_rows_add(&csv->rows, &row) : OK;
}

// The comments before the header may say the axes.
static enum status read_axes(struct csv *csv, const struct text_file *file)
{
    csv->axes = JOINTS_UNSAID;
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
        for (int k = 0; k < JOINTS_CSV_AXES && csv->axes < 0; k++)
            if (!strcasecmp(said, joints_csv_axes_names[k]))
                csv->axes = k;
        if (csv->axes < 0)
            return fail(ERR_INPUT,
                        "%s has the axes '%s'; known are camera (y down) and room (z up); without the line they are "
                        "found out",
                        csv->path, said);
    }
    return OK;
}

static enum status read_rows(struct csv *csv, struct text_file *file)
{
    enum status status = read_axes(csv, file);
    for (char *line; status == OK && (line = text_file_line(file));) {
        csv->line = file->line;
        if (csv->fields) {
            status = take_row(csv, line);
            continue;
        }
        const char *rest = line + sizeof header - 1;
        if (strncmp(line, header, sizeof header - 1) || (*rest && strcmp(rest, JOINTS_CSV_SIGMA)))
            return fail(ERR_INPUT, "%s is neither a recording nor a joints-csv file, whose first line is %s", csv->path,
                        header);
        csv->fields = *rest ? 7 : 6;
    }
    return status;
}

static enum status check_names(const struct csv *csv, struct joint_notes *notes)
{
    char known[320];
    if (csv->strange && !csv->named)
        return fail(ERR_INPUT, "%s, line %d: '%s' is no joint's name; known are %s", csv->path, csv->strange_line,
                    csv->strange_name, joints_known(known));
    if (csv->strange)
        joint_note(notes, "'%s' in line %d is no joint's name; %lld such rows were left out", csv->strange_name,
                   csv->strange_line, (long long)csv->strange);
    return OK;
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
        status = check_names(&c, &out->notes);
    if (status == OK)
        status = joint_rows_samples(&c.rows, path, out);
    if (status == OK)
        status = joint_axes_settle(out, path, c.axes);
    joint_rows_free(&c.rows);
    out->sigma_given = c.fields > 6;
    if (status == OK)
        joint_samples_start_at_zero(out);
    else
        joint_samples_free(out);
    return status;
}
