#include "platform/files/database_journal.h"

#include <stdlib.h>
#include <string.h>

enum {
    HEADER_BYTES = 28, // of a header; it fills a sector
    RECORDS_AT = 8,    // that were synced; ALL_RECORDS: as many as there are
    NONCE_AT = 12,     // where the checksums begin
    PAGES_AT = 16,     // of the file before the change
    SECTOR_AT = 20,
    PAGE_BYTES_AT = 24,
    CHECKSUM_STEP = 200, // only every so many bytes are summed up
    PENDING_BYTE = 0x40000000,
    VERSIONS_AT = 18, // in the file's header: journal or log
    COUNTER_AT = 24,
    VALID_AT = 92, // and SQLite's version number behind it
};
static const uint32_t ALL_RECORDS = 0xffffffff;
static const uint8_t magic[8] = {0xd9, 0xd5, 0x05, 0xf9, 0x20, 0xa1, 0x63, 0xd7};

struct journal {
    const struct byte_source *bytes, *file;
    uint32_t sector, page_bytes, pages, nonce;
    struct page_overlay *out;
    uint8_t *page, *other;
};

static bool read_at(const struct byte_source *source, void *to, size_t count, int64_t at)
{
    return at >= 0 && at + (int64_t)count <= source->count && source->read(source->from, to, count, at);
}

// A journal of several files ends in the name of theirs, its length, its checksum and the magic number.
static bool names_a_file(const struct byte_source *journal)
{
    uint8_t end[sizeof magic];
    return journal->count >= 16 && read_at(journal, end, sizeof end, journal->count - (int64_t)sizeof end) &&
           !memcmp(end, magic, sizeof magic);
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
        if (!read_at(journal->bytes, number, sizeof number, *at) ||
            !read_at(journal->bytes, journal->page, journal->page_bytes, *at + 4) ||
            !read_at(journal->bytes, sum, sizeof sum, *at + 4 + journal->page_bytes))
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

static enum beside read_header(struct journal *journal, uint8_t header[HEADER_BYTES])
{
    uint8_t of_file[DATABASE_HEADER_BYTES];
    if (!read_at(journal->bytes, header, HEADER_BYTES, 0) || memcmp(header, magic, sizeof magic))
        return BESIDE_DAMAGED;
    journal->sector = database_number_at(header + SECTOR_AT);
    journal->page_bytes = database_number_at(header + PAGE_BYTES_AT);
    journal->pages = database_number_at(header + PAGES_AT);
    if (journal->sector < 32 || journal->sector > 65536 || journal->sector & (journal->sector - 1) ||
        journal->page_bytes < 512 || journal->page_bytes > DATABASE_PAGE_MAX ||
        journal->page_bytes & (journal->page_bytes - 1))
        return BESIDE_DAMAGED;
    if (!journal->pages && !journal->file->count) // of a file that was being made
        return BESIDE_OWN;
    return read_at(journal->file, of_file, sizeof of_file, 0) && page_one_page_bytes(of_file) == journal->page_bytes
               ? BESIDE_OWN
               : BESIDE_FOREIGN;
}

// Each header stands in front of what was written between two syncs.
static enum beside read_all(struct journal *journal, uint8_t header[HEADER_BYTES])
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
        if (!stated || !read_at(journal->bytes, header, HEADER_BYTES, at) || memcmp(header, magic, sizeof magic))
            break;
    }
    return beside;
}

// Whether nothing but what every change writes into the header differs.
static bool differs_in_header_only(const uint8_t *page, const uint8_t *other, uint32_t page_bytes)
{
    return !memcmp(page, other, VERSIONS_AT) &&
           !memcmp(page + VERSIONS_AT + 2, other + VERSIONS_AT + 2, COUNTER_AT - VERSIONS_AT - 2) &&
           !memcmp(page + COUNTER_AT + 4, other + COUNTER_AT + 4, VALID_AT - COUNTER_AT - 4) &&
           !memcmp(page + VALID_AT + 8, other + VALID_AT + 8, page_bytes - VALID_AT - 8);
}

// Another page than the first is in the file as it is in the journal: the change had not come to it.
static bool holds_a_page_of_the_file(struct journal *journal)
{
    bool found = false;
    for (size_t i = 0; i < journal->out->count && !found; i++)
        found = journal->out->pages[i].number != 1 &&
                read_at(journal->bytes, journal->page, journal->page_bytes, journal->out->pages[i].at) &&
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
    if (!first || !read_at(journal->bytes, journal->page, journal->page_bytes, first->at) ||
        !read_at(journal->file, journal->other, journal->page_bytes, 0) ||
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
    return page_one_marks_agree(&before, &now) || alone || holds_a_page_of_the_file(journal) ? BESIDE_OWN
                                                                                             : BESIDE_FOREIGN;
}

enum beside database_journal_read(struct page_overlay *out, const struct byte_source *journal,
                                  const struct byte_source *file)
{
    struct journal j = {.bytes = journal, .file = file, .out = out};
    uint8_t header[HEADER_BYTES], first;
    *out = (struct page_overlay){0};
    // SQLite marks a journal as done with by a 0 where it keeps the file.
    if (!read_at(journal, &first, 1, 0) || !first)
        return BESIDE_EMPTY;
    if (names_a_file(journal))
        return BESIDE_NAMES_ONE;
    enum beside beside = read_header(&j, header);
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
