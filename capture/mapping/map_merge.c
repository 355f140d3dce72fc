// Adding a sweep to an existing place. Takes and other sweeps were located by its tags and landmarks, so these keep
// their indices and positions, bit for bit. What is new is adjusted to them, with all observations of this sweep. Only
// a tag that was hung elsewhere is estimated again.
#include "capture/mapping/map_internal.h"

#include "locate/relocalization.h"

#include <stdlib.h>
#include <string.h>

static const double SAME_SIDE_M = 1e-4; // one measurement, written down twice

static enum status add_tag(struct map *m, int32_t id, double side_m)
{
    for (int32_t i = 0; i < m->tag_count; i++)
        if (m->tags[i].id == id)
            return fabs(m->tags[i].side_m - side_m) <= SAME_SIDE_M
                       ? OK
                       : fail(ERR_INPUT,
                              "tag %d is %g m wide in the place, but %g m in the list of tags; correct the list",
                              (int)id, m->tags[i].side_m, side_m);
    struct map_tag *tag = &m->tags[m->tag_count++];
    tag->id = id;
    tag->side_m = side_m;
    return tag_pattern(id, &tag->pattern)
               ? OK
               : fail(ERR_INPUT, "tag %d is not of the family tag36h11, which ends at %d", (int)id, TAG_ID_COUNT - 1);
}

enum status map_load_prior(struct map *m, const struct place *prior, const struct mapper_tag *tags, int32_t tag_count)
{
    int32_t old_tags = prior ? prior->tag_count : 0, old_points = prior ? prior->point_count : 0;
    m->has_prior = prior != NULL;
    m->point_capacity = old_points + MAP_MAX_CANDIDATES;
    m->tags = calloc((size_t)(old_tags + tag_count) + 1, sizeof *m->tags);
    m->points = malloc((size_t)m->point_capacity * sizeof *m->points);
    m->point_observations = calloc((size_t)m->point_capacity, sizeof *m->point_observations);
    if (!m->tags || !m->points || !m->point_observations)
        return fail(ERR_MEMORY, "no memory to map a place");
    enum status status = OK;
    for (int32_t i = 0; i < old_tags && status == OK; i++) {
        status = add_tag(m, prior->tags[i].id, prior->tags[i].side_m);
        if (status == OK && m->tag_count == i)
            status = fail(ERR_INPUT, "the place has tag %d twice", (int)prior->tags[i].id);
        m->tags[i].world_from_tag = prior->tags[i].world_from_tag;
        memcpy(m->tags[i].covariance, prior->tags[i].covariance, sizeof m->tags[i].covariance);
        m->tags[i].mapped = m->tags[i].fixed = true;
    }
    for (int32_t i = 0; i < tag_count && status == OK; i++)
        status = add_tag(m, tags[i].id, tags[i].side_m);
    if (old_points)
        memcpy(m->points, prior->points, (size_t)old_points * sizeof *m->points);
    m->point_count = m->held_points = old_points;
    return status;
}

// Chosen by hand.
static const double INLIER_RMS_PX = 6; // observations of a tag that was not moved fit better
enum { MIN_TAGS = 2 };                 // that agree: of two that disagree it is unknown which was moved
enum { MIN_POINTS = 20 };              // landmark inliers

// The pose of a frame by more than a single tag: by the place's landmarks, else by tags that agree.
static bool register_by_consensus(const struct map *m, struct map_scratch *d, const struct map_frame *f,
                                  struct pnp_tag *tags, int tag_count, struct pose *camera_from_world)
{
    const struct lens *lens = &m->calibration.color;
    struct pnp_solution fit;
    int agree;
    map_index_features(d, m, f);
    const struct match_query query = {
        .points = m->points, .point_count = m->held_points, .index = &d->index, .lens = lens};
    const struct pose_problem problem = {.tags = tags, .tag_count = tag_count, .fx = lens->fx, .fy = lens->fy};
    int count = relocalize_match(&query, d->matches, MAP_MAX_FEATURES);
    if (relocalize(&query, d->matches, count, NULL, camera_from_world, &agree) && agree >= MIN_POINTS)
        return true;
    if (pnp_solve(&problem, INLIER_RMS_PX, &fit) != OK || fit.used < MIN_TAGS)
        return false;
    *camera_from_world = fit.camera_from_world;
    return true;
}

