#include "platform/files/database_sides.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <unistd.h>

// ---------------------------------------------------------------- pages in another file

// Offsets in a file's header.
enum {
    PAGE_BYTES_AT = 16, // 1 stands for 65536
    VERSIONS_AT = 18,   // of writing and reading: 1 rollback journal, 2 write-ahead log
    COUNTER_AT = 24,
    PAGES_AT = 28,
    PAGES_VALID_AT = 92, // the counter when the number of pages was written, and SQLite's version number behind it
};

// What page 1 says of the file.
struct page_one {
    uint8_t header[DATABASE_HEADER_BYTES];
    uint32_t counter, pages; // of changes; of the file, 0: not valid
    char mark[DATABASE_MARK_DIGITS + 1];
};

// A page without rows has less than 16 bytes that are not 0.
enum { TELLING_BYTES = 64 };

static bool read_source(const struct byte_source *source, void *to, size_t count, int64_t at)
{
    return at >= 0 && at + (int64_t)count <= source->count && source->read(source->from, to, count, at);
}

uint32_t database_number_at(const uint8_t *at)
{
    return (uint32_t)at[0] << 24 | (uint32_t)at[1] << 16 | (uint32_t)at[2] << 8 | at[3];
}

// False: no memory.
static bool overlay_add(struct page_overlay *overlay, uint32_t number, int64_t at)
{
    if (overlay->count == overlay->capacity) {
        const size_t capacity = overlay->capacity ? overlay->capacity * 2 : 64;
        struct overlay_page *grown = realloc(overlay->pages, capacity * sizeof *grown);
        if (!grown)
            return false;
        overlay->pages = grown;
        overlay->capacity = capacity;
    }
    overlay->pages[overlay->count++] = (struct overlay_page){number, at};
    return true;
}

static int by_number_and_place(const void *a, const void *b)
{
    const struct overlay_page *one = a, *other = b;
    if (one->number != other->number)
        return one->number < other->number ? -1 : 1;
    return one->at < other->at ? -1 : one->at > other->at;
}

// After the last addition: of a page that was added twice the later one counts.
static void overlay_sort(struct page_overlay *overlay)
{
    size_t kept = 0;
    if (overlay->count)
        qsort(overlay->pages, overlay->count, sizeof *overlay->pages, by_number_and_place);
    for (size_t i = 0; i < overlay->count; i++) {
        kept -= kept && overlay->pages[kept - 1].number == overlay->pages[i].number;
        overlay->pages[kept++] = overlay->pages[i];
    }
    overlay->count = kept;
}

// NULL: it is not there
static const struct overlay_page *overlay_find(const struct page_overlay *overlay, uint32_t number)
{
    size_t first = 0, end = overlay->count;
    while (first < end) {
        const size_t middle = first + (end - first) / 2;
        if (overlay->pages[middle].number == number)
            return &overlay->pages[middle];
        if (overlay->pages[middle].number < number)
            first = middle + 1;
        else
            end = middle;
    }
    return NULL;
}

static void overlay_free(struct page_overlay *overlay)
{
    free(overlay->pages);
    *overlay = (struct page_overlay){0};
}

// 0: not known.
static uint32_t page_one_page_bytes(const uint8_t header[DATABASE_HEADER_BYTES])
{
    const uint32_t bytes = (uint32_t)header[PAGE_BYTES_AT] << 8 | header[PAGE_BYTES_AT + 1];
    const uint32_t page = bytes == 1 ? DATABASE_PAGE_MAX : bytes;
    return page >= 512 && !(page & (page - 1)) ? page : 0;
}

static void find_mark(char mark[DATABASE_MARK_DIGITS + 1], const uint8_t *page, size_t count)
{
    static const char begin[] = DATABASE_MARK_BEGIN;
    const size_t length = sizeof begin - 1;
    mark[0] = 0;
    for (size_t i = 0; i + length + DATABASE_MARK_DIGITS < count; i++)
        if (page[i] == (uint8_t)begin[0] && !memcmp(page + i, begin, length) &&
            page[i + length + DATABASE_MARK_DIGITS] == '\'') {
            memcpy(mark, page + i + length, DATABASE_MARK_DIGITS);
            mark[DATABASE_MARK_DIGITS] = 0;
            return;
        }
}

// False: it is no SQLite file's.
static bool page_one_read(struct page_one *out, const uint8_t *page, size_t count)
{
    static const char magic[] = "SQLite format 3";
    *out = (struct page_one){0};
    if (count < DATABASE_HEADER_BYTES || memcmp(page, magic, sizeof magic))
        return false;
    memcpy(out->header, page, sizeof out->header);
    out->counter = database_number_at(page + COUNTER_AT);
    out->pages = database_number_at(page + PAGES_VALID_AT) == out->counter ? database_number_at(page + PAGES_AT) : 0;
    find_mark(out->mark, page, count);
    return true;
}

