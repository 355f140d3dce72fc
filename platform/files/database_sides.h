// The files beside a database, FILE-journal, FILE-wal and FILE-shm, as one connection sees them: which of them may be
// used, what a reader takes from them, and why one is refused. A part of database_files.h, which has the promises.
#pragma once
#include "base/status.h"
#include "platform/files/database_pages.h"

#include <sys/stat.h>

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
MUST_CHECK enum status database_sides_read(const struct database_sides *s, void *to, size_t count, int64_t at);
