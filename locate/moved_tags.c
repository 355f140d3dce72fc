// Tags that hang elsewhere than the place has them: somebody took them down since it was mapped, or shows another one
// with the same number. The pose is told without them; here it is kept which they are, so that somebody may say so.
#include "locate/locator_internal.h"

// What vouches for a pose by which a tag is found to hang elsewhere.
enum { MIN_OTHER_TAGS = 2, MIN_POINTS = 20 };
// A tag that is less off, of its side, may be half hidden, bent or badly read.
static const double MIN_MOVED_SHARE = 0.25;

static bool has_moved(const struct locator *l, int i, const struct pose *camera_from_world)
{
    const struct place_tag *tag = &l->tags[l->which[i]];
    const struct pose expected = pose_multiply(*camera_from_world, tag->world_from_tag);
    return planar_pose_offset_m(tag->side_m, l->observations[i].ray, &expected) > MIN_MOVED_SHARE * tag->side_m;
}

void locator_vote_moved_tags(struct locator *l, const struct pnp_tag *tags, int points,
                             const struct pose *camera_from_world)
{
    int used = 0;
    for (int i = 0; i < l->count; i++)
        used += tags[i].used;
    if (used < MIN_OTHER_TAGS && points < MIN_POINTS)
        return;
    for (int i = 0; i < l->count; i++) {
        int32_t *votes = &l->moved_votes[l->which[i]];
        if (tags[i].used)
            --*votes;
        else if (has_moved(l, i, camera_from_world))
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