static bool page_one_same_header(const struct page_one *one, const struct page_one *other)
{
    return !memcmp(one->header, other->header, sizeof one->header);
}

// both have one
static bool page_one_marks_differ(const struct page_one *one, const struct page_one *other)
{
    return *one->mark && *other->mark && strcmp(one->mark, other->mark);
}

// likewise
static bool page_one_marks_agree(const struct page_one *one, const struct page_one *other)
{
    return *one->mark && *other->mark && !strcmp(one->mark, other->mark);
}

static bool is_telling(const uint8_t *page, uint32_t page_bytes)
{
    uint32_t set = 0;
    for (uint32_t i = 0; i < page_bytes && set < TELLING_BYTES; i++)
        set += page[i] != 0;
    return set >= TELLING_BYTES;
}

// Whether a page's bytes are the file's there, and no page that is nearly empty: those are alike in all files.
// `scratch` takes a page.
static bool page_is_in_file(const struct byte_source *file, uint32_t number, const uint8_t *page, uint8_t *scratch,
                            uint32_t page_bytes)
{
    return is_telling(page, page_bytes) &&
           file->read(file->from, scratch, page_bytes, (int64_t)(number - 1) * page_bytes) &&
           !memcmp(scratch, page, page_bytes);
}

// ---------------------------------------------------------------- rollback journal

// SQLite's rollback journal (fileformat2.html, section 3), read beside the file whose overwritten pages it should hold.

enum {
    JOURNAL_HEADER_BYTES = 28, // of a header; it fills a sector
    RECORDS_AT = 8,            // that were synced; ALL_RECORDS: as many as there are
    NONCE_AT = 12,             // where the checksums begin
    JOURNAL_PAGES_AT = 16,     // of the file before the change
    SECTOR_AT = 20,
    JOURNAL_PAGE_BYTES_AT = 24,
    CHECKSUM_STEP = 200, // only every so many bytes are summed up
    PENDING_BYTE = 0x40000000,
};
static const uint32_t ALL_RECORDS = 0xffffffff;
static const uint8_t journal_magic[8] = {0xd9, 0xd5, 0x05, 0xf9, 0x20, 0xa1, 0x63, 0xd7};

struct journal {
    const struct byte_source *bytes, *file;
    uint32_t sector, page_bytes, pages, nonce;
    struct page_overlay *out;
    uint8_t *page, *other;
};

// A journal of several files ends in the name of theirs, its length, its checksum and the magic number.
static bool names_a_file(const struct byte_source *journal)
{
    uint8_t end[sizeof journal_magic];
    return journal->count >= 16 && read_source(journal, end, sizeof end, journal->count - (int64_t)sizeof end) &&
           !memcmp(end, journal_magic, sizeof journal_magic);
}

static bool has_checksum(const struct journal *journal, const uint8_t *page, uint32_t wanted)
{
    uint32_t sum = journal->nonce;
    for (int64_t i = (int64_t)journal->page_bytes - CHECKSUM_STEP; i > 0; i -= CHECKSUM_STEP)
        sum += page[i];
    return sum == wanted;
}

// BESIDE_OWN: all the records are there.
static enum beside read_records(struct journal *journal, uint32_t records, int64_t *at)
{
    const int64_t record_bytes = (int64_t)journal->page_bytes + 8;
    for (uint32_t i = 0; i < records; i++, *at += record_bytes) {
        uint8_t number[4], sum[4];
        if (!read_source(journal->bytes, number, sizeof number, *at) ||
            !read_source(journal->bytes, journal->page, journal->page_bytes, *at + 4) ||
            !read_source(journal->bytes, sum, sizeof sum, *at + 4 + journal->page_bytes))
            return BESIDE_DAMAGED;
        const uint32_t page = database_number_at(number);
        if (!page || page == PENDING_BYTE / journal->page_bytes + 1 ||
            !has_checksum(journal, journal->page, database_number_at(sum)))
            return BESIDE_DAMAGED;
        if (page <= journal->pages && !overlay_add(journal->out, page, *at + 4))
            return BESIDE_NO_MEMORY;
    }
    return BESIDE_OWN;
}

