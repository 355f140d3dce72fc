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

static bool read_at(const struct byte_source *s, void *to, size_t count, int64_t at)
{
    return at >= 0 && at + (int64_t)count <= s->count && s->read(s->from, to, count, at);
}

static uint32_t word_at(const struct log *l, const uint8_t *at)
{
    return l->big_endian ? database_number_at(at)
                         : (uint32_t)at[3] << 24 | (uint32_t)at[2] << 16 | (uint32_t)at[1] << 8 | at[0];
}

static void add_up(struct log *l, const uint8_t *bytes, uint32_t count)
{
    for (uint32_t i = 0; i + 8 <= count; i += 8) {
        l->sum[0] += word_at(l, bytes + i) + l->sum[1];
        l->sum[1] += word_at(l, bytes + i + 4) + l->sum[0];
    }
}

static bool has_sum(const struct log *l, const uint8_t *at)
{
    return database_number_at(at) == l->sum[0] && database_number_at(at + 4) == l->sum[1];
}

static int64_t frame_at(const struct log *l, int64_t frame)
{
    return HEADER_BYTES + frame * (FRAME_BYTES + (int64_t)l->page_bytes);
}

static enum beside read_header(struct log *l)
{
    uint8_t header[HEADER_BYTES], nothing[HEADER_BYTES] = {0}, of_file[DATABASE_HEADER_BYTES];
    if (!l->bytes->count)
        return BESIDE_EMPTY;
    if (!read_at(l->bytes, header, sizeof header, 0))
        return BESIDE_DAMAGED;
    if (!memcmp(header, nothing, sizeof header)) // the power failed before it was on the disk
        return BESIDE_EMPTY;
    l->big_endian = header[3] & 1;
    l->page_bytes = database_number_at(header + PAGE_BYTES_AT);
    memcpy(l->salts, header + SALTS_AT, SALTS_BYTES);
    add_up(l, header, SUM_AT);
    if ((database_number_at(header) & 0xfffffffe) != MAGIC || database_number_at(header + FORMAT_AT) != FORMAT ||
        !has_sum(l, header + SUM_AT) || l->page_bytes < 512 || l->page_bytes > DATABASE_PAGE_MOST ||
        l->page_bytes & (l->page_bytes - 1))
        return BESIDE_DAMAGED;
    if (!read_at(l->file, of_file, sizeof of_file, 0) || page_one_page_bytes(of_file) != l->page_bytes)
        return BESIDE_FOREIGN;
    l->frames = (l->bytes->count - HEADER_BYTES) / (FRAME_BYTES + (int64_t)l->page_bytes);
    return BESIDE_OWN;
}

// The pages up to the last commit, in their order.
static enum beside read_frames(struct log *l)
{
    uint8_t head[FRAME_BYTES];
    size_t committed = 0;
    for (; l->valid < l->frames; l->valid++) {
        const int64_t at = frame_at(l, l->valid);
        if (!read_at(l->bytes, head, sizeof head, at) || memcmp(head + FRAME_SALTS_AT, l->salts, SALTS_BYTES) ||
            !database_number_at(head) || !read_at(l->bytes, l->page, l->page_bytes, at + FRAME_BYTES))
            break; // of an earlier use of the log, or never finished
        add_up(l, head, FRAME_SUMMED_BYTES);
        add_up(l, l->page, l->page_bytes);
        if (!has_sum(l, head + FRAME_SUM_AT))
            break;
        if (!overlay_add(l->out, database_number_at(head), at + FRAME_BYTES))
            return BESIDE_NO_MEMORY;
        if (database_number_at(head + FRAME_COMMIT_AT)) {
            l->out->page_count = database_number_at(head + FRAME_COMMIT_AT);
            committed = l->out->count;
        }
    }
    l->out->count = committed;
    l->out->page_bytes = l->page_bytes;
    return committed ? BESIDE_OWN : BESIDE_EMPTY;
}

// Whether the file has all that was committed, of each page the last; but for what closing changes in the header.
static bool is_in_file(struct log *l)
{
    bool same = true;
    for (size_t i = 0; i < l->out->count && same; i++) {
        const struct overlay_page *p = &l->out->pages[i];
        const size_t first = p->number == 1 ? DATABASE_HEADER_BYTES : 0;
        same = read_at(l->bytes, l->page, l->page_bytes, p->at) &&
               read_at(l->file, l->other, l->page_bytes, (int64_t)(p->number - 1) * l->page_bytes) &&
               !memcmp(l->page + first, l->other + first, l->page_bytes - first);
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

static void note_page_one(struct log *l, struct first_pages *f, int64_t at, bool valid)
{
    struct page_one one;
    if (!read_at(l->bytes, l->page, l->page_bytes, at) || !page_one_read(&one, l->page, l->page_bytes))
        return;
    f->contradicts |= page_one_marks_differ(&one, &f->now);
    f->agrees |= page_one_marks_agree(&one, &f->now);
    f->same |= page_one_same_header(&one, &f->now);
    if (valid && !f->any)
        f->first_counter = one.counter;
    f->any |= valid;
}

// Any page of the log, also of its earlier uses, is in the file.
static bool holds_a_page_of_the_file(struct log *l)
{
    uint8_t number[4];
    bool found = false;
    for (int64_t k = 0; k < l->frames && !found; k++)
        found = read_at(l->bytes, number, sizeof number, frame_at(l, k)) && database_number_at(number) &&
                read_at(l->bytes, l->page, l->page_bytes, frame_at(l, k) + FRAME_BYTES) &&
                page_is_in_file(l->file, database_number_at(number), l->page, l->other, l->page_bytes);
    return found;
}

// Before the pages are sorted.
static enum beside prove(struct log *l)
{
    struct first_pages f = {0};
    uint8_t number[4];
    if (!read_at(l->file, l->page, l->page_bytes, 0) || !page_one_read(&f.now, l->page, l->page_bytes))
        return BESIDE_FOREIGN;
    for (size_t i = 0; i < l->out->count; i++)
        if (l->out->pages[i].number == 1)
            note_page_one(l, &f, l->out->pages[i].at, true);
    // Other programs' small commits, and older versions' of this one, do not write page 1. Behind them stand pages of
    // an earlier use of the log, which were all moved into the file.
    for (int64_t k = l->valid; k < l->frames && !f.any && !f.same; k++)
        if (read_at(l->bytes, number, sizeof number, frame_at(l, k)) && database_number_at(number) == 1)
            note_page_one(l, &f, frame_at(l, k) + FRAME_BYTES, false);
    if (f.contradicts)
        return BESIDE_FOREIGN;
    if (f.same)
        return BESIDE_OWN;
    const bool follows = f.any && (f.first_counter == f.now.counter + 1 ||
                                   (f.first_counter == f.now.counter && l->out->page_count >= f.now.pages));
    const bool marked = *f.now.mark != 0, older = !marked && !f.any;
    return (follows && (f.agrees || !marked)) || (older && holds_a_page_of_the_file(l)) ? BESIDE_OWN : BESIDE_FOREIGN;
}

static enum beside read_pages(struct log *l)
{
    uint8_t versions[2];
    enum beside beside = read_frames(l);
    if (beside != BESIDE_OWN)
        return beside;
    if (!read_at(l->file, versions, sizeof versions, VERSIONS_AT))
        return BESIDE_FOREIGN;
    const bool has_log = versions[0] == 2;
    if (has_log)
        beside = prove(l);
    overlay_sort(l->out);
    if (!has_log)
        beside = is_in_file(l) ? BESIDE_EMPTY : BESIDE_FOREIGN;
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