enum status map_release_moved_tags(struct map *m)
{
    int votes[MAPPER_MAX_TAGS] = {0}; // frames in which the tag is where it was, less those where it is not
    const struct lens *lens = &m->calibration.color;
    struct map_scratch *d = malloc(sizeof *d);
    if (!d)
        return fail(ERR_MEMORY, "no memory to look for tags that were moved");
    for (int32_t i = 0; i < m->frame_count; i++) {
        const struct map_frame *f = &m->frames[i];
        struct pnp_tag tags[PNP_MAX_TAGS];
        struct pose pose;
        int count = map_tag_correspondences(m, f, tags), at = 0;
        if (!count || !register_by_consensus(m, d, f, tags, count, &pose))
            continue;
        for (int32_t k = 0; k < f->seen_count && at < count; k++) // in the order of map_tag_correspondences
            if (m->tags[f->tag_index[k]].mapped)
                votes[m->tags[f->tag_index[k]].id] +=
                    pnp_tag_rms(&tags[at++], NULL, &pose, lens->fx, lens->fy) < INLIER_RMS_PX ? 1 : -1;
    }
    free(d);
    for (int32_t t = 0; t < m->tag_count; t++)
        if (m->tags[t].fixed && votes[m->tags[t].id] < 0) {
            m->tags[t].moved = true;
            m->tags[t].fixed = m->tags[t].mapped = false;
        }
    return OK;
}

enum status map_check_overlap(const struct map *m)
{
    for (int32_t i = 0; i < m->frame_count; i++)
        if (m->frames[i].placed)
            return OK;
    return fail(ERR_INPUT, "the sweep shows nothing that is in the place already, so it cannot be registered to it; "
                           "begin it where the place is known, with its tags or much of what was filmed in sight");
}

// Rms of two sets of errors together.
static double rms_of_both(double a, double count_a, double b, double count_b)
{
    double count = count_a + count_b;
    return count > 0 ? sqrt((a * a * count_a + b * b * count_b) / count) : 0;
}

void map_merge_residuals(struct map *m, const struct place *prior)
{
    double earlier = 0, now = 0;
    bool any_tag = false;
    for (int32_t i = 0; i < m->tag_count; i++) {
        now += m->tags[i].observations;
        any_tag = any_tag || m->tags[i].mapped;
    }
    for (int32_t i = 0; i < prior->tag_count; i++) {
        const struct place_tag *old = &prior->tags[i];
        struct map_tag *tag = &m->tags[i]; // those of the place come first
        if (tag->moved)
            continue;
        tag->rms_px = rms_of_both(old->rms_px, old->observations, tag->rms_px, tag->observations);
        tag->observations += old->observations;
        earlier += old->observations;
    }
    if (!any_tag) { // then the errors are those of landmarks
        earlier = prior->point_count;
        now = m->tag_count ? 0 : m->point_count - m->held_points;
    }
    m->rms_px = rms_of_both(prior->rms_px, earlier, m->rms_px, now);
    m->rms_m = rms_of_both(prior->rms_m, prior->rms_m > 0 ? earlier : 0, m->rms_m, m->rms_m > 0 ? now : 0);
}

static void *duplicate_bytes(const void *bytes, size_t size)
{
    void *copy = malloc(size);
    if (copy)
        memcpy(copy, bytes, size);
    return copy;
}

enum status map_copy_prior_views(const struct place *prior, struct place *out)
{
    const struct lens *lens = &prior->calibration.depth;
    size_t depth_bytes = (size_t)lens->width * (size_t)lens->height * sizeof(uint16_t);
    for (int32_t i = 0; i < prior->view_count; i++) {
        const struct place_view *old = &prior->views[i];
        struct place_view *view = &out->views[out->view_count++];
        *view = *old;
        view->jpeg = old->jpeg ? duplicate_bytes(old->jpeg, old->jpeg_bytes) : NULL;
        view->depth = old->depth ? duplicate_bytes(old->depth, depth_bytes) : NULL;
        if ((old->jpeg && !view->jpeg) || (old->depth && !view->depth))
            return fail(ERR_MEMORY, "no memory for the pictures of the place");
    }
    return OK;
}