static enum beside read_journal_header(struct journal *journal, uint8_t header[JOURNAL_HEADER_BYTES])
{
    uint8_t of_file[DATABASE_HEADER_BYTES];
    if (!read_source(journal->bytes, header, JOURNAL_HEADER_BYTES, 0) ||
        memcmp(header, journal_magic, sizeof journal_magic))
        return BESIDE_DAMAGED;
    journal->sector = database_number_at(header + SECTOR_AT);
    journal->page_bytes = database_number_at(header + JOURNAL_PAGE_BYTES_AT);
    journal->pages = database_number_at(header + JOURNAL_PAGES_AT);
    if (journal->sector < 32 || journal->sector > 65536 || journal->sector & (journal->sector - 1) ||
        journal->page_bytes < 512 || journal->page_bytes > DATABASE_PAGE_MAX ||
        journal->page_bytes & (journal->page_bytes - 1))
        return BESIDE_DAMAGED;
    if (!journal->pages && !journal->file->count) // of a file that was being made
        return BESIDE_OWN;
    return read_source(journal->file, of_file, sizeof of_file, 0) && page_one_page_bytes(of_file) == journal->page_bytes
               ? BESIDE_OWN
               : BESIDE_FOREIGN;
}

// Each header stands in front of what was written between two syncs.
static enum beside read_all(struct journal *journal, uint8_t header[JOURNAL_HEADER_BYTES])
{
    enum beside beside = BESIDE_OWN;
    for (int64_t at = 0; beside == BESIDE_OWN;) {
        const uint32_t stated = database_number_at(header + RECORDS_AT);
        const int64_t record_bytes = (int64_t)journal->page_bytes + 8,
                      room = journal->bytes->count - at - journal->sector;
        const int64_t all = room > 0 ? room / record_bytes : 0;
        journal->nonce = database_number_at(header + NONCE_AT);
        at += journal->sector;
        if (stated != ALL_RECORDS && stated > all)
            return BESIDE_DAMAGED;
        beside = read_records(journal, stated == ALL_RECORDS ? (uint32_t)all : stated, &at);
        at = (at + journal->sector - 1) / journal->sector * journal->sector;
        if (!stated || !read_source(journal->bytes, header, JOURNAL_HEADER_BYTES, at) ||
            memcmp(header, journal_magic, sizeof journal_magic))
            break;
    }
    return beside;
}

// Whether nothing but what every change writes into the header differs.
static bool differs_in_header_only(const uint8_t *page, const uint8_t *other, uint32_t page_bytes)
{
    return !memcmp(page, other, VERSIONS_AT) &&
           !memcmp(page + VERSIONS_AT + 2, other + VERSIONS_AT + 2, COUNTER_AT - VERSIONS_AT - 2) &&
           !memcmp(page + COUNTER_AT + 4, other + COUNTER_AT + 4, PAGES_VALID_AT - COUNTER_AT - 4) &&
           !memcmp(page + PAGES_VALID_AT + 8, other + PAGES_VALID_AT + 8, page_bytes - PAGES_VALID_AT - 8);
}

// Another page than the first is in the file as it is in the journal: the change had not come to it.
static bool journal_holds_a_page_of_the_file(struct journal *journal)
{
    bool found = false;
    for (size_t i = 0; i < journal->out->count && !found; i++)
        found = journal->out->pages[i].number != 1 &&
                read_source(journal->bytes, journal->page, journal->page_bytes, journal->out->pages[i].at) &&
                page_is_in_file(journal->file, journal->out->pages[i].number, journal->page, journal->other,
                                journal->page_bytes);
    return found;
}

static enum beside verify_journal(struct journal *journal)
{
    struct page_one before, now;
    const struct overlay_page *first = overlay_find(journal->out, 1);
    if (!journal->out->count) // nothing was overwritten yet
        return (int64_t)journal->pages * journal->page_bytes == journal->file->count ? BESIDE_EMPTY : BESIDE_FOREIGN;
    if (!first || !read_source(journal->bytes, journal->page, journal->page_bytes, first->at) ||
        !read_source(journal->file, journal->other, journal->page_bytes, 0) ||
        !page_one_read(&before, journal->page, journal->page_bytes) ||
        !page_one_read(&now, journal->other, journal->page_bytes) || page_one_marks_differ(&before, &now))
        return BESIDE_FOREIGN;
    if (before.pages && before.pages != journal->pages)
        return BESIDE_DAMAGED;
    if (page_one_same_header(&before, &now)) // the marks agree, or a torn write has spoilt one
        return BESIDE_OWN;
    if (now.counter != before.counter + 1)
        return BESIDE_FOREIGN;
    const bool alone =
        journal->out->count == 1 && differs_in_header_only(journal->page, journal->other, journal->page_bytes);
    return page_one_marks_agree(&before, &now) || alone || journal_holds_a_page_of_the_file(journal) ? BESIDE_OWN
                                                                                                     : BESIDE_FOREIGN;
}

