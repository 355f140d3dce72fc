// Tags that hang elsewhere than the place has them: somebody took them down since it was mapped, or shows another one
// with the same number. The pose is told without them; here it is kept which they are, so that somebody may say so.
#include "locate/locator_internal.h"

// What vouches for a pose by which a tag is found to hang elsewhere.
enum { LEAST_OTHER_TAGS = 2, LEAST_POINTS = 20 };
// A tag that is less off, of its side, may be half hidden, bent or badly read.
static const double LEAST_SHARE = 0.25;

static bool is_elsewhere(const struct locator *l, int i, const struct pose *camera_from_world)
{
    const struct place_tag *tag = &l->tags[l->which[i]];
    const struct pose expected = pose_multiply(*camera_from_world, tag->world_from_tag);
    return square_off_m(tag->side_m, l->sightings[i].ray, &expected) > LEAST_SHARE * tag->side_m;
}

void locator_note_moved(struct locator *l, const struct fit_tag *tags, int points, const struct pose *camera_from_world)
{
    int used = 0;
    for (int i = 0; i < l->count; i++)
        used += tags[i].used;
    if (used < LEAST_OTHER_TAGS && points < LEAST_POINTS)
        return;
    for (int i = 0; i < l->count; i++) {
        int32_t *votes = &l->moved_votes[l->which[i]];
        if (tags[i].used)
            --*votes;
        else if (is_elsewhere(l, i, camera_from_world))
            ++*votes;
    }
}

int32_t locator_moved_tags(const struct locator *l, int32_t *first)
{
    int32_t count = 0;
    *first = -1;
    for (int32_t k = 0; k < l->tag_count; k++) {
        if (l->moved_votes[k] <= 0)
            continue;
        if (!count++ || l->tags[k].id < *first)
            *first = l->tags[k].id;
    }
    return count;
}
