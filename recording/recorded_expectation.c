#include "recording/recorded_expectation.h"

#include "recording/little_endian.h"
#include "recording/recording_reader.h"
#include "recording/recording_schema.h"

#include <stdio.h>

enum { NUMBERS_BYTES = PART_COUNT * 8 + 2 + 2 * 8, ALL_PARTS = (1 << PART_COUNT) - 1 };

// ------------------------------------------------------------- values

bool take_expectation_is_empty(const struct take_expectation *expectation)
{
    bool given = expectation->ignored || expectation->from_ns != expectation->to_ns || expectation->reference_count;
    for (int p = 0; p < PART_COUNT; p++)
        given = given || expectation->tolerance_rad[p] > 0;
    return !given;
}

static bool is_good(const struct take_expectation *expectation)
{
    bool good = !(expectation->ignored & ~ALL_PARTS) && expectation->ignored != ALL_PARTS &&
                expectation->from_ns <= expectation->to_ns && expectation->reference_count >= 0 &&
                expectation->reference_count <= EXPECTATION_REFERENCES_MAX;
    for (int p = 0; p < PART_COUNT; p++)
        good = good && expectation->tolerance_rad[p] >= 0 &&
               expectation->tolerance_rad[p] <= TOLERANCE_MAX_RAD; // false for NaN
    for (int i = 0; good && i < expectation->reference_count; i++)
        good = take_id_is_valid(expectation->reference[i]);
    return good;
}

int64_t take_number(const struct take *take) { return take_id(take); }

int64_t recording_take_number(const struct recording *recording, const char *name)
{
    const int index = recording_find_take(recording, name);
    return index < 0 ? -1 : recording_take_id(recording, index);
}

const char *recording_numbered_take(const struct recording *recording, int64_t number)
{
    for (int i = 0; i < recording_take_count(recording); i++)
        if (recording_take_id(recording, i) == number)
            return recording_take_name(recording, i);
    return NULL;
}

// ------------------------------------------------------------- a row

struct row {
    int64_t take;
    struct take_expectation expectation;
};

static void put_numbers(uint8_t out[NUMBERS_BYTES], const struct take_expectation *expectation)
{
    for (int p = 0; p < PART_COUNT; p++)
        out = put_f64(out, expectation->tolerance_rad[p]);
    put_u64(put_u64(put_u16(out, expectation->ignored), (uint64_t)expectation->from_ns), (uint64_t)expectation->to_ns);
}

static uint32_t row_crc(int64_t take, const uint8_t *numbers, const uint8_t *takes, size_t takes_bytes)
{
    return crc32_of(crc32_of(crc32_of_number(0, take), numbers, NUMBERS_BYTES), takes, takes_bytes);
}

// False: the row is not as it was written.
static bool from_row(struct statement *statement, struct row *out)
{
    size_t bytes;
    const uint8_t *numbers = recording_blob(statement, 1, NUMBERS_BYTES), *takes = statement_blob(statement, 2, &bytes);
    struct take_expectation *e = &out->expectation;
    *out = (struct row){.take = statement_number(statement, 0)};
    if (!numbers || bytes % 8 || bytes > EXPECTATION_REFERENCES_MAX * 8 ||
        row_crc(out->take, numbers, takes, bytes) != (uint32_t)statement_number(statement, 3))
        return false;
    for (int p = 0; p < PART_COUNT; p++)
        e->tolerance_rad[p] = get_f64(&numbers);
    e->ignored = get_u16(&numbers);
    e->from_ns = (int64_t)get_u64(&numbers);
    e->to_ns = (int64_t)get_u64(&numbers);
    e->reference_count = (int)(bytes / 8);
    for (int i = 0; i < e->reference_count; i++)
        e->reference[i] = (int64_t)get_u64(&takes);
    return is_good(e);
}

static enum status read_open(struct statement **statement, struct database *db, const char *tail)
{
    char sql[160];
    int64_t tables = 0;
    *statement = NULL;
    enum status status = database_number(db, COUNT_TABLES("'expectation'"), &tables); // older files lack it
    if (status != OK || !tables)
        return status == OK ? NOTHING : status;
    snprintf(sql, sizeof sql, "SELECT rowid, numbers, takes, crc FROM expectation %s", tail);
    return statement_open(statement, db, sql);
}

// NOTHING: there is no row. ERR_CORRUPT, without a sentence: it cannot be read.
static enum status read_row(struct database *db, int64_t take, struct row *out)
{
    struct statement *s;
    enum status status = read_open(&s, db, "WHERE rowid = ?");
    if (status == OK) {
        statement_bind_number(s, 1, take);
        status = statement_step(s);
    }
    if (status == OK && !from_row(s, out))
        status = ERR_CORRUPT;
    statement_close(&s);
    return status;
}