// Proved to be the file's, BESIDE_OWN: the journal holds page 1; the file's page 1 has either that header still, or the
// change counter that the interrupted change gave it; no two marks differ; and in the second case the marks agree, or
// another page of it is in the file still, or nothing but the header differs. *out is freed by the caller in any case.
static enum beside database_journal_read(struct page_overlay *out, const struct byte_source *journal,
                                         const struct byte_source *file)
{
    struct journal j = {.bytes = journal, .file = file, .out = out};
    uint8_t header[JOURNAL_HEADER_BYTES], first;
    *out = (struct page_overlay){0};
    // SQLite marks a journal as done with by a 0 where it keeps the file.
    if (!read_source(journal, &first, 1, 0) || !first)
        return BESIDE_EMPTY;
    if (names_a_file(journal))
        return BESIDE_NAMES_ONE;
    enum beside beside = read_journal_header(&j, header);
    if (beside != BESIDE_OWN)
        return beside;
    j.page = malloc(j.page_bytes);
    j.other = malloc(j.page_bytes);
    beside = j.page && j.other ? read_all(&j, header) : BESIDE_NO_MEMORY;
    if (beside == BESIDE_OWN) {
        overlay_sort(out);
        out->page_bytes = j.page_bytes;
        out->page_count = j.pages;
        beside = verify_journal(&j);
    }
    free(j.page);
    free(j.other);
    return beside;
}

// ---------------------------------------------------------------- write-ahead log

// SQLite's write-ahead log (fileformat2.html, section 4), read beside the file whose last part it should hold.

enum {
    LOG_HEADER_BYTES = 32,
    LOG_MAGIC = 0x377f0682, // with 1 in the last bit: checksums are of big-endian numbers
    LOG_FORMAT = 3007000,
    LOG_FORMAT_AT = 4,
    LOG_PAGE_BYTES_AT = 8,
    SALTS_AT = 16,
    SALTS_BYTES = 8,
    LOG_SUM_AT = 24,
    FRAME_BYTES = 24,    // in front of each page
    FRAME_COMMIT_AT = 4, // pages of the file after the commit that the frame ends; 0: it ends none
    FRAME_SALTS_AT = 8,
    FRAME_SUM_AT = 16,
    FRAME_SUMMED_BYTES = 8,
};

struct log {
    const struct byte_source *bytes, *file;
    uint32_t page_bytes, sum[2];
    bool big_endian;
    uint8_t salts[SALTS_BYTES];
    int64_t frames, valid; // in the file; of those, whose checksums are right
    uint8_t *page, *other;
    struct page_overlay *out;
};

static uint32_t word_at(const struct log *log, const uint8_t *at)
{
    return log->big_endian ? database_number_at(at)
                           : (uint32_t)at[3] << 24 | (uint32_t)at[2] << 16 | (uint32_t)at[1] << 8 | at[0];
}

static void add_up(struct log *log, const uint8_t *bytes, uint32_t count)
{
    for (uint32_t i = 0; i + 8 <= count; i += 8) {
        log->sum[0] += word_at(log, bytes + i) + log->sum[1];
        log->sum[1] += word_at(log, bytes + i + 4) + log->sum[0];
    }
}

static bool has_sum(const struct log *log, const uint8_t *at)
{
    return database_number_at(at) == log->sum[0] && database_number_at(at + 4) == log->sum[1];
}

static int64_t frame_at(const struct log *log, int64_t frame)
{
    return LOG_HEADER_BYTES + frame * (FRAME_BYTES + (int64_t)log->page_bytes);
}

static enum beside read_log_header(struct log *log)
{
    uint8_t header[LOG_HEADER_BYTES], nothing[LOG_HEADER_BYTES] = {0}, of_file[DATABASE_HEADER_BYTES];
    if (!log->bytes->count)
        return BESIDE_EMPTY;
    if (!read_source(log->bytes, header, sizeof header, 0))
        return BESIDE_DAMAGED;
    if (!memcmp(header, nothing, sizeof header)) // the power failed before it was on the disk
        return BESIDE_EMPTY;
    log->big_endian = header[3] & 1;
    log->page_bytes = database_number_at(header + LOG_PAGE_BYTES_AT);
    memcpy(log->salts, header + SALTS_AT, SALTS_BYTES);
    add_up(log, header, LOG_SUM_AT);
    if ((database_number_at(header) & 0xfffffffe) != LOG_MAGIC ||
        database_number_at(header + LOG_FORMAT_AT) != LOG_FORMAT || !has_sum(log, header + LOG_SUM_AT) ||
        log->page_bytes < 512 || log->page_bytes > DATABASE_PAGE_MAX || log->page_bytes & (log->page_bytes - 1))
        return BESIDE_DAMAGED;
    if (!read_source(log->file, of_file, sizeof of_file, 0) || page_one_page_bytes(of_file) != log->page_bytes)
        return BESIDE_FOREIGN;
    log->frames = (log->bytes->count - LOG_HEADER_BYTES) / (FRAME_BYTES + (int64_t)log->page_bytes);
    return BESIDE_OWN;
}

