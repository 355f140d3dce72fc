#include "capture/mapping/map_internal.h"

#include <stdlib.h>

static const double UNFINISHED_PX = 0.1; // how well a growing map has a tag's corners

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
                .map_px = UNFINISHED_PX,
                .used = true,
            };
    }
    return count;
}

// Wider than for a finished map: the tags' poses are first ideas.
static const double GROWING_RMS_PX = 6, GUESS_PX = 1;
enum { ROUNDS = 15 };
static const double CLEAR_COST = 100; // by which one of two poses must be worse to be out of the question

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
        enum status status = count ? fit_camera(tags, count, lens->fx, lens->fy, GROWING_RMS_PX, NULL, &fit) : NOTHING;
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
            struct fit_tag t = {.seen = &f->seen[k],
                                .depth = f->depths[k].count ? &f->depths[k] : NULL,
                                .world_from_tag = *world_from_tag,
                                .side_m = m->tags[tag].side_m,
                                .map_px = UNFINISHED_PX,
                                .used = true};
            cost += fit_tag_cost(&t, &f->camera_from_world, GUESS_PX, m->calibration.color.fx, m->calibration.color.fy);
        }
    }
    return cost;
}

// First ideas of a tag's pose: the one that explains all of its sightings best,
// and the best one that is turned against it. A flat square far off looks nearly
// the same mirrored, and depth at a distance does not tell either.
struct guess {
    struct pose pose[2];
    double cost[2];
    int count;     // 0, 1 or 2
    int sightings; // in placed frames
};

static const double TURNED_RAD = 0.15;

static void consider(struct guess *g, struct pose pose, double cost)
{
    bool like_first = g->count && pose_angle(pose, g->pose[0]) < TURNED_RAD;
    if (!g->count || cost < g->cost[0]) {
        if (g->count && !like_first) {
            g->pose[1] = g->pose[0];
            g->cost[1] = g->cost[0];
            g->count = 2;
        }
        g->pose[0] = pose;
        g->cost[0] = cost;
        g->count = g->count ? g->count : 1;
        if (g->count == 2 && pose_angle(pose, g->pose[1]) < TURNED_RAD)
            g->count = 1;
    } else if (!like_first && (g->count < 2 || cost < g->cost[1])) {
        g->pose[1] = pose;
        g->cost[1] = cost;
        g->count = 2;
    }
}

static struct guess guess_tag(const struct map *m, int32_t tag)
{
    struct guess g = {.count = 0};
    for (int32_t i = 0; i < m->frame_count; i++) {
        const struct map_frame *f = &m->frames[i];
        for (int32_t k = 0; f->placed && k < f->seen_count; k++) {
            struct pose two[2];
            if (f->which[k] != tag)
                continue;
            int n = square_poses(m->tags[tag].side_m, f->seen[k].ray, two);
            for (int p = 0; p < n; p++) {
                struct pose world_from_tag = pose_multiply(pose_inverse(f->camera_from_world), two[p]);
                consider(&g, world_from_tag, cost_of(m, tag, &world_from_tag));
            }
            g.sightings += n > 0;
        }
    }
    return g;
}

// What an adjustment changes, to go back to.
struct state {
    struct pose *frames, *tags;
};

static void save(const struct map *m, struct state *s)
{
    for (int32_t i = 0; i < m->frame_count; i++)
        s->frames[i] = m->frames[i].camera_from_world;
    for (int32_t i = 0; i < m->tag_count; i++)
        s->tags[i] = m->tags[i].world_from_tag;
}

static void restore(struct map *m, const struct state *s)
{
    for (int32_t i = 0; i < m->frame_count; i++)
        m->frames[i].camera_from_world = s->frames[i];
    for (int32_t i = 0; i < m->tag_count; i++)
        m->tags[i].world_from_tag = s->tags[i];
}

// Puts the tag into the map, in that of its two poses with which everything
// together fits better.
static enum status add_tag(struct map *m, int32_t tag, const struct guess *g)
{
    m->tags[tag].mapped = true;
    m->tags[tag].world_from_tag = g->pose[0];
    if (g->count < 2 || g->cost[1] > 2 * g->cost[0] + CLEAR_COST)
        return OK;
    size_t frames = (size_t)m->frame_count, tags = (size_t)m->tag_count;
    struct pose *room = malloc((frames + tags) * 2 * sizeof *room);
    if (!room)
        return fail(ERR_MEMORY, "no memory to add a tag to the map");
    struct state before = {room, room + frames}, first = {room + frames + tags, room + 2 * frames + tags};
    double cost[2] = {0, 0};
    save(m, &before);
    enum status status = map_adjust(m, ROUNDS, m->point_count > 0, &cost[0]);
    if (status == OK) {
        save(m, &first);
        restore(m, &before);
        m->tags[tag].world_from_tag = g->pose[1];
        if (map_adjust(m, ROUNDS, m->point_count > 0, &cost[1]) != OK || !(cost[1] < cost[0]))
            restore(m, &first);
    }
    free(room);
    return status;
}

int32_t map_most_seen(const struct map *m, bool mapped)
{
    int32_t best = -1, most = 0;
    for (int32_t t = 0; t < m->tag_count; t++) {
        int32_t count = 0;
        if (mapped && !m->tags[t].mapped)
            continue;
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

// Frames and tags in turn, as far as poses are beyond doubt. Once points hold the
// frames, tags are fitted to them.
static enum status grow_sure(struct map *m)
{
    for (;;) {
        place_frames(m, false);
        enum status status = map_adjust(m, ROUNDS, m->point_count > 0, NULL);
        struct guess best = {.count = 0};
        int32_t next = -1;
        for (int32_t t = 0; t < m->tag_count && status == OK; t++) {
            struct guess guess = m->tags[t].mapped ? (struct guess){.count = 0} : guess_tag(m, t);
            if (guess.sightings > best.sightings) {
                best = guess;
                next = t;
            }
        }
        if (status != OK || next < 0)
            return status;
        status = add_tag(m, next, &best);
        if (status != OK)
            return status;
    }
}

static enum status grow_by_points(struct map *m)
{
    int placed;
    enum status status = m->extends ? OK : map_start_by_points(m);
    if (status == OK)
        status = map_follow(m, &placed);
    if (status == OK)
        status = map_adjust(m, ROUNDS, false, NULL);
    return status == OK ? map_close_loops(m) : status;
}

static enum status start_by_tag(struct map *m)
{
    int32_t reference = map_most_seen(m, false);
    if (reference < 0)
        return fail(ERR_INPUT,
                    "none of the listed tags is in any picture; check that the tags are of the family tag36h11, "
                    "flat, whole and well lit, and their numbers in the list");
    m->tags[reference].mapped = m->tags[reference].held = true;
    m->tags[reference].world_from_tag = POSE_IDENTITY;
    return OK;
}

enum status map_grow(struct map *m, bool use_points)
{
    m->held_frame = -1;
    if (!m->tag_count)
        return grow_by_points(m);
    enum status started = m->extends ? OK : start_by_tag(m);
    if (started != OK)
        return started;
    for (;;) {
        enum status status = grow_sure(m);
        int placed = 0;
        if (status == OK && use_points)
            status = map_add_points(m);
        if (status == OK && use_points)
            status = map_place_by_points(m, &placed);
        if (status == OK && use_points && !placed)
            status = map_follow(m, &placed);
        if (status != OK)
            return status;
        // The better of two mirrored poses is taken only when there is no other way on.
        if (!placed && !place_frames(m, true))
            return use_points ? OK : map_adjust(m, ROUNDS, false, NULL); // points are polished, and all with them
    }
}
