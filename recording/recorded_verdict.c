#include "recording/recorded_verdict.h"

#include "base/text.h"
#include "recording/prepared.h"
#include "recording/recording_reader.h"
#include "recording/recording_schema.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

// ------------------------------------------------------------- in words

static const char *const purpose_names[PURPOSE_COUNT] = {"both", "compare", "watch"};

const char *verdict_purpose_name(enum verdict_purpose purpose) { return purpose_names[purpose]; }

bool verdict_purpose_named(const char *name, enum verdict_purpose *out)
{
    for (int i = 0; i < PURPOSE_COUNT; i++)
        if (!strcmp(name, purpose_names[i])) {
            *out = (enum verdict_purpose)i;
            return true;
        }
    return false;
}

void verdict_say(struct take_verdict *verdict, unsigned spoils, const char *format, ...)
{
    va_list list;
    verdict->spoilt |= spoils;
    if (verdict->count >= VERDICT_LINES)
        return;
    struct verdict_line *line = &verdict->line[verdict->count++];
    *line = (struct verdict_line){.spoils = spoils};
    va_start(list, format);
    vsnprintf(line->text, sizeof line->text, format, list);
    va_end(list);
}

bool verdict_is_good_for(const struct take_verdict *verdict, enum verdict_use use)
{
    return verdict->seen && !(verdict->spoilt & use);
}

bool verdict_is_good(const struct take_verdict *verdict)
{
    return verdict_is_good_for(verdict, verdict->purpose == PURPOSE_WATCH ? USE_WATCH : USE_COMPARE);
}

const char *verdict_headline(const struct take_verdict *verdict)
{
    if (!verdict->seen)
        return "no person was seen";
    if (!verdict_is_good(verdict))
        return verdict->purpose == PURPOSE_BOTH && verdict_is_good_for(verdict, USE_WATCH) ? "good from all sides"
                                                                                           : "better once more";
    switch (verdict->purpose) {
    case PURPOSE_COMPARE: return "good for comparing";
    case PURPOSE_WATCH: return "good from all sides";
    default: return verdict_is_good_for(verdict, USE_WATCH) ? "good" : "good for comparing";
    }
}

bool verdict_shows_line(const struct take_verdict *verdict, int i)
{
    const unsigned spoils = verdict->line[i].spoils;
    return !spoils || verdict->purpose == PURPOSE_BOTH ||
           (spoils & (verdict->purpose == PURPOSE_WATCH ? USE_WATCH : USE_COMPARE));
}

const char *verdict_text(const struct take_verdict *verdict, char out[VERDICT_TEXT_BYTES])
{
    int used = snprintf(out, VERDICT_TEXT_BYTES, "%s", verdict_headline(verdict));
    for (int i = 0; i < verdict->count; i++)
        if (verdict_shows_line(verdict, i))
            used += snprintf(out + used, (size_t)(VERDICT_TEXT_BYTES - used), "; %s", verdict->line[i].text);
    return out;
}

// ------------------------------------------------------------- in the file

// A line of `lines`: the digit `spoils`, '*' where it was only seen while filming, else ' ', then the sentence.
enum { LINE_HEAD = 2, LINES_BYTES = VERDICT_LINES * (LINE_HEAD + VERDICT_LINE_BYTES) };

static void put_lines(const struct take_verdict *verdict, char out[LINES_BYTES])
{
    int used = 0;
    *out = 0;
    for (int i = 0; i < verdict->count; i++)
        used += snprintf(out + used, (size_t)(LINES_BYTES - used), "%s%u%c%s", i ? "\n" : "", verdict->line[i].spoils,
                         verdict->line[i].filming ? '*' : ' ', verdict->line[i].text);
}

static bool get_lines(const char *text, struct take_verdict *verdict)
{
    verdict->count = 0;
    while (*text) {
        const size_t length = strcspn(text, "\n");
        if (verdict->count >= VERDICT_LINES || length <= LINE_HEAD || length >= LINE_HEAD + VERDICT_LINE_BYTES ||
            text[0] < '0' || text[0] > '0' + USE_ANY || (text[1] != ' ' && text[1] != '*'))
            return false;
        struct verdict_line *line = &verdict->line[verdict->count++];
        line->spoils = (unsigned)(text[0] - '0');
        line->filming = text[1] == '*';
        snprintf(line->text, sizeof line->text, "%.*s", (int)length - LINE_HEAD, text + LINE_HEAD);
        if (!text_is_printable(line->text))
            return false;
        text += length + (text[length] == '\n');
    }
    return true;
}

static uint32_t row_crc(const struct verdict_key *key, const struct take_verdict *verdict, const char *lines)
{
    const int64_t numbers[] = {key->take, verdict->purpose, verdict->seen, verdict->spoilt, key->index_crc};
    uint32_t crc = 0;
    for (size_t i = 0; i < COUNT_OF(numbers); i++)
        crc = crc32_of_number(crc, numbers[i]);
    return crc32_of(crc, lines, strlen(lines));
}

