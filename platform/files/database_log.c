#include "platform/files/database_log.h"

#include <stdlib.h>
#include <string.h>

enum {
    VERSIONS_AT = 18, // in the file's header: of writing and reading; 1 rollback journal, 2 write-ahead log
    HEADER_BYTES = 32,
    MAGIC = 0x377f0682, // with 1 in the last bit: checksums are of big-endian numbers
    FORMAT = 3007000,
    FORMAT_AT = 4,
    PAGE_BYTES_AT = 8,
    SALTS_AT = 16,
    SALTS_BYTES = 8,
    SUM_AT = 24,
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

static bool read_at(const struct byte_source *source, void *to, size_t count, int64_t at)
{
    return at >= 0 && at + (int64_t)count <= source->count && source->read(source->from, to, count, at);
}

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
    return HEADER_BYTES + frame * (FRAME_BYTES + (int64_t)log->page_bytes);
}

static enum beside read_header(struct log *log)
{
    uint8_t header[HEADER_BYTES], nothing[HEADER_BYTES] = {0}, of_file[DATABASE_HEADER_BYTES];
    if (!log->bytes->count)
        return BESIDE_EMPTY;
    if (!read_at(log->bytes, header, sizeof header, 0))
        return BESIDE_DAMAGED;
    if (!memcmp(header, nothing, sizeof header)) // the power failed before it was on the disk
        return BESIDE_EMPTY;
    log->big_endian = header[3] & 1;
    log->page_bytes = database_number_at(header + PAGE_BYTES_AT);
    memcpy(log->salts, header + SALTS_AT, SALTS_BYTES);
    add_up(log, header, SUM_AT);
    if ((database_number_at(header) & 0xfffffffe) != MAGIC || database_number_at(header + FORMAT_AT) != FORMAT ||
        !has_sum(log, header + SUM_AT) || log->page_bytes < 512 || log->page_bytes > DATABASE_PAGE_MAX ||
        log->page_bytes & (log->page_bytes - 1))
        return BESIDE_DAMAGED;
    if (!read_at(log->file, of_file, sizeof of_file, 0) || page_one_page_bytes(of_file) != log->page_bytes)
        return BESIDE_FOREIGN;
    log->frames = (log->bytes->count - HEADER_BYTES) / (FRAME_BYTES + (int64_t)log->page_bytes);
    return BESIDE_OWN;
}

// The pages up to the last commit, in their order.
static enum beside read_frames(struct log *log)
{
    uint8_t head[FRAME_BYTES];
    size_t committed = 0;
    for (; log->valid < log->frames; log->valid++) {
        const int64_t at = frame_at(log, log->valid);
        if (!read_at(log->bytes, head, sizeof head, at) || memcmp(head + FRAME_SALTS_AT, log->salts, SALTS_BYTES) ||
            !database_number_at(head) || !read_at(log->bytes, log->page, log->page_bytes, at + FRAME_BYTES))
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
        same = read_at(log->bytes, log->page, log->page_bytes, p->at) &&
               read_at(log->file, log->other, log->page_bytes, (int64_t)(p->number - 1) * log->page_bytes) &&
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
    if (!read_at(log->bytes, log->page, log->page_bytes, at) || !page_one_read(&one, log->page, log->page_bytes))
        return;
    pages->contradicts |= page_one_marks_differ(&one, &pages->now);
    pages->agrees |= page_one_marks_agree(&one, &pages->now);
    pages->same |= page_one_same_header(&one, &pages->now);
    if (valid && !pages->any)
        pages->first_counter = one.counter;
    pages->any |= valid;
}

// Any page of the log, also of its earlier uses, is in the file.
static bool holds_a_page_of_the_file(struct log *log)
{
    uint8_t number[4];
    bool found = false;
    for (int64_t k = 0; k < log->frames && !found; k++)
        found = read_at(log->bytes, number, sizeof number, frame_at(log, k)) && database_number_at(number) &&
                read_at(log->bytes, log->page, log->page_bytes, frame_at(log, k) + FRAME_BYTES) &&
                page_is_in_file(log->file, database_number_at(number), log->page, log->other, log->page_bytes);
    return found;
}

// Before the pages are sorted.
static enum beside verify_log(struct log *log)
{
    struct first_pages f = {0};
    uint8_t number[4];
    if (!read_at(log->file, log->page, log->page_bytes, 0) || !page_one_read(&f.now, log->page, log->page_bytes))
        return BESIDE_FOREIGN;
    for (size_t i = 0; i < log->out->count; i++)
        if (log->out->pages[i].number == 1)
            note_page_one(log, &f, log->out->pages[i].at, true);
    // Other programs' small commits, and older versions' of this one, do not write page 1. Behind them stand pages of
    // an earlier use of the log, which were all moved into the file.
    for (int64_t k = log->valid; k < log->frames && !f.any && !f.same; k++)
        if (read_at(log->bytes, number, sizeof number, frame_at(log, k)) && database_number_at(number) == 1)
            note_page_one(log, &f, frame_at(log, k) + FRAME_BYTES, false);
    if (f.contradicts)
        return BESIDE_FOREIGN;
    if (f.same)
        return BESIDE_OWN;
    const bool follows = f.any && (f.first_counter == f.now.counter + 1 ||
                                   (f.first_counter == f.now.counter && log->out->page_count >= f.now.pages));
    const bool marked = *f.now.mark != 0, older = !marked && !f.any;
    return (follows && (f.agrees || !marked)) || (older && holds_a_page_of_the_file(log)) ? BESIDE_OWN : BESIDE_FOREIGN;
}

static enum beside read_pages(struct log *log)
{
    uint8_t versions[2];
    enum beside beside = read_frames(log);
    if (beside != BESIDE_OWN)
        return beside;
    if (!read_at(log->file, versions, sizeof versions, VERSIONS_AT))
        return BESIDE_FOREIGN;
    const bool has_log = versions[0] == 2;
    if (has_log)
        beside = verify_log(log);
    overlay_sort(log->out);
    if (!has_log)
        beside = is_in_file(log) ? BESIDE_EMPTY : BESIDE_FOREIGN;
    return beside;
}

enum beside database_log_read(struct page_overlay *out, const struct byte_source *log, const struct byte_source *file)
{
    struct log l = {.bytes = log, .file = file, .out = out};
    *out = (struct page_overlay){0};
    enum beside beside = read_header(&l);
    if (beside != BESIDE_OWN)
        return beside;
    l.page = malloc(l.page_bytes);
    l.other = malloc(l.page_bytes);
    beside = l.page && l.other ? read_pages(&l) : BESIDE_NO_MEMORY;
    free(l.page);
    free(l.other);
    return beside;
}