// The pages up to the last commit, in their order.
static enum beside read_frames(struct log *log)
{
    uint8_t head[FRAME_BYTES];
    size_t committed = 0;
    for (; log->valid < log->frames; log->valid++) {
        const int64_t at = frame_at(log, log->valid);
        if (!read_source(log->bytes, head, sizeof head, at) || memcmp(head + FRAME_SALTS_AT, log->salts, SALTS_BYTES) ||
            !database_number_at(head) || !read_source(log->bytes, log->page, log->page_bytes, at + FRAME_BYTES))
            break; // of an earlier use of the log, or never finished
        add_up(log, head, FRAME_SUMMED_BYTES);
        add_up(log, log->page, log->page_bytes);
        if (!has_sum(log, head + FRAME_SUM_AT))
            break;
        if (!overlay_add(log->out, database_number_at(head), at + FRAME_BYTES))
            return BESIDE_NO_MEMORY;
        if (database_number_at(head + FRAME_COMMIT_AT)) {
            log->out->page_count = database_number_at(head + FRAME_COMMIT_AT);
            committed = log->out->count;
        }
    }
    log->out->count = committed;
    log->out->page_bytes = log->page_bytes;
    return committed ? BESIDE_OWN : BESIDE_EMPTY;
}

// Whether the file has all that was committed, of each page the last; but for what closing changes in the header.
static bool is_in_file(struct log *log)
{
    bool same = true;
    for (size_t i = 0; i < log->out->count && same; i++) {
        const struct overlay_page *p = &log->out->pages[i];
        const size_t first = p->number == 1 ? DATABASE_HEADER_BYTES : 0;
        same = read_source(log->bytes, log->page, log->page_bytes, p->at) &&
               read_source(log->file, log->other, log->page_bytes, (int64_t)(p->number - 1) * log->page_bytes) &&
               !memcmp(log->page + first, log->other + first, log->page_bytes - first);
    }
    return same;
}

struct first_pages {
    struct page_one now; // in the file
    bool any, same;      // one is in the log; one of those has the file's header
    bool contradicts;    // the mark of another file
    bool agrees;
    uint32_t first_counter;
};

static void note_page_one(struct log *log, struct first_pages *pages, int64_t at, bool valid)
{
    struct page_one one;
    if (!read_source(log->bytes, log->page, log->page_bytes, at) || !page_one_read(&one, log->page, log->page_bytes))
        return;
    pages->contradicts |= page_one_marks_differ(&one, &pages->now);
    pages->agrees |= page_one_marks_agree(&one, &pages->now);
    pages->same |= page_one_same_header(&one, &pages->now);
    if (valid && !pages->any)
        pages->first_counter = one.counter;
    pages->any |= valid;
}

// Any page of the log, also of its earlier uses, is in the file.
static bool log_holds_a_page_of_the_file(struct log *log)
{
    uint8_t number[4];
    bool found = false;
    for (int64_t k = 0; k < log->frames && !found; k++)
        found = read_source(log->bytes, number, sizeof number, frame_at(log, k)) && database_number_at(number) &&
                read_source(log->bytes, log->page, log->page_bytes, frame_at(log, k) + FRAME_BYTES) &&
                page_is_in_file(log->file, database_number_at(number), log->page, log->other, log->page_bytes);
    return found;
}

// Before the pages are sorted.
static enum beside verify_log(struct log *log)
{
    struct first_pages f = {0};
    uint8_t number[4];
    if (!read_source(log->file, log->page, log->page_bytes, 0) || !page_one_read(&f.now, log->page, log->page_bytes))
        return BESIDE_FOREIGN;
    for (size_t i = 0; i < log->out->count; i++)
        if (log->out->pages[i].number == 1)
            note_page_one(log, &f, log->out->pages[i].at, true);
    // Other programs' small commits, and older versions' of this one, do not write page 1. Behind them stand pages of
    // an earlier use of the log, which were all moved into the file.
    for (int64_t k = log->valid; k < log->frames && !f.any && !f.same; k++)
        if (read_source(log->bytes, number, sizeof number, frame_at(log, k)) && database_number_at(number) == 1)
            note_page_one(log, &f, frame_at(log, k) + FRAME_BYTES, false);
    if (f.contradicts)
        return BESIDE_FOREIGN;
    if (f.same)
        return BESIDE_OWN;
    const bool follows = f.any && (f.first_counter == f.now.counter + 1 ||
                                   (f.first_counter == f.now.counter && log->out->page_count >= f.now.pages));
    const bool marked = *f.now.mark != 0, older = !marked && !f.any;
    return (follows && (f.agrees || !marked)) || (older && log_holds_a_page_of_the_file(log)) ? BESIDE_OWN
                                                                                              : BESIDE_FOREIGN;
}

