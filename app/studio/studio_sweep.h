// The room swept in the studio: frames into the mapper until the sweep ends, then the map. On the session's thread.
#pragma once
#include "capture/mapping/map_advice.h"

#include <stdatomic.h>

enum studio_sweep_end { STUDIO_SWEEP_ON, STUDIO_SWEEP_END, STUDIO_SWEEP_DROP };

struct studio_sweep_wish {
    struct source *source;
    const char *tags;          // tags.json; NULL: by landmarks and depth
    const struct place *prior; // that the sweep adds to; NULL: a new place
    atomic_int *end;           // enum studio_sweep_end
    void (*show)(void *self, const struct frame *frame, const struct sweep_plan *plan);
    void (*finishing)(void *self); // the map is computed now: some seconds
    void *self;
};

struct studio_room {
    struct place place;
    struct sweep_plan plan; // of the finished place
    struct map_advice advice;
    bool cut; // the sensor failed; the map is of what was swept until then
};
void studio_room_free(struct studio_room *room); // zeroed is fine

// OK: *out is filled, the caller frees it. NOTHING: the sweep was dropped. ERR_INPUT: no map can be made, with the
// reason. ERR_DEVICE: the sensor failed before enough for a map was swept. Else as mapper_finish. *out is zeroed unless
// OK.
MUST_CHECK enum status studio_sweep_run(const struct studio_sweep_wish *wish, struct studio_room *out);

// Into the file, which is made where it does not exist; its takes stay.
MUST_CHECK enum status studio_room_keep(const struct studio_room *room, const char *file);

// The place in the file; nothing where there is no file. ERR_CORRUPT, ERR_IO, ERR_MEMORY, ERR_FORMAT.
MUST_CHECK enum status studio_read_place(const char *file, struct place *out, bool *has_place);

// The list of tags beside the file, if there is one: out gets the path. False: none.
bool studio_find_tags(const char *file, char *out, size_t capacity);
