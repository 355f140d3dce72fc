#include "app/camera/camera_localizer.h"

#include "app/camera/relocalizer.h"

#include <stdlib.h>

// Two pictures in which it is found say how fast the camera moves; if it cannot be followed then, it never will.
enum { MOST_FINDS = 2 };

struct finder {
    struct camera_track *track;
    struct search *search;
    struct lens lens; // the track's, which may be lent
    int64_t last_ns;
    bool searching;                  // the track is lent to the search
    int finds;                       // pictures in which it was found since one was followed
    bool restarted;                  // the camera's clock began anew meanwhile
    int32_t moved_tags, first_moved; // the track's, which may be lent
};

enum status finder_open(struct finder **out, const struct place *place, const struct lens *lens, struct lull *lull)
{
    *out = NULL;
    struct finder *f = calloc(1, sizeof *f);
    if (!f)
        return fail(ERR_MEMORY, "out of memory");
    *f = (struct finder){.lens = *lens, .last_ns = INT64_MIN, .finds = MOST_FINDS, .first_moved = -1};
    enum status status = camera_track_open(&f->track, place, lens, NULL);
    if (status == OK)
        status = search_open(&f->search, lens->width, lens->height, lull);
    if (status != OK) {
        finder_close(&f);
        return status;
    }
    *out = f;
    return OK;
}

const struct lens *finder_lens(const struct finder *f) { return &f->lens; }

int32_t finder_moved_tags(const struct finder *f, int32_t *first)
{
    *first = f->first_moved;
    return f->moved_tags;
}

void finder_close(struct finder **f)
{
    if (*f) {
        search_close(&(*f)->search); // before the track, which it may have
        camera_track_close(&(*f)->track);
        free(*f);
    }
    *f = NULL;
}

static enum status search_meanwhile(struct finder *f, const uint8_t *color, int64_t time_ns)
{
    search_begin(f->search, f->track, color, time_ns, MOST_FINDS - f->finds);
    f->searching = true;
    return NOTHING;
}

static enum status look(struct finder *f, const uint8_t *color, int64_t time_ns, struct location *location)
{
    struct camera_motion motion;
    enum status status = camera_track_follow(f->track, color, NULL, time_ns, location, &motion);
    if (status == OK)
        f->finds = 0;
    if (status == NOTHING && f->finds >= MOST_FINDS)
        status = camera_track_find(f->track, color, NULL, location, &motion);
    else if (status == NOTHING)
        return search_meanwhile(f, color, time_ns);
    f->lens = *camera_track_lens(f->track);
    f->moved_tags = camera_track_moved_tags(f->track, &f->first_moved);
    return status;
}

enum status finder_find(struct finder *f, const uint8_t *color, int64_t time_ns, struct pose *world_from_camera)
{
    struct location location;
    enum status status = OK;
    f->restarted |= time_ns <= f->last_ns;
    f->last_ns = time_ns;
    if (f->searching) {
        if (search_goes_on(f->search, color, time_ns))
            return NOTHING;
        f->searching = false;
        int finds;
        status = search_end(f->search, &finds);
        f->finds += finds;
    }
    if (f->restarted) // a camera that was opened anew
        camera_track_restart(f->track);
    f->restarted = false;
    if (status >= 0)
        status = look(f, color, time_ns, &location);
    if (status == ERR_SOLVER)
        return NOTHING; // it gave up on this picture, no more
    if (status == OK || status == AMBIGUOUS)
        *world_from_camera = location.world_from_camera;
    return status;
}
