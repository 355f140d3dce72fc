#include "platform/files/database_sides.h"

#include "platform/files/database_journal.h"
#include "platform/files/database_log.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <unistd.h>

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

enum status database_sides_read(const struct database_sides *s, void *to, size_t count, int64_t at)
{
    const enum status logged = read_beside(&s->side[SIDE_LOG], to, count, at);
    return logged == NOTHING ? read_beside(&s->side[SIDE_JOURNAL], to, count, at) : logged;
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