static enum beside read_pages(struct log *log)
{
    uint8_t versions[2];
    enum beside beside = read_frames(log);
    if (beside != BESIDE_OWN)
        return beside;
    if (!read_source(log->file, versions, sizeof versions, VERSIONS_AT))
        return BESIDE_FOREIGN;
    const bool has_log = versions[0] == 2;
    if (has_log)
        beside = verify_log(log);
    overlay_sort(log->out);
    if (!has_log)
        beside = is_in_file(log) ? BESIDE_EMPTY : BESIDE_FOREIGN;
    return beside;
}

// Where the file's header says that there is a log (SQLite writes that before it writes a log, and takes it out when
// the log is gone), it is proved to be the file's, BESIDE_OWN: no two marks differ, and the file's page 1 has the
// header of one in the log, or of the one before those. Where the header says that there is none, the log is
// BESIDE_EMPTY if the file has all of it: the power failed before its removal was on the disk; else BESIDE_FOREIGN: it
// is a copy that was put in the place of a file whose log this is. *out is freed by the caller in any case.
static enum beside database_log_read(struct page_overlay *out, const struct byte_source *log,
                                     const struct byte_source *file)
{
    struct log l = {.bytes = log, .file = file, .out = out};
    *out = (struct page_overlay){0};
    enum beside beside = read_log_header(&l);
    if (beside != BESIDE_OWN)
        return beside;
    l.page = malloc(l.page_bytes);
    l.other = malloc(l.page_bytes);
    beside = l.page && l.other ? read_pages(&l) : BESIDE_NO_MEMORY;
    free(l.page);
    free(l.other);
    return beside;
}

// ---------------------------------------------------------------- files beside a database

void database_sides_init(struct database_sides *sides, const char *path, bool writes)
{
    *sides = (struct database_sides){.path = path, .writes = writes, .claim = -1};
    for (int i = 0; i < SIDE_COUNT; i++)
        sides->side[i].file = -1;
}

static void close_side(struct side *side)
{
    overlay_free(&side->pages);
    side->beside = BESIDE_EMPTY;
    if (side->file >= 0)
        close(side->file);
    side->file = -1;
}

void database_sides_free(struct database_sides *sides)
{
    for (int i = 0; i < SIDE_COUNT; i++) {
        close_side(&sides->side[i]);
        free(sides->side[i].name);
        sides->side[i].name = NULL;
    }
}

bool database_sides_name(struct database_sides *sides, const char *name)
{
    static const char *const endings[SIDE_COUNT] = {"-journal", "-wal", "-shm"};
    bool named = true;
    for (int i = 0; i < SIDE_COUNT; i++) {
        char *side = malloc(strlen(name) + strlen(endings[i]) + 1);
        free(sides->side[i].name);
        sides->side[i].name = side;
        named = named && side;
        if (side)
            sprintf(side, "%s%s", name, endings[i]);
    }
    return named;
}

bool database_sides_is(const struct database_sides *sides, enum side_kind kind, const char *name)
{
    return sides->side[kind].name && !strcmp(name, sides->side[kind].name);
}

// ------------------------------------------------------------- reading

static bool read_descriptor(void *from, void *to, size_t count, int64_t at)
{
    const struct side *side = from;
    return pread(side->file, to, count, at) == (ssize_t)count;
}

static enum status read_beside(const struct side *side, void *to, size_t count, int64_t at)
{
    if (side->beside != BESIDE_OWN)
        return NOTHING;
    const struct overlay_page *page = overlay_find(&side->pages, (uint32_t)(at / side->pages.page_bytes) + 1);
    if (!page)
        return NOTHING;
    return pread(side->file, to, count, page->at + at % side->pages.page_bytes) == (ssize_t)count ? OK : ERR_IO;
}

enum status database_sides_read(const struct database_sides *sides, void *to, size_t count, int64_t at)
{
    const enum status logged = read_beside(&sides->side[SIDE_LOG], to, count, at);
    return logged == NOTHING ? read_beside(&sides->side[SIDE_JOURNAL], to, count, at) : logged;
}

bool database_sides_have_pages(const struct database_sides *sides, int64_t *bytes)
{
    const struct side *log = &sides->side[SIDE_LOG], *journal = &sides->side[SIDE_JOURNAL];
    const struct side *last = NULL;
    if (log->beside == BESIDE_OWN)
        last = log;
    else if (journal->beside == BESIDE_OWN)
        last = journal;
    if (last)
        *bytes = (int64_t)last->pages.page_count * last->pages.page_bytes;
    return last;
}

