#include "recording/place_copier.h"

#include "recording/recorded_drive.h"
#include "recording/recorded_things.h"
#include "recording/recording_reader.h"

static enum status open_source(struct recording **out, const char *path, enum copier_reads reads)
{
    return recording_open_as(out, path, reads == COPIER_READS_ALL ? DATABASE_READ : DATABASE_SALVAGE);
}

// What remains of an error in reading a part: a take can be shown without it, so only lack of memory ends a repair.
static enum status end_of_part(enum status status, enum copier_reads reads)
{
    return status == NOTHING || (status != ERR_MEMORY && reads == COPIER_READS_WHAT_IT_CAN) ? OK : status;
}

static enum status put_map(const char *to, const struct place *place, enum copier_reads reads,
                           struct place_copy_counts *out)
{
    struct recording_writer *w;
    enum status status = recording_append(&w, to);
    if (status == OK)
        status = recording_put_place(w, place);
    if (status == ERR_INPUT && reads == COPIER_READS_WHAT_IT_CAN) { // more views than a recording can hold
        out->lost_place = true;
        status = OK;
    }
    struct failure first;
    failure_keep(&first, status);
    const enum status closed = recording_close(&w);
    return first.status == OK ? closed : failure_restore(&first);
}

static enum status copy_map(const char *path, const char *to, enum copier_reads reads, struct place_copy_counts *out)
{
    struct recording *r;
    struct place place = {0};
    enum status status = open_source(&r, path, reads);
    if (status == OK)
        status = recording_read_place(r, &place);
    recording_free(&r);
    out->lost_place = status != OK && status != NOTHING;
    if (status != OK)
        return end_of_part(status, reads);
    int32_t undecodable = 0;
    status = place_drop_undecodable_views(&place, &undecodable);
    out->lost_views = place.views_lost + undecodable;
    out->lost_map_covariances = place.errors_lost;
    out->calibration = place.calibration;
    out->has_calibration = true;
    if (status == OK)
        status = put_map(to, &place, reads, out);
    place_free(&place);
    return status;
}

static enum status copy_things(const char *path, const char *to, enum copier_reads reads, struct place_copy_counts *out)
{
    struct recording *r;
    struct recorded_thing *things = NULL;
    struct things_lost lost = {0};
    int count = 0;
    enum status status = open_source(&r, path, reads);
    if (status == OK)
        status = recording_salvage_things(r, &things, &count, &lost);
    recording_free(&r);
    out->lost_things = lost.things + lost.contents + (status != OK); // at least one where a disk fails
    if (status != OK)
        return end_of_part(status, reads);
    status = count ? recording_write_things(to, things, count) : OK;
    recorded_things_free(&things, count);
    return status;
}

static enum status copy_drive(const char *path, const char *to, enum copier_reads reads)
{
    struct recording *r;
    struct recorded_drive drive;
    enum status status = open_source(&r, path, reads);
    if (status == OK)
        status = recording_read_drive(r, &drive);
    recording_free(&r);
    return status == OK ? recording_write_drive(to, &drive) : end_of_part(status, reads);
}

enum status place_copy(const char *path, const char *to, enum copier_reads reads, struct place_copy_counts *out)
{
    *out = (struct place_copy_counts){0};
    enum status status = copy_map(path, to, reads, out);
    if (status == OK)
        status = copy_things(path, to, reads, out);
    return status == OK ? copy_drive(path, to, reads) : status;
}
