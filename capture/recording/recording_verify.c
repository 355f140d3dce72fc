// Verifies and repairs a recording. recording_salvage.c copies what can be read of a damaged one.
#include "capture/recording/recorded_things.h"
#include "capture/recording/recording_reader.h"

#include "capture/recording/recording_salvage.h"
#include "platform/file.h"
#include "platform/jpeg.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

// ------------------------------------------------------------- verify

// Keeps the first failure; verification continues.
static void keep_first(struct failure *f, enum status status)
{
    if (status != NOTHING && f->status == OK)
        failure_keep(f, status);
}

static enum status check_place(struct recording *r)
{
    struct place place;
    enum status status = recording_read_place(r, &place);
    if (status != OK)
        return status;
    const struct calibration *c = &place.calibration;
    uint8_t *rgb = malloc((size_t)c->color.width * (size_t)c->color.height * 3 + 1);
    if (!rgb)
        status = fail(ERR_MEMORY, "no memory for an image");
    for (int32_t i = 0; status == OK && i < place.view_count; i++) {
        const struct place_view *view = &place.views[i];
        if (view->jpeg)
            status = jpeg_decode(view->jpeg, view->jpeg_bytes, rgb, c->color.width, c->color.height);
    }
    if (status == ERR_CORRUPT)
        status = fail(status, "%s: a view of the place: %s", database_path(recording_database(r)), status_message());
    free(rgb);
    place_free(&place);
    return status;
}

static void check_take(struct recording *r, const char *name, struct recording_report *out, struct failure *found)
{
    struct take *t;
    enum status status = take_open(&t, r, name);
    keep_first(found, status);
    if (status != OK)
        return;
    out->takes++;
    out->interrupted_takes += !take_is_complete(t);
    for (int64_t i = 0; i < take_frame_count(t); i++) {
        struct take_images images;
        status = take_read(t, i, TAKE_COLOR | TAKE_DEPTH | TAKE_MASK, &images);
        keep_first(found, status);
        out->frames++;
        out->damaged_frames += status != OK;
    }
    take_close(&t);
}

// Bytes of the file and of its write-ahead log.
static int64_t size_of(const char *path)
{
    static const char *const endings[] = {"", "-wal"};
    int64_t bytes = 0;
    for (size_t i = 0; i < COUNT_OF(endings); i++) {
        char name[4200];
        struct stat info;
        snprintf(name, sizeof name, "%s%s", path, endings[i]);
        if (!stat(name, &info))
            bytes += info.st_size;
    }
    return bytes;
}

enum status recording_verify(const char *path, struct recording_report *out)
{
    *out = (struct recording_report){0};
    struct recording *r;
    struct failure found = {0};
    enum status status = recording_open(&r, path);
    if (status != OK)
        return status;
    out->bytes = size_of(path);
    keep_first(&found, database_check(recording_database(r)));
    keep_first(&found, check_place(r));
    struct recorded_thing *things;
    int thing_count;
    keep_first(&found, recording_read_things(r, &things, &thing_count));
    recorded_things_free(&things, thing_count);
    for (int i = 0; i < recording_take_count(r); i++) {
        const char *name = recording_take_name(r, i);
        check_take(r, name, out, &found);
        for (int k = 0; k < i; k++)
            if (!strcmp(recording_take_name(r, k), name))
                keep_first(&found, fail(ERR_CORRUPT, "%s has two takes '%s'", path, name));
    }
    recording_free(&r);
    return failure_restore(&found);
}

// ------------------------------------------------------------- repair

// An undamaged file: marks interrupted takes as complete and checkpoints the log.
static enum status complete_and_checkpoint(const char *path)
{
    struct database *db;
    enum status status = database_open(&db, path, DATABASE_WRITE);
    if (status == OK)
        status = database_lock_writer(db);
    if (status == OK)
        status = recording_complete_takes(db);
    if (status == OK)
        status = database_close_wal(db);
    database_close(&db);
    return status;
}

static enum status rename_with_log(const char *from, const char *to)
{
    static const char *const endings[] = {"", "-wal", "-shm"};
    for (size_t i = 0; i < COUNT_OF(endings); i++) {
        char old[4200], new[4200];
        snprintf(old, sizeof old, "%s%s", from, endings[i]);
        snprintf(new, sizeof new, "%s%s", to, endings[i]);
        if (rename(old, new) && !(i && errno == ENOENT))
            return fail(ERR_IO, "%s cannot be renamed to %s: %s", old, new, strerror(errno));
    }
    return OK;
}

enum status recording_repair(const char *path, struct recording_report *out)
{
    enum status status = recording_verify(path, out);
    if (status == OK) {
        bool has_log = out->interrupted_takes || !database_is_single_file(path);
        return has_log ? complete_and_checkpoint(path) : OK;
    }
    if (status != ERR_CORRUPT)
        return status;
    char damaged[4100], fresh[4100];
    if (snprintf(damaged, sizeof damaged, "%s.damaged", path) >= (int)sizeof damaged)
        return fail(ERR_INPUT, "the path %.60s… is too long", path);
    snprintf(fresh, sizeof fresh, "%s.repair", path);
    if (file_exists(damaged))
        return fail(ERR_EXISTS, "%s is there from an earlier repair; move it away first", damaged);
    recording_remove_files(fresh); // left by an interrupted repair
    status = recording_salvage(path, fresh, out);
    if (status == OK)
        status = rename_with_log(path, damaged);
    if (status == OK && rename(fresh, path)) {
        status = fail(ERR_IO, "%s cannot be renamed to %s: %s", fresh, path, strerror(errno));
        enum status back = rename_with_log(damaged, path);
        (void)back; // the first error is reported
    }
    if (status != OK) {
        struct failure first;
        failure_keep(&first, status);
        recording_remove_files(fresh);
        return failure_restore(&first);
    }
    out->bytes = size_of(path);
    return OK;
}