struct taken_back {
    const struct side *journal;
    const struct byte_source *file;
};

// The file as it is once its unfinished change is taken back.
static bool read_taken_back(void *from, void *to, size_t count, int64_t at)
{
    const struct taken_back *t = from;
    const enum status status = read_beside(t->journal, to, count, at);
    return status == NOTHING ? t->file->read(t->file->from, to, count, at) : status == OK;
}

static enum beside read_side(struct database_sides *sides, enum side_kind kind, const struct byte_source *file)
{
    struct side *side = &sides->side[kind];
    const struct side *journal = &sides->side[SIDE_JOURNAL];
    const struct byte_source beside = {read_descriptor, side, side->seen.st_size};
    overlay_free(&side->pages);
    if (kind == SIDE_JOURNAL)
        return database_journal_read(&side->pages, &beside, file);
    if (journal->beside != BESIDE_OWN)
        return database_log_read(&side->pages, &beside, file);
    struct taken_back taken = {journal, file};
    const struct byte_source before = {read_taken_back, &taken,
                                       (int64_t)journal->pages.page_count * journal->pages.page_bytes};
    return database_log_read(&side->pages, &beside, &before);
}

// ------------------------------------------------------------- looking

static bool reject_side(struct database_sides *sides, enum status why, const char *sentence, const char *name)
{
    sides->trouble = why;
    snprintf(sides->sentence, sizeof sides->sentence, sentence, name, sides->path);
    return false;
}

static bool refuse_beside(struct database_sides *sides, enum side_kind kind)
{
    static const char *const foreign[] = {
        [SIDE_JOURNAL] = "%s holds what a change of another file, or of another version of this one, has overwritten, "
                         "not of %s, which would be damaged by it: put it beside that file, or move it away and run "
                         "reenact-capture verify",
        [SIDE_LOG] = "%s holds the last part of another file that was called so, not of %s, which would be damaged by "
                     "it: put it beside that file, or move it away"};
    const struct side *side = &sides->side[kind];
    switch (side->beside) {
    case BESIDE_NO_MEMORY: return reject_side(sides, ERR_MEMORY, "no memory to read %s", side->name);
    case BESIDE_NAMES_ONE:
        return reject_side(
            sides, ERR_IO,
            "%s names another file that would be deleted with it, which no recording's does: remove it, then "
            "run reenact-capture verify on %s",
            side->name);
    case BESIDE_DAMAGED:
        return reject_side(sides, ERR_IO,
                           "%s is damaged, and may hold a part of %s: keep a copy of both, then move it away and run "
                           "reenact-capture verify",
                           side->name);
    default: return reject_side(sides, ERR_IO, foreign[kind], side->name);
    }
}

static bool is_same_file(const struct stat *one, const struct stat *other)
{
    return one->st_dev == other->st_dev && one->st_ino == other->st_ino && one->st_size == other->st_size &&
           one->st_mtim.tv_sec == other->st_mtim.tv_sec && one->st_mtim.tv_nsec == other->st_mtim.tv_nsec;
}

// True, and *there: it is a file of its own and nothing else.
static bool find_side(struct database_sides *sides, enum side_kind kind, struct stat *about, bool *there)
{
    const char *name = sides->side[kind].name;
    *there = !lstat(name, about);
    if (!*there)
        return errno == ENOENT || errno == ENOTDIR || errno == ENAMETOOLONG ||
               reject_side(sides, ERR_IO, "%s, which belongs to %s, cannot be looked at", name);
    const bool changes = sides->writes || kind == SIDE_INDEX; // SQLite cuts the log's index, to read it, too
    return (S_ISREG(about->st_mode) && !(changes && about->st_nlink > 1)) ||
           reject_side(
               sides, ERR_IO,
               "%s is a link, a folder or the like, and not a file of its own, as one that belongs to %s is: move "
               "it away",
               name);
}

// True with side->file < 0: another program has just removed it.
static bool open_side(struct database_sides *sides, enum side_kind kind)
{
    struct side *side = &sides->side[kind];
    close_side(side);
    side->file = open(side->name, O_RDONLY | O_NOFOLLOW | O_CLOEXEC | O_NONBLOCK);
    return (side->file >= 0 ? !fstat(side->file, &side->seen) : errno == ENOENT) ||
           reject_side(sides, ERR_IO, "%s, which holds a part of %s, cannot be read", side->name);
}

