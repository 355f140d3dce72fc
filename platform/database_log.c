#include "platform/database_log.h"

#include <sqlite3.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// SQLite's file formats (www.sqlite.org/fileformat2.html, sections 1.3 and 4.1). Numbers are big-endian.
enum {
    VERSIONS_AT = 18, // in the file's header: of writing and reading; 1 rollback journal, 2 write-ahead log
    FILE_HEADER_BYTES = 100,
    LOG_HEADER_BYTES = 32,
    LOG_PAGE_SIZE_AT = 8,
    LOG_SALTS_AT = 16,
    FRAME_HEADER_BYTES = 24, // of a page in the log
    FRAME_COMMIT_AT = 4,     // pages of the file after the commit that the frame ends; 0: it ends none
    FRAME_SALTS_AT = 8,
    SALTS_BYTES = 8,
    LARGEST_PAGE = 65536,
};

static uint32_t number_at(const uint8_t *at)
{
    return (uint32_t)at[0] << 24 | (uint32_t)at[1] << 16 | (uint32_t)at[2] << 8 | at[3];
}

struct log_file {
    FILE *file;
    uint32_t page_bytes;
    uint8_t salts[SALTS_BYTES];
    int64_t frames; // up to the last commit
};

static bool read_frame(const struct log_file *l, int64_t frame, uint8_t header[FRAME_HEADER_BYTES], uint8_t *page)
{
    const int64_t at = LOG_HEADER_BYTES + frame * (FRAME_HEADER_BYTES + (int64_t)l->page_bytes);
    return !fseeko(l->file, at, SEEK_SET) && fread(header, FRAME_HEADER_BYTES, 1, l->file) == 1 &&
           (!page || fread(page, l->page_bytes, 1, l->file) == 1);
}

// False: it is no log, or there is no commit in it.
static bool open_log(struct log_file *l, const char *path)
{
    uint8_t header[LOG_HEADER_BYTES], frame[FRAME_HEADER_BYTES];
    *l = (struct log_file){.file = fopen(path, "rb")};
    if (!l->file || fread(header, sizeof header, 1, l->file) != 1)
        return false;
    l->page_bytes = number_at(header + LOG_PAGE_SIZE_AT);
    memcpy(l->salts, header + LOG_SALTS_AT, SALTS_BYTES);
    if (l->page_bytes < 512 || l->page_bytes > LARGEST_PAGE)
        return false;
    // Frames with other salts are left of an earlier use of the log.
    for (int64_t k = 0; read_frame(l, k, frame, NULL) && !memcmp(frame + FRAME_SALTS_AT, l->salts, SALTS_BYTES); k++)
        if (number_at(frame + FRAME_COMMIT_AT))
            l->frames = k + 1;
    return l->frames > 0;
}

// Whether the file has this page as the log does, but for what closing it changes in the header.
static bool same_page(sqlite3_file *file, uint32_t number, const uint8_t *logged, uint8_t *page, uint32_t bytes)
{
    if (!number || file->pMethods->xRead(file, page, (int)bytes, (int64_t)(number - 1) * bytes) != SQLITE_OK)
        return false;
    const size_t first = number == 1 ? FILE_HEADER_BYTES : 0;
    return !memcmp(page + first, logged + first, bytes - first);
}

// Whether the file has all that was committed to the log: of each page the last that is there.
static bool is_in_file(const struct log_file *l, sqlite3_file *file)
{
    sqlite3_int64 bytes = 0;
    file->pMethods->xFileSize(file, &bytes);
    const int64_t pages = bytes / l->page_bytes;
    uint8_t header[FRAME_HEADER_BYTES], *logged = malloc(l->page_bytes), *page = malloc(l->page_bytes);
    bool *seen = calloc((size_t)pages + 1, sizeof *seen), same = true;
    const bool able = logged && page && seen; // without memory it counts as the file's; opening the file will say so
    for (int64_t k = l->frames - 1; k >= 0 && same && able; k--) {
        same = read_frame(l, k, header, logged);
        const uint32_t number = same ? number_at(header) : 0;
        same = same && number <= pages && (seen[number] || same_page(file, number, logged, page, l->page_bytes));
        if (same)
            seen[number] = true;
    }
    free(logged);
    free(page);
    free(seen);
    return same;
}

bool database_log_is_foreign(const char *path, const char *log)
{
    static const char magic[] = "SQLite format 3";
    uint8_t header[FILE_HEADER_BYTES] = {0};
    sqlite3 *handle = NULL;
    sqlite3_file *file = NULL;
    struct log_file l;
    const bool has_commits = open_log(&l, log);
    // Through SQLite, which knows of other connections' locks. Nothing is asked of it that would make it read the log.
    const bool open = has_commits &&
                      sqlite3_open_v2(path, &handle, SQLITE_OPEN_READONLY | SQLITE_OPEN_NOMUTEX, NULL) == SQLITE_OK &&
                      sqlite3_file_control(handle, "main", SQLITE_FCNTL_FILE_POINTER, &file) == SQLITE_OK && file &&
                      file->pMethods && file->pMethods->xRead(file, header, sizeof header, 0) == SQLITE_OK;
    const bool foreign =
        open && !memcmp(header, magic, sizeof magic) && header[VERSIONS_AT] == 1 && !is_in_file(&l, file);
    sqlite3_close(handle);
    if (l.file)
        fclose(l.file);
    return foreign;
}
