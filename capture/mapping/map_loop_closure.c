#include "capture/mapping/map_internal.h"

#include "locate/relocalization.h"

#include <stdlib.h>
#include <string.h>

// Whoever walks round a room comes back with the errors of all steps, and sees old
// points beside where he believes them. Then the map holds them twice; here both
// become one, and the adjustment spreads the error over the way.

enum { LEAST_AGREEING = 20, ROUNDS = 15 };
static const double AGREE_PX = 4;
static const double BESIDE = 1.5; // so many pictures wide is searched for old points

struct desk {
    struct map_desk frame;
    int32_t *instead;           // of each point: the one that it is the same as
    bool *near;                 // of each frame: shows points that this one shows
    bool *known;                // of each point: shown by a near frame
    struct place_point *points; // old ones, beside where they are looked for
    int32_t *which;             // of each of those: its number
    int32_t count;
};

static void mark_known(const struct map *m, const struct map_frame *f, struct desk *d)
{
    memset(d->known, 0, (size_t)m->point_count * sizeof *d->known);
    for (int32_t k = 0; k < f->feature_count; k++)
        if (f->features[k].point >= 0)
            d->known[f->features[k].point] = true;
    for (int32_t i = 0; i < m->frame_count; i++) {
        d->near[i] = false;
        for (int32_t k = 0; k < m->frames[i].feature_count && !d->near[i]; k++)
            d->near[i] = m->frames[i].features[k].point >= 0 && d->known[m->frames[i].features[k].point];
    }
    for (int32_t i = 0; i < m->frame_count; i++)
        for (int32_t k = 0; k < m->frames[i].feature_count && d->near[i]; k++)
            if (m->frames[i].features[k].point >= 0)
                d->known[m->frames[i].features[k].point] = true;
}

static void choose_old(const struct map *m, const struct map_frame *f, struct desk *d)
{
    const struct lens *lens = &m->calibration.color;
    double wide = BESIDE * lens->width / lens->fx / 2, high = BESIDE * lens->height / lens->fy / 2;
    d->count = 0;
    for (int32_t i = 0; i < m->point_count; i++) {
        struct vec3 p = pose_apply(f->camera_from_world, m->points[i].world);
        if (d->known[i] || !(p.z > 0.1) || fabs(p.x) > wide * p.z || fabs(p.y) > high * p.z)
            continue;
        d->points[d->count] = m->points[i];
        d->which[d->count++] = i;
    }
}

static int32_t root(const int32_t *instead, int32_t i)
{
    while (instead[i] != i)
        i = instead[i];
    return i;
}

// What of the frame's features shows old points. How many features do.
static int unite(struct map *m, struct map_frame *f, struct desk *d)
{
    struct pose pose;
    struct map_desk *frame = &d->frame;
    const struct lens *lens = &m->calibration.color;
    int agree, united = 0;
    map_lay_out(frame, m, f);
    int count = relocate_match(d->points, d->count, &frame->index, frame->matches, MAP_FEATURES);
    if (!relocate(d->points, &frame->index, lens, frame->matches, count, NULL, &pose, &agree) || agree < LEAST_AGREEING)
        return 0;
    count = points_match(d->points, d->count, &frame->index, lens, NULL, &pose, AGREE_PX, false, frame->matches,
                         MAP_FEATURES);
    for (int k = 0; k < count; k++) {
        struct map_feature *s = &f->features[frame->matches[k].feature];
        int32_t old = d->which[frame->matches[k].point];
        if (s->point < 0) {
            s->point = old;
        } else {
            int32_t a = root(d->instead, s->point), b = root(d->instead, old);
            if (a >= m->held_points || b >= m->held_points)
                d->instead[a > b ? a : b] = a > b ? b : a; // the lower number was there first
        }
        united++;
    }
    return united;
}

static void replace(struct map *m, const int32_t *instead)
{
    for (int32_t i = 0; i < m->frame_count; i++)
        for (int32_t k = 0; k < m->frames[i].feature_count; k++)
            if (m->frames[i].features[k].point >= 0)
                m->frames[i].features[k].point = root(instead, m->frames[i].features[k].point);
}

static enum status desk_open(struct desk *d, const struct map *m)
{
    size_t points = (size_t)m->point_count + 1;
    d->instead = malloc(points * sizeof *d->instead);
    d->known = malloc(points * sizeof *d->known);
    d->points = malloc(points * sizeof *d->points);
    d->which = malloc(points * sizeof *d->which);
    d->near = malloc((size_t)m->frame_count + 1);
    return d->instead && d->known && d->points && d->which && d->near
               ? OK
               : fail(ERR_MEMORY, "no memory to close the way round a place");
}

static void desk_close(struct desk *d)
{
    free(d->instead);
    free(d->known);
    free(d->points);
    free(d->which);
    free(d->near);
    free(d);
}

enum status map_close_loops(struct map *m)
{
    // From far apart to near, so that a gap of many pixels is not taken for a wrong match.
    static const double LOOSE_PX[] = {30, 10, 3, 0};
    struct desk *d = calloc(1, sizeof *d);
    if (!d)
        return fail(ERR_MEMORY, "no memory to close the way round a place");
    enum status status = desk_open(d, m);
    int united = 0;
    for (int32_t i = 0; i < m->point_count && status == OK; i++)
        d->instead[i] = i;
    for (int32_t i = 0; i < m->frame_count && status == OK; i++) {
        if (!m->frames[i].placed)
            continue;
        mark_known(m, &m->frames[i], d);
        choose_old(m, &m->frames[i], d);
        if (d->count >= LEAST_AGREEING)
            united += unite(m, &m->frames[i], d);
    }
    if (united)
        replace(m, d->instead);
    desk_close(d);
    for (size_t i = 0; i < COUNT_OF(LOOSE_PX) && status == OK && united; i++)
        status = map_adjust_loosely(m, ROUNDS, LOOSE_PX[i]);
    return status;
}