static bool look_at_journal(struct database_sides *sides, const struct main_file *file)
{
    struct side *side = &sides->side[SIDE_JOURNAL];
    struct stat about;
    bool there;
    if (!find_side(sides, SIDE_JOURNAL, &about, &there))
        return false;
    if (!there || !about.st_size || file->is_being_changed(file->bytes.from)) {
        close_side(side);
        return true;
    }
    if (side->file >= 0 && side->beside == BESIDE_OWN && is_same_file(&side->seen, &about))
        return true;
    if (!open_side(sides, SIDE_JOURNAL) || side->file < 0)
        return sides->trouble == OK;
    side->beside = read_side(sides, SIDE_JOURNAL, &file->bytes);
    if (side->beside == BESIDE_OWN || side->beside == BESIDE_EMPTY)
        return true;
    // It may have been made while it was read.
    const bool good = file->is_being_changed(file->bytes.from) || refuse_beside(sides, SIDE_JOURNAL);
    close_side(side);
    return good;
}

// The log is there and open. Unless a writer holds it, the lock on it is shared until it is let go.
static bool look_into_log(struct database_sides *sides, const struct main_file *file, bool known)
{
    struct side *side = &sides->side[SIDE_LOG];
    struct stat about;
    bool there;
    const bool held = flock(side->file, LOCK_SH | LOCK_NB) && errno == EWOULDBLOCK;
    if (held && !find_side(sides, SIDE_INDEX, &about, &there))
        return false;
    if (held) {
        sides->live = !sides->writes;
        sides->without_log = false;
        return true;
    }
    if (fstat(side->file, &about))
        return reject_side(sides, ERR_IO, "%s, which holds a part of %s, cannot be read", side->name);
    if (!known || !is_same_file(&side->seen, &about)) { // the lock may have come later
        side->seen = about;
        side->beside = read_side(sides, SIDE_LOG, &file->bytes);
    }
    return side->beside == BESIDE_OWN || side->beside == BESIDE_EMPTY || refuse_beside(sides, SIDE_LOG);
}

static bool look_at_log(struct database_sides *sides, const struct main_file *file)
{
    struct side *side = &sides->side[SIDE_LOG];
    struct stat about;
    bool there;
    if ((sides->writes && !find_side(sides, SIDE_INDEX, &about, &there)) || !find_side(sides, SIDE_LOG, &about, &there))
        return false;
    // A writer leaves its log's name in the header; where the log is gone, it enters write-ahead mode anew.
    sides->without_log = there ? !sides->writes : !sides->wrote_header;
    if (!there) {
        close_side(side);
        return true;
    }
    const bool known = side->file >= 0 && side->beside == BESIDE_OWN && is_same_file(&side->seen, &about);
    if (!known && !open_side(sides, SIDE_LOG))
        return false;
    if (side->file < 0)
        return true;
    const bool good = look_into_log(sides, file, known);
    if (!good || sides->writes || sides->live)
        close_side(side);
    return good;
}

// Where what lies beside has become another, SQLite must not go on with the pages that it has.
static bool is_as_before(const struct database_sides *sides, const struct side before[SIDE_COUNT])
{
    bool same = !sides->live;
    for (int i = 0; i < SIDE_INDEX; i++)
        same = same && before[i].beside == sides->side[i].beside &&
               (before[i].beside != BESIDE_OWN || is_same_file(&before[i].seen, &sides->side[i].seen));
    return same;
}

bool database_sides_look(struct database_sides *sides, const struct main_file *file)
{
    struct side before[SIDE_COUNT];
    if (sides->live)
        return true;
    memcpy(before, sides->side, sizeof before);
    sides->trouble = OK;
    if (!look_at_journal(sides, file) || !look_at_log(sides, file))
        return false;
    sides->generation += !sides->writes && !is_as_before(sides, before);
    return true;
}

void database_sides_let_go(struct database_sides *sides)
{
    if (sides->side[SIDE_LOG].file >= 0)
        flock(sides->side[SIDE_LOG].file, LOCK_UN);
}

bool database_sides_claim_log(struct database_sides *sides)
{
    if (sides->claims++)
        return true;
    sides->claim = open(sides->side[SIDE_LOG].name, O_RDONLY | O_NOFOLLOW | O_CLOEXEC | O_NONBLOCK);
    if (sides->claim < 0 || !flock(sides->claim, LOCK_EX | LOCK_NB) || errno != EWOULDBLOCK)
        return true;
    // Where it is a writer that holds it, no reader does.
    const bool is_read = !flock(sides->claim, LOCK_SH | LOCK_NB);
    close(sides->claim);
    sides->claim = -1;
    sides->claims -= is_read;
    return !is_read;
}

void database_sides_give_log(struct database_sides *sides)
{
    if (--sides->claims)
        return;
    if (sides->claim >= 0)
        close(sides->claim);
    sides->claim = -1;
}
