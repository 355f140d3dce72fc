#include "app/studio/studio_sweep.h"

#include "platform/files/file.h"
#include "recording/recording.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

void studio_room_free(struct studio_room *room)
{
    place_free(&room->place);
    *room = (struct studio_room){0};
}

bool studio_find_tags(const char *file, char *out, size_t capacity)
{
    const char *slash = strrchr(file, '/');
    const int folder = slash ? (int)(slash - file) + 1 : 0;
    if (snprintf(out, capacity, "%.*stags.json", folder, file) >= (int)capacity)
        return false;
    return file_exists(out);
}

// Until the source or the sweep ends. A sensor that fails ends it, too, with what there is by then.
static enum status feed(const struct studio_sweep_wish *wish, struct mapper *mapper, struct sweep_trouble *trouble)
{
    for (bool any = false;; any = true) {
        struct frame frame;
        if (atomic_load(wish->end) == STUDIO_SWEEP_DROP)
            return NOTHING;
        if (atomic_load(wish->end) == STUDIO_SWEEP_END)
            return OK;
        enum status status = source_next(wish->source, &frame);
        if (status == NOTHING)
            return OK;
        if (status == ERR_INPUT) {
            trouble->damaged++;
            continue;
        }
        if (status == ERR_DEVICE && any) {
            snprintf(trouble->cut, sizeof trouble->cut, "%s", status_message());
            return OK;
        }
        if (status == OK)
            status = mapper_add(mapper, &frame);
        if (status != OK)
            return status;
        wish->show(wish->self, &frame, mapper_plan(mapper));
    }
}

enum status studio_sweep_run(const struct studio_sweep_wish *wish, struct studio_room *out)
{
    struct mapper *mapper = NULL;
    struct mapper_tag *tags = NULL;
    struct mapper_report report;
    int32_t count = 0;
    struct sweep_trouble trouble = {0};
    struct mapper_options options = mapper_default_options();
    options.prior = wish->prior;
    options.plan = true;
    *out = (struct studio_room){0};
    enum status status = wish->tags ? mapper_read_tags(wish->tags, &tags, &count) : OK;
    if (status == OK)
        status = mapper_open(&mapper, source_calibration(wish->source), tags, count, &options);
    if (status == OK)
        status = feed(wish, mapper, &trouble);
    if (status == OK) {
        wish->finishing(wish->self);
        status = mapper_finish(mapper, &out->place, &report);
        if (status == ERR_INPUT && *trouble.cut) // too little of the room: then the sensor is what to mend
            status = fail(ERR_DEVICE, "%s", trouble.cut);
    }
    if (status == OK) {
        out->cut = *trouble.cut;
        map_advise(&out->place, &report, &trouble, &out->advice);
        sweep_plan_of_place(&out->place, &out->plan);
        for (int32_t i = 0; i < count; i++) // those that are not in the place, too
            sweep_plan_set_tag(&out->plan, tags[i].id, false, NULL, 0);
    }
    mapper_close(&mapper);
    free(tags);
    return status;
}

enum status studio_room_keep(const struct studio_room *room, const char *file)
{
    struct recording_writer *writer = NULL;
    const bool existed = file_exists(file);
    enum status status = existed ? recording_append(&writer, file) : recording_create(&writer, file);
    if (status != OK)
        return status;
    status = recording_put_place(writer, &room->place);
    struct failure first;
    failure_keep(&first, status);
    enum status closed = recording_close(&writer);
    if ((status != OK || closed != OK) && !existed)
        recording_discard(file);
    return status != OK ? failure_restore(&first) : closed;
}

enum status studio_read_place(const char *file, struct place *out, bool *has_place)
{
    struct recording *recording = NULL;
    if (!file_exists(file))
        return OK;
    enum status status = recording_open(&recording, file);
    if (status == OK)
        status = recording_read_place(recording, out);
    recording_free(&recording);
    *has_place = status == OK && out->tag_count + out->point_count > 0;
    return status == NOTHING ? OK : status;
}
