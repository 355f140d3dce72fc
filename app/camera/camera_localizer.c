#include "app/camera/camera_localizer.h"

#include "app/camera/relocalizer.h"

#include <stdlib.h>

// Localised in two images, the camera's velocity is known; if it cannot be tracked then, it never will.
enum { MAX_FINDS = 2 };

struct camera_localizer {
    struct camera_tracker *tracker;
    struct relocalizer *relocalizer;
    struct lens lens; // the tracker's, which may be lent
    int64_t last_ns;
    bool relocalizing;               // the tracker is lent to the relocalizer
    int finds;                       // images localised from scratch since one was tracked
    bool restarted;                  // the camera's clock has restarted
    int32_t moved_tags, first_moved; // the tracker's, which may be lent
};

enum status localizer_open(struct camera_localizer **out, const struct place *place, const struct lens *lens,
                           struct present_gap *gap)
{
    *out = NULL;
    struct camera_localizer *l = calloc(1, sizeof *l);
    if (!l)
        return fail(ERR_MEMORY, "out of memory");
    *l = (struct camera_localizer){.lens = *lens, .last_ns = INT64_MIN, .finds = MAX_FINDS, .first_moved = -1};
    enum status status = camera_tracker_open(&l->tracker, place, lens, NULL);
    if (status == OK)
        status = relocalizer_open(&l->relocalizer, lens->width, lens->height, gap);
    if (status != OK) {
        localizer_close(&l);
        return status;
    }
    *out = l;
    return OK;
}

const struct lens *localizer_lens(const struct camera_localizer *l) { return &l->lens; }

int32_t localizer_moved_tags(const struct camera_localizer *l, int32_t *first)
{
    *first = l->first_moved;
    return l->moved_tags;
}

void localizer_close(struct camera_localizer **l)
{
    if (*l) {
        relocalizer_close(&(*l)->relocalizer); // before the tracker, which may be lent to it
        camera_tracker_close(&(*l)->tracker);
        free(*l);
    }
    *l = NULL;
}

static enum status relocalize_in_background(struct camera_localizer *l, const uint8_t *color, int64_t time_ns)
{
    relocalizer_begin(l->relocalizer, l->tracker, color, time_ns, MAX_FINDS - l->finds);
    l->relocalizing = true;
    return NOTHING;
}

static enum status track_or_find(struct camera_localizer *l, const uint8_t *color, int64_t time_ns,
                                 struct location *location)
{
    struct camera_motion motion;
    enum status status = camera_tracker_track(l->tracker, color, NULL, time_ns, location, &motion);
    if (status == OK)
        l->finds = 0;
    if (status == NOTHING && l->finds >= MAX_FINDS)
        status = camera_tracker_localize(l->tracker, color, NULL, location, &motion);
    else if (status == NOTHING)
        return relocalize_in_background(l, color, time_ns);
    l->lens = *camera_tracker_lens(l->tracker);
    l->moved_tags = camera_tracker_moved_tags(l->tracker, &l->first_moved);
    return status;
}

enum status localizer_locate(struct camera_localizer *l, const uint8_t *color, int64_t time_ns,
                             struct pose *world_from_camera)
{
    struct location location;
    enum status status = OK;
    l->restarted |= time_ns <= l->last_ns;
    l->last_ns = time_ns;
    if (l->relocalizing) {
        if (relocalizer_busy(l->relocalizer, color, time_ns))
            return NOTHING;
        l->relocalizing = false;
        int finds;
        status = relocalizer_finish(l->relocalizer, &finds);
        l->finds += finds;
    }
    if (l->restarted) // the camera was opened again
        camera_tracker_reset(l->tracker);
    l->restarted = false;
    if (status >= 0)
        status = track_or_find(l, color, time_ns, &location);
    if (status == ERR_SOLVER)
        return NOTHING; // only this image failed
    if (status == OK || status == AMBIGUOUS)
        *world_from_camera = location.world_from_camera;
    return status;
}
