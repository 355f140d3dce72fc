// The files beside a database, FILE-journal, FILE-wal and FILE-shm, as one connection sees them: which of them may be
// used, what a reader takes from them, and why one is refused. A part of database_files.h, which has the promises.
#pragma once
#include "base/status.h"

#include <sys/stat.h>

// ---------------------------------------------------------------- pages in another file

// Pages of an SQLite file that lie in a file beside it: in its rollback journal, as they were before a change that was
// not finished, or in its write-ahead log, as they were committed last. And how it is proved that such a file belongs
// to the one beside which it lies: SQLite itself takes whatever has the name, and destroys the file with another's.
// Numbers in SQLite's files are big-endian (www.sqlite.org/fileformat2.html).

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

// ---------------------------------------------------------------- files beside a database

enum side_kind { SIDE_JOURNAL, SIDE_LOG, SIDE_INDEX, SIDE_COUNT };

struct side {
    char *name;
    int file;         // descriptor of the one that was read last; -1: none
    struct stat seen; // of that
    enum beside beside;
    struct page_overlay pages;
};

struct database_sides {
    const char *path; // for sentences; borrowed
    bool writes;
    struct side side[SIDE_COUNT];
    bool live;           // the log is read as SQLite does
    bool without_log;    // the header's word that there is a log is not passed on
    bool wrote_header;   // this connection has
    uint32_t generation; // how often what is read has become another, by what lies beside the file
    int claim, claims;   // descriptor of the log while it is being changed; -1: there is none, or a writer holds it
    enum status trouble; // of the last look
    char sentence[5000];
};

// The database itself.
struct main_file {
    struct byte_source bytes;
    bool (*is_being_changed)(void *from); // in place, by another connection, which holds a lock from the beginning
};

void database_sides_init(struct database_sides *sides, const char *path, bool writes);
void database_sides_free(struct database_sides *sides);

// `name`: of the database, without links. False: no memory.
MUST_CHECK bool database_sides_name(struct database_sides *sides, const char *name);
bool database_sides_is(const struct database_sides *sides, enum side_kind kind, const char *name);

// To be called with a shared lock on the file, so that nobody comes to change it in place, or enters or leaves
// write-ahead mode. False: sides->trouble and sides->sentence say why.
MUST_CHECK bool database_sides_look(struct database_sides *sides, const struct main_file *file);
// Before that lock is let go.
void database_sides_let_go(struct database_sides *sides);

// Around a change of the log, or of the file by it, by a connection for which database_lock_writer may not have been
// called. False: somebody reads a log that was left.
MUST_CHECK bool database_sides_claim_log(struct database_sides *sides);
void database_sides_give_log(struct database_sides *sides);

// Whether a reader takes pages from beside the file; *bytes: the size of the file with them.
bool database_sides_have_pages(const struct database_sides *sides, int64_t *bytes);
// Bytes of one page from beside the file. NOTHING: it has none of that page. ERR_IO, without a sentence.
MUST_CHECK enum status database_sides_read(const struct database_sides *sides, void *to, size_t count, int64_t at);
