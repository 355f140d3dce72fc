#include "app/finder.h"

#include "locate/track.h"

#include <stdlib.h>

struct finder {
    struct camera_track *track;
    const struct place *place;
    struct lens lens;
    int64_t last_ns;
};

enum status finder_open(struct finder **out, const struct place *place, const struct lens *lens)
{
    *out = NULL;
    struct finder *f = calloc(1, sizeof *f);
    if (!f)
        return fail(ERR_MEMORY, "out of memory");
    *f = (struct finder){.place = place, .lens = *lens, .last_ns = INT64_MIN};
    enum status status = camera_track_open(&f->track, place, lens, NULL);
    if (status != OK) {
        finder_close(&f);
        return status;
    }
    *out = f;
    return OK;
}

void finder_close(struct finder **f)
{
    if (*f) {
        camera_track_close(&(*f)->track);
        free(*f);
    }
    *f = NULL;
}

enum status finder_find(struct finder *f, const uint8_t *color, int64_t time_ns, struct pose *world_from_camera)
{
    struct location location;
    struct camera_motion motion;
    if (time_ns <= f->last_ns) { // a camera that was opened anew: what was known of its motion is void
        camera_track_close(&f->track);
        enum status status = camera_track_open(&f->track, f->place, &f->lens, NULL);
        if (status != OK)
            return status;
    }
    f->last_ns = time_ns;
    enum status status = camera_track_look(f->track, color, NULL, time_ns, &location, &motion);
    if (status == ERR_SOLVER)
        return NOTHING; // it gave up on this picture, no more
    if (status == OK || status == AMBIGUOUS)
        *world_from_camera = location.world_from_camera;
    return status;
}
