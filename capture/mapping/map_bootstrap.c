// Incremental growth of the map: frames and tags are placed from one another, the unambiguous ones first, each step
// followed by bundle adjustment.
#include "capture/mapping/map_internal.h"

#include <stdlib.h>

// Wider than for a finished map, because the tags' poses are initial values. Chosen by hand.
static const double BOOTSTRAP_RMS_PX = 6, INITIAL_POSE_PX = 1;
enum { ROUNDS = 15 };
// A second planar pose is discarded when its cost (whitened squared residuals) is more than twice the first one's plus
// this. Chosen by hand.
static const double UNAMBIGUOUS_COST = 100;

// Places frames that see a mapped tag; those with two possible planar poses only where `accept_ambiguous`. Returns how
// many were placed.
static int place_frames(struct map *m, bool accept_ambiguous)
{
    const struct lens *lens = &m->calibration.color;
    int placed = 0;
    for (int32_t i = 0; i < m->frame_count; i++) {
        struct map_frame *f = &m->frames[i];
        struct pnp_tag tags[PNP_MAX_TAGS];
        struct pnp_solution fit;
        if (f->placed)
            continue;
        int count = map_tag_correspondences(m, f, tags);
        const struct pose_problem problem = {.tags = tags, .tag_count = count, .fx = lens->fx, .fy = lens->fy};
        enum status status = count ? pnp_solve(&problem, BOOTSTRAP_RMS_PX, &fit) : NOTHING;
        if (status == OK || (status == AMBIGUOUS && accept_ambiguous)) {
            f->placed = true;
            f->camera_from_world = fit.camera_from_world;
            placed++;
        }
    }
    return placed;
}

// Cost of a tag at this pose against its observations in the placed frames: whitened squared residuals.
static double tag_cost(const struct map *m, int32_t tag, const struct pose *world_from_tag)
{
    double cost = 0;
    for (int32_t i = 0; i < m->frame_count; i++) {
        const struct map_frame *f = &m->frames[i];
        for (int32_t k = 0; f->placed && k < f->seen_count; k++) {
            if (f->tag_index[k] != tag)
                continue;
            struct pnp_tag t = {.seen = &f->seen[k],
                                .depth = f->depths[k].count ? &f->depths[k] : NULL,
                                .world_from_tag = *world_from_tag,
                                .side_m = m->tags[tag].side_m,
                                .map_px = MAP_TAG_PX,
                                .used = true};
            cost += pnp_tag_cost(&t, &f->camera_from_world, INITIAL_POSE_PX, m->calibration.color.fx,
                                 m->calibration.color.fy);
        }
    }
    return cost;
}

// Initial values of a tag's pose: the one that explains all of its observations best, and the best one of another
// rotation. The planar pose problem has two solutions, which differ little for a distant tag; depth at a distance does
// not decide either.
struct tag_hypotheses {
    struct pose pose[2];
    double cost[2];
    int count;        // 0, 1 or 2
    int observations; // in placed frames
};

static const double DISTINCT_RAD = 0.15; // rotations closer than this are one solution

static void add_hypothesis(struct tag_hypotheses *g, struct pose pose, double cost)
{
    bool like_first = g->count && pose_angle(pose, g->pose[0]) < DISTINCT_RAD;
    if (!g->count || cost < g->cost[0]) {
        if (g->count && !like_first) {
            g->pose[1] = g->pose[0];
            g->cost[1] = g->cost[0];
            g->count = 2;
        }
        g->pose[0] = pose;
        g->cost[0] = cost;
        g->count = g->count ? g->count : 1;
        if (g->count == 2 && pose_angle(pose, g->pose[1]) < DISTINCT_RAD)
            g->count = 1;
    } else if (!like_first && (g->count < 2 || cost < g->cost[1])) {
        g->pose[1] = pose;
        g->cost[1] = cost;
        g->count = 2;
    }
}

static struct tag_hypotheses hypothesize_tag(const struct map *m, int32_t tag)
{
    struct tag_hypotheses g = {.count = 0};
    for (int32_t i = 0; i < m->frame_count; i++) {
        const struct map_frame *f = &m->frames[i];
        for (int32_t k = 0; f->placed && k < f->seen_count; k++) {
            struct pose two[2];
            if (f->tag_index[k] != tag)
                continue;
            int n = planar_poses(m->tags[tag].side_m, f->seen[k].ray, two);
            for (int p = 0; p < n; p++) {
                struct pose world_from_tag = pose_multiply(pose_inverse(f->camera_from_world), two[p]);
                add_hypothesis(&g, world_from_tag, tag_cost(m, tag, &world_from_tag));
            }
            g.observations += n > 0;
        }
    }
    return g;
}

