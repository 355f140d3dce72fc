#include "tests/bench/bench_smoother.h"

#include "capture/tracking/skeleton_smoother.h"

#include <stdlib.h>
#include <string.h>

static bool grow(struct settled_film *f)
{
    int room = f->room ? 2 * f->room : 64;
    size_t n = (size_t)room;
    int64_t *time_ns = realloc(f->time_ns, n * sizeof *time_ns);
    f->time_ns = time_ns ? time_ns : f->time_ns;
    uint16_t **depth = realloc(f->depth, n * sizeof *depth);
    f->depth = depth ? depth : f->depth;
    if (time_ns && depth)
        f->room = room;
    return time_ns && depth;
}

enum status settled_film_add(struct settled_film *f, int64_t time_ns, const uint16_t *depth)
{
    size_t bytes = (size_t)f->calibration.depth.width * (size_t)f->calibration.depth.height * sizeof *depth;
    if (f->count == f->room && !grow(f))
        return fail(ERR_MEMORY, "no memory for another picture");
    if (!(f->depth[f->count] = malloc(bytes)))
        return fail(ERR_MEMORY, "no memory for another picture");
    memcpy(f->depth[f->count], depth, bytes);
    f->time_ns[f->count++] = time_ns;
    return OK;
}

static enum status there_and_back(struct settled_film *f, struct tracker *tracker, struct settle *settle)
{
    enum status status = OK;
    for (int k = 0; k < f->count && status >= 0; k++) {
        status = tracker_next(tracker, f->time_ns[k], f->depth[k], &f->told[k], NULL);
        f->found[k] = status == OK;
        if (status >= 0)
            status = settle_note(settle, tracker, f->time_ns[k], f->found[k] ? &f->told[k] : NULL);
    }
    for (int k = f->count - 1; k >= 0 && status >= 0; k--)
        status = settle_look_back(settle, tracker, k, f->depth[k]);
    if (status >= 0)
        status = settle_finish(settle);
    for (int k = 0; k < f->count && status == OK; k++) {
        const struct skeleton *settled = settle_skeleton(settle, k);
        f->found[k] = settled != NULL;
        if (settled)
            f->settled[k] = *settled;
    }
    return status;
}

enum status settled_film_track(struct settled_film *f)
{
    struct tracker *tracker = NULL;
    struct settle *settle = NULL;
    size_t n = (size_t)f->count + 1;
    f->told = calloc(n, sizeof *f->told);
    f->settled = calloc(n, sizeof *f->settled);
    f->found = calloc(n, sizeof *f->found);
    enum status status = f->told && f->settled && f->found ? OK : fail(ERR_MEMORY, "no memory for the joints");
    if (status == OK)
        status = tracker_open(&tracker, &f->calibration, NULL);
    if (status == OK)
        status = settle_open(&settle, &f->calibration);
    if (status == OK)
        status = there_and_back(f, tracker, settle);
    settle_close(&settle);
    tracker_close(&tracker);
    return status;
}

void settled_film_free(struct settled_film *f)
{
    for (int k = 0; k < f->count; k++)
        free(f->depth[k]);
    free(f->depth);
    free(f->time_ns);
    free(f->told);
    free(f->settled);
    free(f->found);
    *f = (struct settled_film){0};
}
