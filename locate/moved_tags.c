// Tags that are not where the place has them: moved since it was mapped, or another tag with the same number. They are
// outliers of the pose; here each image votes for which they are, so that the app can say so.
#include "locate/locator_internal.h"

// What supports a pose by which a tag is judged to be elsewhere: so many other tags, or so many landmarks. Chosen by
// hand.
enum { MIN_OTHER_TAGS = 2, MIN_POINTS = 20 };
// A smaller offset, as a share of the tag's side, may be due to occlusion, bending or noise. Chosen by hand.
static const double MIN_MOVED_SHARE = 0.25;

static bool has_moved(const struct locator *l, int i, const struct pose *camera_from_world)
{
    const struct place_tag *tag = &l->tags[l->observed_tag[i]];
    const struct pose expected = pose_multiply(*camera_from_world, tag->world_from_tag);
    return planar_pose_offset_m(tag->side_m, l->observations[i].ray, &expected) > MIN_MOVED_SHARE * tag->side_m;
}

void locator_vote_moved_tags(struct locator *l, const struct pnp_tag *tags, int points,
                             const struct pose *camera_from_world)
{
    int used = 0;
    for (int i = 0; i < l->observed_count; i++)
        used += tags[i].used;
    if (used < MIN_OTHER_TAGS && points < MIN_POINTS)
        return;
    for (int i = 0; i < l->observed_count; i++) {
        int32_t *votes = &l->moved_votes[l->observed_tag[i]];
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
