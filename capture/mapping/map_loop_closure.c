// Loop closure. A sweep that comes back to its beginning has accumulated drift and maps old landmarks a second time,
// displaced. Here each frame is relocalised among the landmarks it should see but that are not connected to it; the
// duplicates become one landmark, and bundle adjustment distributes the drift over the loop.
#include "capture/mapping/map_internal.h"

#include "locate/relocalization.h"

#include <stdlib.h>
#include <string.h>

// Chosen by hand.
enum { MIN_INLIERS = 20, ROUNDS = 15 };
static const double INLIER_PX = 4;
static const double SEARCH_WIDTH = 1.5; // of the field searched for old landmarks, in image widths and heights

struct loop_scratch {
    struct map_scratch frame;
    int32_t *merged_into;          // of each landmark: the one that it duplicates (union-find)
    bool *covisible;               // of each frame: shares a landmark with the present one
    bool *known;                   // of each landmark: shown by a covisible frame
    struct place_landmark *points; // the old landmarks searched for
    int32_t *point_index;          // of each of those: index into map.points
    int32_t count;
};

static void mark_covisible(const struct map *m, const struct map_frame *f, struct loop_scratch *d)
{
    memset(d->known, 0, (size_t)m->point_count * sizeof *d->known);
    for (int32_t k = 0; k < f->feature_count; k++)
        if (f->features[k].point >= 0)
            d->known[f->features[k].point] = true;
    for (int32_t i = 0; i < m->frame_count; i++) {
        d->covisible[i] = false;
        for (int32_t k = 0; k < m->frames[i].feature_count && !d->covisible[i]; k++)
            d->covisible[i] = m->frames[i].features[k].point >= 0 && d->known[m->frames[i].features[k].point];
    }
    for (int32_t i = 0; i < m->frame_count; i++)
        for (int32_t k = 0; k < m->frames[i].feature_count && d->covisible[i]; k++)
            if (m->frames[i].features[k].point >= 0)
                d->known[m->frames[i].features[k].point] = true;
}

static void select_old_points(const struct map *m, const struct map_frame *f, struct loop_scratch *d)
{
    const struct lens *lens = &m->calibration.color;
    double wide = SEARCH_WIDTH * lens->width / lens->fx / 2, high = SEARCH_WIDTH * lens->height / lens->fy / 2;
    d->count = 0;
    for (int32_t i = 0; i < m->point_count; i++) {
        struct vec3 p = pose_apply(f->camera_from_world, m->points[i].world);
        if (d->known[i] || !(p.z > 0.1) || fabs(p.x) > wide * p.z || fabs(p.y) > high * p.z)
            continue;
        d->points[d->count] = m->points[i];
        d->point_index[d->count++] = i;
    }
}

static int32_t root(const int32_t *merged_into, int32_t i)
{
    while (merged_into[i] != i)
        i = merged_into[i];
    return i;
}

// Matches the frame's features with old landmarks. Returns how many match.
static int match_old_points(struct map *m, struct map_frame *f, struct loop_scratch *d)
{
    struct pose pose;
    struct map_scratch *frame = &d->frame;
    const struct lens *lens = &m->calibration.color;
    int agree, matched = 0;
    map_index_features(frame, m, f);
    const struct match_query query = {
        .points = d->points, .point_count = d->count, .index = &frame->index, .lens = lens};
    int count = relocalize_match(&query, frame->matches, MAP_MAX_FEATURES);
    if (!relocalize(&query, frame->matches, count, NULL, &pose, &agree) || agree < MIN_INLIERS)
        return 0;
    count =
        landmarks_match(&query, (struct match_window){INLIER_PX, false}, NULL, &pose, frame->matches, MAP_MAX_FEATURES);
    for (int k = 0; k < count; k++) {
        struct map_feature *s = &f->features[frame->matches[k].feature];
        int32_t old = d->point_index[frame->matches[k].point];
        if (s->point < 0) {
            s->point = old;
        } else {
            int32_t a = root(d->merged_into, s->point), b = root(d->merged_into, old);
            if (a >= m->held_points || b >= m->held_points)
                d->merged_into[a > b ? a : b] = a > b ? b : a; // the lower index is the older one
        }
        matched++;
    }
    return matched;
}

static void apply_merges(struct map *m, const int32_t *merged_into)
{
    for (int32_t i = 0; i < m->frame_count; i++)
        for (int32_t k = 0; k < m->frames[i].feature_count; k++)
            if (m->frames[i].features[k].point >= 0)
                m->frames[i].features[k].point = root(merged_into, m->frames[i].features[k].point);
}

static enum status loop_scratch_alloc(struct loop_scratch *d, const struct map *m)
{
    size_t points = (size_t)m->point_count + 1;
    d->merged_into = malloc(points * sizeof *d->merged_into);
    d->known = malloc(points * sizeof *d->known);
    d->points = malloc(points * sizeof *d->points);
    d->point_index = malloc(points * sizeof *d->point_index);
    d->covisible = malloc((size_t)m->frame_count + 1);
    return d->merged_into && d->known && d->points && d->point_index && d->covisible
               ? OK
               : fail(ERR_MEMORY, "no memory to close the loops of a sweep");
}

static void loop_scratch_free(struct loop_scratch *d)
{
    free(d->merged_into);
    free(d->known);
    free(d->points);
    free(d->point_index);
    free(d->covisible);
    free(d);
}

enum status map_close_loops(struct map *m)
{
    // From loose to tight, so that a gap of many pixels is not taken for an outlier. Chosen by hand.
    static const double EXTRA_SIGMA_PX[] = {30, 10, 3, 0};
    struct loop_scratch *d = calloc(1, sizeof *d);
    if (!d)
        return fail(ERR_MEMORY, "no memory to close the loops of a sweep");
    enum status status = loop_scratch_alloc(d, m);
    int matched = 0;
    for (int32_t i = 0; i < m->point_count && status == OK; i++)
        d->merged_into[i] = i;
    for (int32_t i = 0; i < m->frame_count && status == OK; i++) {
        if (!m->frames[i].placed)
            continue;
        mark_covisible(m, &m->frames[i], d);
        select_old_points(m, &m->frames[i], d);
        if (d->count >= MIN_INLIERS)
            matched += match_old_points(m, &m->frames[i], d);
    }
    if (matched)
        apply_merges(m, d->merged_into);
    loop_scratch_free(d);
    for (size_t i = 0; i < COUNT_OF(EXTRA_SIGMA_PX) && status == OK && matched; i++)
        status = map_bundle_adjust_relaxed(m, ROUNDS, EXTRA_SIGMA_PX[i]);
    return status;
}