// The poses that an adjustment changes, to restore them.
struct pose_backup {
    struct pose *frames, *tags;
};

static void save_poses(const struct map *m, struct pose_backup *s)
{
    for (int32_t i = 0; i < m->frame_count; i++)
        s->frames[i] = m->frames[i].camera_from_world;
    for (int32_t i = 0; i < m->tag_count; i++)
        s->tags[i] = m->tags[i].world_from_tag;
}

static void restore_poses(struct map *m, const struct pose_backup *s)
{
    for (int32_t i = 0; i < m->frame_count; i++)
        m->frames[i].camera_from_world = s->frames[i];
    for (int32_t i = 0; i < m->tag_count; i++)
        m->tags[i].world_from_tag = s->tags[i];
}

// Adds the tag to the map, at that of its two poses with which the adjusted map has the lower cost.
static enum status add_tag(struct map *m, int32_t tag, const struct tag_hypotheses *g)
{
    m->tags[tag].mapped = true;
    m->tags[tag].world_from_tag = g->pose[0];
    if (g->count < 2 || g->cost[1] > 2 * g->cost[0] + UNAMBIGUOUS_COST)
        return OK;
    size_t frames = (size_t)m->frame_count, tags = (size_t)m->tag_count;
    struct pose *scratch = malloc((frames + tags) * 2 * sizeof *scratch);
    if (!scratch)
        return fail(ERR_MEMORY, "no memory to add a tag to the map");
    struct pose_backup before = {scratch, scratch + frames},
                       first = {scratch + frames + tags, scratch + 2 * frames + tags};
    double cost[2] = {0, 0};
    save_poses(m, &before);
    enum status status = map_bundle_adjust(m, ROUNDS, m->point_count > 0, &cost[0]);
    if (status == OK) {
        save_poses(m, &first);
        restore_poses(m, &before);
        m->tags[tag].world_from_tag = g->pose[1];
        if (map_bundle_adjust(m, ROUNDS, m->point_count > 0, &cost[1]) != OK || !(cost[1] < cost[0]))
            restore_poses(m, &first);
    }
    free(scratch);
    return status;
}

// Places frames and tags alternately, as far as their poses are unambiguous. Once landmarks constrain the frames, only
// the tags are adjusted.
static enum status grow_unambiguous(struct map *m)
{
    for (;;) {
        place_frames(m, false);
        enum status status = map_bundle_adjust(m, ROUNDS, m->point_count > 0, NULL);
        struct tag_hypotheses best = {.count = 0};
        int32_t next = -1;
        for (int32_t t = 0; t < m->tag_count && status == OK; t++) {
            struct tag_hypotheses candidate =
                m->tags[t].mapped ? (struct tag_hypotheses){.count = 0} : hypothesize_tag(m, t);
            if (candidate.observations > best.observations) {
                best = candidate;
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

static enum status bootstrap_from_landmarks(struct map *m)
{
    int placed;
    enum status status = m->has_prior ? OK : map_init_from_depth(m);
    if (status == OK)
        status = map_register_frames(m, &placed);
    if (status == OK)
        status = map_bundle_adjust(m, ROUNDS, false, NULL);
    return status == OK ? map_close_loops(m) : status;
}

static enum status init_from_tag(struct map *m)
{
    int32_t reference = map_most_observed_tag(m, false);
    if (reference < 0)
        return fail(ERR_INPUT,
                    "none of the listed tags is in any picture; check that the tags are of the family tag36h11, "
                    "flat, whole and well lit, and their numbers in the list");
    m->tags[reference].mapped = m->tags[reference].fixed = true;
    m->tags[reference].world_from_tag = POSE_IDENTITY;
    return OK;
}

enum status map_bootstrap(struct map *m, bool use_points)
{
    m->fixed_frame = -1;
    if (!m->tag_count)
        return bootstrap_from_landmarks(m);
    enum status started = m->has_prior ? OK : init_from_tag(m);
    if (started != OK)
        return started;
    for (;;) {
        enum status status = grow_unambiguous(m);
        int placed = 0;
        if (status == OK && use_points)
            status = map_build_landmarks(m);
        if (status == OK && use_points)
            status = map_resolve_ambiguous_poses(m, &placed);
        if (status == OK && use_points && !placed)
            status = map_register_frames(m, &placed);
        if (status != OK)
            return status;
        // The better of two planar poses is accepted only when nothing else can be placed.
        if (!placed && !place_frames(m, true))
            return use_points ? OK : map_bundle_adjust(m, ROUNDS, false, NULL); // else map_refine_landmarks adjusts all
    }
}
