#include "tests/support/smoothed_film.h"

#include <stdlib.h>
#include <string.h>

static bool grow(struct smoothed_film *f)
{
    int capacity = f->capacity ? 2 * f->capacity : 64;
    size_t n = (size_t)capacity;
    int64_t *time_ns = realloc(f->time_ns, n * sizeof *time_ns);
    f->time_ns = time_ns ? time_ns : f->time_ns;
    uint16_t **depth = realloc(f->depth, n * sizeof *depth);
    f->depth = depth ? depth : f->depth;
    if (time_ns && depth)
        f->capacity = capacity;
    return time_ns && depth;
}

enum status smoothed_film_add(struct smoothed_film *f, int64_t time_ns, const uint16_t *depth)
{
    size_t bytes = (size_t)f->calibration.depth.width * (size_t)f->calibration.depth.height * sizeof *depth;
    if (f->count == f->capacity && !grow(f))
        return fail(ERR_MEMORY, "no memory for another image");
    if (!(f->depth[f->count] = malloc(bytes)))
        return fail(ERR_MEMORY, "no memory for another image");
    memcpy(f->depth[f->count], depth, bytes);
    f->time_ns[f->count++] = time_ns;
    return OK;
}

static void keep_online_evidence(struct film_evidence *e, const struct tracker *t)
{
    e->found = tracker_found_joints(t);
    memcpy(e->pass[0], tracker_joint_features(t), sizeof e->pass[0]);
    for (int j = 0; j < JOINT_COUNT; j++)
        e->online_widening[j] = (float)tracker_uncertainty_terms(t)[j].scale;
}

static enum status forward_backward(struct smoothed_film *f, struct tracker *tracker, struct smoother *smoother)
{
    enum status status = OK;
    if (f->background)
        tracker_set_background(tracker, f->background);
    if (f->floor)
        tracker_set_floor(tracker, f->floor->up, f->floor->height_m);
    for (int k = 0; k < f->count && status >= 0; k++) {
        if (f->looked && f->looked[k])
            tracker_set_body_points(tracker, &f->points[k]);
        status = tracker_next(tracker, f->time_ns[k], f->depth[k], &f->online[k], NULL);
        f->found[k] = status == OK;
        if (f->found[k] && f->evidence)
            keep_online_evidence(&f->evidence[k], tracker);
        if (status >= 0)
            status = smoother_push(smoother, tracker, f->time_ns[k], f->found[k] ? &f->online[k] : NULL);
    }
    for (int k = f->count - 1; k >= 0 && status >= 0; k--) {
        status = smoother_backward(smoother, tracker, k, f->depth[k]);
        if (f->found[k] && f->evidence)
            memcpy(f->evidence[k].pass[1], tracker_joint_features(tracker), sizeof f->evidence[k].pass[1]);
    }
    if (status >= 0)
        status = smoother_solve(smoother);
    for (int k = 0; k < f->count && status == OK; k++) {
        const struct skeleton *smoothed = smoother_skeleton(smoother, k);
        f->found[k] = smoothed != NULL;
        if (smoothed)
            f->smoothed[k] = *smoothed;
        if (smoothed && f->evidence)
            smoother_joint_features(smoother, k, f->evidence[k].smoothed, f->evidence[k].smoothed_widening);
    }
    return status;
}

enum status smoothed_film_track(struct smoothed_film *f)
{
    struct tracker *tracker = NULL;
    struct smoother *smoother = NULL;
    size_t n = (size_t)f->count + 1;
    free(f->online);
    free(f->smoothed);
    free(f->found);
    free(f->evidence);
    f->online = calloc(n, sizeof *f->online);
    f->smoothed = calloc(n, sizeof *f->smoothed);
    f->found = calloc(n, sizeof *f->found);
    f->evidence = f->with_evidence ? calloc(n, sizeof *f->evidence) : NULL;
    const bool enough = f->online && f->smoothed && f->found && (f->evidence || !f->with_evidence);
    enum status status = enough ? OK : fail(ERR_MEMORY, "no memory for the joints");
    if (status == OK)
        status = tracker_open(&tracker, &f->calibration, NULL);
    if (status == OK)
        status = smoother_open(&smoother, &f->calibration);
    if (status == OK)
        status = forward_backward(f, tracker, smoother);
    smoother_close(&smoother);
    tracker_close(&tracker);
    return status;
}

void smoothed_film_free(struct smoothed_film *f)
{
    for (int k = 0; k < f->count; k++)
        free(f->depth[k]);
    free(f->depth);
    free(f->time_ns);
    free(f->online);
    free(f->smoothed);
    free(f->found);
    free(f->evidence);
    *f = (struct smoothed_film){0};
}
