// Files to be planted beside a recording: journals and logs of programs that were killed, and a journal that names a
// file to be deleted with it.
#pragma once
#include "recording/recording_reader.h"
#include "tests/support/recording_sample.h"

#include <sys/wait.h>

struct bytes {
    uint8_t *at;
    size_t count;
};

static inline struct bytes bytes_of(const char *name)
{
    struct bytes b;
    EXPECT_STATUS(file_read(name, &b.at, &b.count), OK);
    return b;
}

static inline void put(const char *name, struct bytes b)
{
    unlink(name);
    EXPECT_STATUS(file_write_unsynced(name, b.at, b.count), OK);
}

static inline bool is_same(const char *name, struct bytes wanted)
{
    const struct bytes now = bytes_of(name);
    const bool same = now.count == wanted.count && !memcmp(now.at, wanted.at, now.count);
    free(now.at);
    return same;
}

static inline const char *beside(const char *name, const char *ending)
{
    static char text[2][300];
    static int slot;
    slot = !slot;
    snprintf(text[slot], sizeof text[slot], "%s%s", name, ending);
    return text[slot];
}

// Ends like a program that is killed, after `work`.
static inline void die_after(enum status (*work)(const char *name), const char *name)
{
    fflush(NULL);
    const pid_t child = fork();
    if (!child)
        _exit(work(name) != OK);
    int how;
    EXPECT_INT(waitpid(child, &how, 0), child);
    EXPECT_TRUE(WIFEXITED(how) && !WEXITSTATUS(how));
}

static inline enum status change_halfway(const char *name)
{
    struct database *db;
    enum status status = database_open(&db, name, DATABASE_WRITE);
    if (status == OK)
        status = database_run(db, "PRAGMA journal_mode = DELETE; PRAGMA cache_size = 4; BEGIN;"
                                  "UPDATE picture SET depth = randomblob(length(depth)), mask = randomblob(9000);"
                                  "DELETE FROM frame WHERE id % 2");
    return status;
}

static inline enum status add_a_take(const char *name)
{
    const struct calibration calibration = sample_calibration();
    struct recording_writer *w;
    enum status status = recording_append(&w, name);
    if (status == OK)
        status = recording_begin_take(w, "last", &calibration);
    if (status != OK)
        return status;
    sample_frames_add(w, 0, 20);
    return recording_put_place(w, &(struct place){.calibration = calibration}); // commits what there is
}

// The journal, with that name at its end: a journal of two files ends in the name of theirs. The caller frees it.
static inline struct bytes named(struct bytes of, const char *name)
{
    static const uint8_t magic[8] = {0xd9, 0xd5, 0x05, 0xf9, 0x20, 0xa1, 0x63, 0xd7};
    const uint32_t sector = 512, length = (uint32_t)strlen(name), page = 65536;
    const size_t begin = (of.count + sector - 1) / sector * sector;
    struct bytes b = {calloc(1, begin + 4 + length + 16), begin + 4 + length + 16};
    uint32_t sum = 0;
    for (uint32_t i = 0; i < length; i++)
        sum += (uint32_t)(int32_t)(signed char)name[i];
    const uint32_t numbers[3] = {0x40000000 / page + 1, length, sum};
    const size_t at[3] = {begin, begin + 4 + length, begin + 8 + length};
    memcpy(b.at, of.at, of.count);
    for (int k = 0; k < 3; k++)
        for (int i = 0; i < 4; i++)
            b.at[at[k] + (size_t)i] = (uint8_t)(numbers[k] >> (24 - 8 * i));
    memcpy(b.at + begin + 4, name, length);
    memcpy(b.at + begin + 12 + length, magic, sizeof magic);
    return b;
}
