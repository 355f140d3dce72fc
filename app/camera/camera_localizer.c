#include "app/camera/camera_localizer.h"

#include "app/camera/relocalizer.h"

#include <stdlib.h>

// Two pictures in which it is found say how fast the camera moves; if it cannot be followed then, it never will.
enum { MAX_FINDS = 2 };

struct camera_localizer {
    struct camera_tracker *track;
    struct relocalizer *relocalizer;
    struct lens lens; // the track's, which may be lent
    int64_t last_ns;
    bool searching;                  // the track is lent to the search
    int finds;                       // pictures in which it was found since one was followed
    bool restarted;                  // the camera's clock began anew meanwhile
    int32_t moved_tags, first_moved; // the track's, which may be lent
};

enum status localizer_open(struct camera_localizer **out, const struct place *place, const struct lens *lens,
                           struct present_gap *gap)
{
    *out = NULL;
    struct camera_localizer *f = calloc(1, sizeof *f);
    if (!f)
        return fail(ERR_MEMORY, "out of memory");
    *f = (struct camera_localizer){.lens = *lens, .last_ns = INT64_MIN, .finds = MAX_FINDS, .first_moved = -1};
    enum status status = camera_tracker_open(&f->track, place, lens, NULL);
    if (status == OK)
        status = relocalizer_open(&f->relocalizer, lens->width, lens->height, gap);
    if (status != OK) {
        localizer_close(&f);
        return status;
    }
    *out = f;
    return OK;
}

const struct lens *localizer_lens(const struct camera_localizer *f) { return &f->lens; }

int32_t localizer_moved_tags(const struct camera_localizer *f, int32_t *first)
{
    *first = f->first_moved;
    return f->moved_tags;
}

void localizer_close(struct camera_localizer **f)
{
    if (*f) {
        relocalizer_close(&(*f)->relocalizer); // before the track, which it may have
        camera_tracker_close(&(*f)->track);
        free(*f);
    }
    *f = NULL;
}

static enum status relocalize_in_background(struct camera_localizer *f, const uint8_t *color, int64_t time_ns)
{
    relocalizer_begin(f->relocalizer, f->track, color, time_ns, MAX_FINDS - f->finds);
    f->searching = true;
    return NOTHING;
}

static enum status track_or_find(struct camera_localizer *f, const uint8_t *color, int64_t time_ns,
                                 struct location *location)
{
    struct camera_motion motion;
    enum status status = camera_tracker_track(f->track, color, NULL, time_ns, location, &motion);
    if (status == OK)
        f->finds = 0;
    if (status == NOTHING && f->finds >= MAX_FINDS)
        status = camera_tracker_localize(f->track, color, NULL, location, &motion);
    else if (status == NOTHING)
        return relocalize_in_background(f, color, time_ns);
    f->lens = *camera_tracker_lens(f->track);
    f->moved_tags = camera_tracker_moved_tags(f->track, &f->first_moved);
    return status;
}

enum status localizer_locate(struct camera_localizer *f, const uint8_t *color, int64_t time_ns,
                             struct pose *world_from_camera)
{
    struct location location;
    enum status status = OK;
    f->restarted |= time_ns <= f->last_ns;
    f->last_ns = time_ns;
    if (f->searching) {
        if (relocalizer_busy(f->relocalizer, color, time_ns))
            return NOTHING;
        f->searching = false;
        int finds;
        status = relocalizer_finish(f->relocalizer, &finds);
        f->finds += finds;
    }
    if (f->restarted) // a camera that was opened anew
        camera_tracker_reset(f->track);
    f->restarted = false;
    if (status >= 0)
        status = track_or_find(f, color, time_ns, &location);
    if (status == ERR_SOLVER)
        return NOTHING; // it gave up on this picture, no more
    if (status == OK || status == AMBIGUOUS)
        *world_from_camera = location.world_from_camera;
    return status;
}