struct verdict_key verdict_key_of(const struct take *take)
{
    return (struct verdict_key){take_id(take), take_index_crc(take)};
}

// False: the row is not as it was written.
static bool from_row(struct statement *statement, struct verdict_key *key, struct take_verdict *out)
{
    const int64_t purpose = statement_number(statement, 1), seen = statement_number(statement, 2),
                  spoilt = statement_number(statement, 3);
    const char *lines = statement_text(statement, 5);
    *out = (struct take_verdict){.purpose = PURPOSE_BOTH};
    *key = (struct verdict_key){statement_number(statement, 0), (uint32_t)statement_number(statement, 4)};
    if (purpose < 0 || purpose >= PURPOSE_COUNT || seen < 0 || seen > 1 || spoilt < 0 || spoilt > USE_ANY)
        return false;
    out->purpose = (enum verdict_purpose)purpose;
    out->seen = seen != 0;
    out->spoilt = (unsigned)spoilt;
    return row_crc(key, out, lines) == (uint32_t)statement_number(statement, 6) && get_lines(lines, out);
}

static enum status read_open(struct statement **statement, struct database *db, const char *tail)
{
    char sql[160];
    int64_t tables = 0;
    *statement = NULL;
    enum status status = database_number(db, COUNT_TABLES("'verdict'"), &tables);
    if (status != OK || !tables)
        return status == OK ? NOTHING : status;
    snprintf(sql, sizeof sql, "SELECT rowid, purpose, seen, spoilt, index_crc, lines, crc FROM verdict %s", tail);
    return statement_open(statement, db, sql);
}

enum status recorded_verdict_read(const struct take *take, struct take_verdict *out, bool *fits)
{
    struct statement *s;
    struct verdict_key kept;
    *fits = false;
    enum status status = read_open(&s, recording_database(take_recording(take)), "WHERE rowid = ?");
    if (status == OK) {
        statement_bind_number(s, 1, take_id(take));
        status = statement_step(s);
    }
    if (status == OK && !from_row(s, &kept, out))
        status = NOTHING;
    if (status == OK)
        *fits = kept.index_crc == take_index_crc(take);
    statement_close(&s);
    return status == ERR_CORRUPT || status == ERR_FORMAT ? NOTHING : status;
}

enum status recorded_verdict_check(struct recording *recording, int64_t *damaged)
{
    struct statement *s;
    struct verdict_key key;
    struct take_verdict v;
    *damaged = 0;
    enum status status = read_open(&s, recording_database(recording), "WHERE rowid IN (SELECT rowid FROM take)");
    while (status == OK && (status = statement_step(s)) == OK)
        *damaged += !from_row(s, &key, &v);
    statement_close(&s);
    return status == NOTHING ? OK : status;
}

struct kept {
    const struct verdict_key *key;
    const struct take_verdict *verdict;
};

static enum status insert_verdict(struct database *db, const void *what)
{
    const struct kept *k = what;
    char lines[LINES_BYTES];
    struct statement *s;
    put_lines(k->verdict, lines);
    enum status status = statement_open(&s, db,
                                        "INSERT OR REPLACE INTO verdict(id, purpose, seen, spoilt, index_crc, lines, "
                                        "crc) VALUES(?,?,?,?,?,?,?)");
    if (status == OK) {
        statement_bind_number(s, 1, k->key->take);
        statement_bind_number(s, 2, k->verdict->purpose);
        statement_bind_number(s, 3, k->verdict->seen);
        statement_bind_number(s, 4, k->verdict->spoilt);
        statement_bind_number(s, 5, k->key->index_crc);
        statement_bind_text(s, 6, lines);
        statement_bind_number(s, 7, row_crc(k->key, k->verdict, lines));
        status = statement_run(s);
    }
    statement_close(&s);
    return status;
}

enum status recorded_verdict_copy(struct database *from, int64_t take, struct database *to, int64_t copy)
{
    struct statement *s;
    struct verdict_key key;
    struct take_verdict v;
    enum status status = read_open(&s, from, "WHERE rowid = ?");
    if (status == OK) {
        statement_bind_number(s, 1, take);
        status = statement_step(s);
    }
    if (status == OK && !from_row(s, &key, &v))
        status = NOTHING;
    statement_close(&s);
    if (status == OK)
        status = database_run(to, VERDICT_TABLE);
    if (status == OK) {
        key.take = copy;
        status = insert_verdict(to, &(struct kept){&key, &v});
    }
    return status == ERR_IO || status == ERR_MEMORY ? status : OK;
}

enum status recorded_verdict_write(const char *path, const struct verdict_key *key, const struct take_verdict *verdict)
{
    const struct kept kept = {key, verdict};
    return recording_change(path, VERDICT_TABLE, insert_verdict, &kept);
}
