#include "recording/exact_schema.h"

#include "base/text.h"
#include "recording/recording_schema.h"

#include <ctype.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

// Part of an SQL text.
struct span {
    const char *at;
    size_t count;
};

// All that there is to make, in the words in which it is made.
static const char *made(int i)
{
    const char *const texts[] = {recording_tables, PREPARED_TABLE, VERDICT_TABLE, THING_TABLES, DRIVE_TABLE};
    return i < (int)COUNT_OF(texts) ? texts[i] : NULL;
}

static bool is_blank(char c) { return isspace((unsigned char)c) != 0; }

static struct span trimmed(struct span s)
{
    while (s.count && is_blank(s.at[0])) {
        s.at++;
        s.count--;
    }
    while (s.count && is_blank(s.at[s.count - 1]))
        s.count--;
    return s;
}

// The same words, however far apart.
static bool same_words(struct span one, struct span other)
{
    size_t i = 0, k = 0;
    while (i < one.count && k < other.count) {
        const bool blank = is_blank(one.at[i]);
        if (blank != is_blank(other.at[k]) || (!blank && one.at[i] != other.at[k]))
            return false;
        i++;
        k++;
        while (blank && i < one.count && is_blank(one.at[i]))
            i++;
        while (blank && k < other.count && is_blank(other.at[k]))
            k++;
    }
    return i == one.count && k == other.count;
}

// Takes the next column off the list. False: there is none.
static bool next_column(struct span *list, struct span *column)
{
    if (!list->count)
        return false;
    const char *comma = memchr(list->at, ',', list->count);
    const size_t count = comma ? (size_t)(comma - list->at) : list->count;
    *column = trimmed((struct span){list->at, count});
    list->at += count + (comma != NULL);
    list->count -= count + (comma != NULL);
    return true;
}

static bool has_column(struct span list, struct span wanted)
{
    struct span column;
    while (next_column(&list, &column))
        if (same_words(column, wanted))
            return true;
    return false;
}

static int count_columns(struct span list)
{
    struct span column;
    int count = 0;
    while (next_column(&list, &column))
        count++;
    return count;
}

static bool may_lack(const char *table, struct span column)
{
    char name[64];
    size_t count = 0;
    while (count < column.count && !is_blank(column.at[count]))
        count++;
    snprintf(name, sizeof name, "%.*s", (int)count, column.at);
    return recording_column_is_optional(table, name);
}

// Both begin with the same column; each of the file's is one that is made, and once; what it lacks is optional.
static bool same_columns(const char *table, struct span given, struct span wanted)
{
    struct span first_given = {0}, first_wanted = {0}, column, rest = wanted;
    struct span g = given, w = wanted;
    if (!next_column(&g, &first_given) || !next_column(&w, &first_wanted) || !same_words(first_given, first_wanted))
        return false;
    int found = 0;
    while (next_column(&rest, &column)) {
        const bool there = has_column(given, column);
        if (!there && !may_lack(table, column))
            return false;
        found += there;
    }
    return found == count_columns(given); // a name that is there twice is refused by SQLite
}

// What stands in the outer parentheses of "CREATE TABLE name(...)", where that is all.
static bool columns_of(const char *sql, const char *begin, const char *name, struct span *out)
{
    const size_t length = strlen(begin), name_length = strlen(name), count = strlen(sql);
    if (count < length + name_length + 2 || strncmp(sql, begin, length) || strncmp(sql + length, name, name_length) ||
        sql[length + name_length] != '(' || sql[count - 1] != ')')
        return false;
    out->at = sql + length + name_length + 1;
    out->count = count - length - name_length - 2;
    return true;
}

// The columns as these programs make the table. False: they make none of that name.
static bool find_made(const char *name, struct span *out)
{
    static const char create[] = "CREATE TABLE ", if_none[] = "IF NOT EXISTS ";
    const size_t name_length = strlen(name);
    for (int i = 0; made(i); i++)
        for (const char *at = made(i); (at = strstr(at, create)) != NULL;) {
            at += sizeof create - 1;
            at += strncmp(at, if_none, sizeof if_none - 1) ? 0 : sizeof if_none - 1;
            if (strncmp(at, name, name_length) || at[name_length] != '(')
                continue;
            const char *end = strstr(at, ");");
            *out = (struct span){at + name_length + 1, end ? (size_t)(end - at) - name_length - 1 : 0};
            return end != NULL;
        }
    return false;
}

static bool is_made_table(const char *name, const char *sql)
{
    struct span given, wanted;
    return find_made(name, &wanted) && columns_of(sql, "CREATE TABLE ", name, &given) &&
           same_columns(name, given, wanted);
}

enum status exact_schema_check(struct database *db)
{
    struct statement *s;
    char name[80] = "";
    bool exact = true;
    enum status status = statement_open(&s, db, "SELECT type, name, sql FROM sqlite_schema ORDER BY rowid");
    while (status == OK && exact && (status = statement_step(s)) == OK) {
        const char *type = statement_text(s, 0);
        snprintf(name, sizeof name, "%s", statement_text(s, 1));
        const char *sql = statement_text(s, 2);
        exact = (!strcmp(type, "table") && is_made_table(name, sql)) ||
                (!strcmp(type, "view") && database_is_mark(name, sql));
        if (!exact && statement_check(s) != OK)
            status = statement_check(s);
    }
    statement_close(&s);
    text_make_printable(name);
    if (exact || status < OK)
        return status == NOTHING ? OK : status;
    return fail(ERR_CORRUPT,
                "%s is not as this program makes recordings ('%s' is of another program, a newer one or damaged), so "
                "it is only read: reenact-capture repair copies what is in it into a new file",
                database_path(db), name);
}

enum status recording_check_tables(struct database *db)
{
    int64_t application = 0, schema = 0, tables = 0;
    enum status status = database_number(db, "PRAGMA application_id", &application);
    if (status == OK)
        status = database_number(db, "PRAGMA user_version", &schema);
    if (status != OK)
        return status;
    struct stat about;
    if (application != RECORDING_APPLICATION)
        return fail(ERR_FORMAT, "%s is not a recording: it is %s", database_path(db),
                    !stat(database_path(db), &about) && !about.st_size ? "empty" : "another program's database");
    if (schema > RECORDING_SCHEMA)
        return fail(ERR_FORMAT, "%s has schema %lld and this program knows schemas up to %d; use a newer program",
                    database_path(db), (long long)schema, RECORDING_SCHEMA);
    if (schema < 1)
        return fail(ERR_CORRUPT, "%s has no valid schema number (%lld)", database_path(db), (long long)schema);
    status = database_number(db, COUNT_TABLES("'place', 'place_view', 'take', 'frame', 'picture'"), &tables);
    if (status == OK && tables != 5)
        status = fail(ERR_CORRUPT, "%s is damaged: %lld of the 5 tables of a recording are there", database_path(db),
                      (long long)tables);
    return status == OK && database_may_write(db) ? exact_schema_check(db) : status;
}
