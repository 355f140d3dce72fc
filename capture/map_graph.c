#include "capture/map_internal.h"

int map_fit_tags(const struct map *m, const struct map_frame *f, struct fit_tag *out)
{
    int count = 0;
    for (int32_t i = 0; i < f->seen_count && count < FIT_MAX_TAGS; i++) {
        const struct map_tag *tag = &m->tags[f->which[i]];
        if (tag->mapped)
            out[count++] = (struct fit_tag){
                .seen = &f->seen[i],
                .depth = f->depths[i].count ? &f->depths[i] : NULL,
                .world_from_tag = tag->world_from_tag,
                .side_m = tag->side_m,
                .used = true,
            };
    }
    return count;
}

// Wider than for a finished map: the tags' poses are first ideas.
static const double GROWING_RMS_PX = 6;

// Places frames that see a mapped tag. Of poses that may be mirrored only where
// `bold`. How many were placed.
static int place_frames(struct map *m, bool bold)
{
    const struct lens *lens = &m->calibration.color;
    int placed = 0;
    for (int32_t i = 0; i < m->frame_count; i++) {
        struct map_frame *f = &m->frames[i];
        struct fit_tag tags[FIT_MAX_TAGS];
        struct camera_fit fit;
        if (f->placed)
            continue;
        int count = map_fit_tags(m, f, tags);
        enum status status = count ? fit_camera(tags, count, lens->fx, lens->fy, GROWING_RMS_PX, &fit) : NOTHING;
        if (status == OK || (status == AMBIGUOUS && bold)) {
            f->placed = true;
            f->camera_from_world = fit.camera_from_world;
            placed++;
        }
    }
    return placed;
}

// How badly a tag at this place fits what the placed frames saw of it.
static double cost_of(const struct map *m, int32_t tag, const struct pose *world_from_tag)
{
    double cost = 0;
    for (int32_t i = 0; i < m->frame_count; i++) {
        const struct map_frame *f = &m->frames[i];
        for (int32_t k = 0; f->placed && k < f->seen_count; k++) {
            if (f->which[k] != tag)
                continue;
            struct fit_tag t = {&f->seen[k], f->depths[k].count ? &f->depths[k] : NULL, *world_from_tag,
                                m->tags[tag].side_m, true, 0};
            cost += fit_tag_cost(&t, &f->camera_from_world, 2, m->calibration.color.fx, m->calibration.color.fy);
        }
    }
    return cost;
}

// The tag's pose from whichever sighting explains all of its sightings best. How
// many placed frames saw it; 0: none.
static int guess_tag(const struct map *m, int32_t tag, struct pose *best)
{
    int sightings = 0;
    double least = 0;
    for (int32_t i = 0; i < m->frame_count; i++) {
        const struct map_frame *f = &m->frames[i];
        for (int32_t k = 0; f->placed && k < f->seen_count; k++) {
            struct pose two[2];
            if (f->which[k] != tag)
                continue;
            int n = square_poses(m->tags[tag].side_m, f->seen[k].ray, two);
            for (int p = 0; p < n; p++) {
                struct pose world_from_tag = pose_multiply(pose_inverse(f->camera_from_world), two[p]);
                double cost = cost_of(m, tag, &world_from_tag);
                if (!sightings || cost < least) {
                    least = cost;
                    *best = world_from_tag;
                }
                sightings += p == 0;
            }
        }
    }
    return sightings;
}

// Which tag holds the world still: the one seen most often.
static int32_t most_seen(const struct map *m)
{
    int32_t best = -1, most = 0;
    for (int32_t t = 0; t < m->tag_count; t++) {
        int32_t count = 0;
        for (int32_t i = 0; i < m->frame_count; i++)
            for (int32_t k = 0; k < m->frames[i].seen_count; k++)
                count += m->frames[i].which[k] == t;
        if (count > most) {
            most = count;
            best = t;
        }
    }
    return best;
}

enum status map_grow(struct map *m)
{
    m->reference = most_seen(m);
    if (m->reference < 0)
        return fail(ERR_INPUT, "none of the listed tags is in any picture; check that the tags are of the family tag36h11, "
                               "flat, whole and well lit, and their numbers in the list");
    m->tags[m->reference].mapped = true;
    m->tags[m->reference].world_from_tag = POSE_IDENTITY;
    for (;;) {
        if (!place_frames(m, false))
            place_frames(m, true);
        struct pose best_pose = POSE_IDENTITY;
        int32_t best = -1;
        int most = 0;
        for (int32_t t = 0; t < m->tag_count; t++) {
            struct pose guess = POSE_IDENTITY;
            int sightings = m->tags[t].mapped ? 0 : guess_tag(m, t, &guess);
            if (sightings > most) {
                most = sightings;
                best = t;
                best_pose = guess;
            }
        }
        if (best >= 0) {
            m->tags[best].mapped = true;
            m->tags[best].world_from_tag = best_pose;
        }
        enum status status = map_adjust(m, 15);
        if (status != OK || best < 0)
            return status;
    }
}