enum status recorded_expectation_read(const struct take *take, struct take_expectation *out)
{
    struct row row;
    struct recording *r = take_recording(take);
    *out = (struct take_expectation){0};
    enum status status = read_row(recording_database(r), take_id(take), &row);
    if (status == OK)
        *out = row.expectation;
    return status == ERR_CORRUPT ? recording_damaged(r, "what is expected of a take cannot be read") : status;
}

enum status recorded_expectation_check(struct recording *recording, int64_t *damaged)
{
    struct statement *s;
    struct row row;
    *damaged = 0;
    enum status status = read_open(&s, recording_database(recording), "WHERE rowid IN (SELECT rowid FROM take)");
    while (status == OK && (status = statement_step(s)) == OK)
        *damaged += !from_row(s, &row);
    statement_close(&s);
    return status == NOTHING ? OK : status;
}

// ------------------------------------------------------------- changing

static enum status delete_row(struct database *db, int64_t take)
{
    struct statement *s;
    enum status status = statement_open(&s, db, "DELETE FROM expectation WHERE rowid = ?");
    if (status == OK) {
        statement_bind_number(s, 1, take);
        status = statement_run(s);
    }
    statement_close(&s);
    return status;
}

static enum status put_row(struct database *db, const void *what)
{
    const struct row *row = what;
    const struct take_expectation *e = &row->expectation;
    uint8_t numbers[NUMBERS_BYTES], takes[EXPECTATION_REFERENCES_MAX * 8];
    const size_t bytes = (size_t)e->reference_count * 8;
    struct statement *s;
    if (take_expectation_is_empty(e))
        return delete_row(db, row->take);
    put_numbers(numbers, e);
    for (int i = 0; i < e->reference_count; i++)
        put_u64(takes + (size_t)i * 8, (uint64_t)e->reference[i]);
    enum status status =
        statement_open(&s, db, "INSERT OR REPLACE INTO expectation(id, numbers, takes, crc) VALUES(?,?,?,?)");
    if (status == OK) {
        statement_bind_number(s, 1, row->take);
        statement_bind_blob(s, 2, numbers, sizeof numbers);
        statement_bind_blob(s, 3, takes, bytes);
        statement_bind_number(s, 4, row_crc(row->take, numbers, takes, bytes));
        status = statement_run(s);
    }
    statement_close(&s);
    return status;
}

enum status recorded_expectation_write(const char *path, int64_t take, const struct take_expectation *expectation)
{
    const struct row row = {take, *expectation};
    if (!is_good(expectation))
        return fail(ERR_INPUT, "what is expected of a take is out of range");
    return recording_change(path, EXPECTATION_TABLE, put_row, &row);
}

enum status recorded_expectation_copy(struct database *from, int64_t take, struct database *to, int64_t copy,
                                      bool same_file)
{
    struct row row;
    enum status status = read_row(from, take, &row);
    if (status == OK) {
        row.take = copy;
        row.expectation.reference_count = same_file ? row.expectation.reference_count : 0;
        status = database_run(to, EXPECTATION_TABLE);
    }
    if (status == OK)
        status = put_row(to, &row);
    return status == ERR_IO || status == ERR_MEMORY ? status : OK;
}

// The next row behind *id that names the take. NOTHING: there is none.
static enum status find_naming(struct database *db, int64_t take, int64_t id, struct row *out)
{
    struct statement *s;
    bool found = false;
    enum status status = read_open(&s, db, "WHERE rowid > ? ORDER BY rowid");
    if (status == OK)
        statement_bind_number(s, 1, id);
    while (status == OK && !found && (status = statement_step(s)) == OK)
        if (from_row(s, out))
            for (int i = 0; i < out->expectation.reference_count; i++)
                found = found || out->expectation.reference[i] == take;
    statement_close(&s);
    return status;
}

enum status recorded_expectation_forget(struct database *db, int64_t take)
{
    int64_t tables = 0;
    struct row row = {.take = 0};
    enum status status = database_number(db, COUNT_TABLES("'expectation'"), &tables); // older files lack it
    if (status != OK || !tables)
        return status;
    status = delete_row(db, take);
    while (status == OK && (status = find_naming(db, take, row.take, &row)) == OK) {
        struct take_expectation *e = &row.expectation;
        int kept = 0;
        for (int i = 0; i < e->reference_count; i++)
            if (e->reference[i] != take)
                e->reference[kept++] = e->reference[i];
        e->reference_count = kept;
        status = put_row(db, &row);
    }
    return status == NOTHING ? OK : status;
}
