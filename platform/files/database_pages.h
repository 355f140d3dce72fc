// Pages of an SQLite file that lie in a file beside it: in its rollback journal, as they were before a change that was
// not finished, or in its write-ahead log, as they were committed last. And how it is proved that such a file belongs
// to the one beside which it lies: SQLite itself takes whatever has the name, and destroys the file with another's.
// Numbers in SQLite's files are big-endian (www.sqlite.org/fileformat2.html).
#pragma once
#include "base/status.h"

enum { DATABASE_HEADER_BYTES = 100, DATABASE_PAGE_MAX = 65536, DATABASE_MARK_DIGITS = 32 };

// 128 random bits, in hexadecimal, that name the file among all others: a view, since that has no page of its own and
// is kept by every copy and VACUUM. It stands in page 1, and so in every journal and log that holds that page.
#define DATABASE_MARK_BEGIN "CREATE VIEW identity AS SELECT '"

// Bytes that are read from a file or from memory.
struct byte_source {
    bool (*read)(void *from, void *to, size_t count, int64_t at); // false: not all of them are there
    void *from;
    int64_t count;
};

struct page_overlay {
    uint32_t page_bytes, page_count; // page_count: of the file with these pages in it
    struct overlay_page {
        uint32_t number; // from 1
        int64_t at;      // of its bytes, in the file beside
    } * pages;
    size_t count, capacity;
};

// What a file beside a database is to it.
enum beside {
    BESIDE_EMPTY,     // it holds nothing that the file needs
    BESIDE_OWN,       // proved; the overlay holds its pages
    BESIDE_FOREIGN,   // of another file, or of another version of this one; or there is no proof
    BESIDE_DAMAGED,   // or no such file at all
    BESIDE_NAMES_ONE, // a journal that names a file to be deleted with it, as none of ours does
    BESIDE_NO_MEMORY,
};

uint32_t database_number_at(const uint8_t *at);

// False: no memory.
MUST_CHECK bool overlay_add(struct page_overlay *overlay, uint32_t number, int64_t at);
// After the last addition: of a page that was added twice the later one counts.
void overlay_sort(struct page_overlay *overlay);
const struct overlay_page *overlay_find(const struct page_overlay *overlay, uint32_t number); // NULL: it is not there
void overlay_free(struct page_overlay *overlay);

// What page 1 says of the file.
struct page_one {
    uint8_t header[DATABASE_HEADER_BYTES];
    uint32_t counter, pages; // of changes; of the file, 0: not valid
    char mark[DATABASE_MARK_DIGITS + 1];
};

// False: it is no SQLite file's.
bool page_one_read(struct page_one *out, const uint8_t *page, size_t count);
bool page_one_same_header(const struct page_one *one, const struct page_one *other);
bool page_one_marks_differ(const struct page_one *one, const struct page_one *other); // both have one
bool page_one_marks_agree(const struct page_one *one, const struct page_one *other);  // likewise
// 0: not known.
uint32_t page_one_page_bytes(const uint8_t header[DATABASE_HEADER_BYTES]);

// Whether a page's bytes are the file's there, and no page that is nearly empty: those are alike in all files.
// `scratch` takes a page.
bool page_is_in_file(const struct byte_source *file, uint32_t number, const uint8_t *page, uint8_t *scratch,
                     uint32_t page_bytes);
