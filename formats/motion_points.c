#include "formats/motion_points.h"

#include <stdlib.h>

void motion_points_free(struct motion_points *points)
{
    free(points->names);
    free(points->time_s);
    free(points->at);
    *points = (struct motion_points){.format = NULL};
}

enum status motion_points_make_room(struct motion_points *points, const char *name, int count, int64_t frames)
{
    if (count < 1 || frames < 1)
        return fail(ERR_INPUT, "%s is an empty %s file: %d points in %lld frames", name, points->format, count,
                    (long long)frames);
    if (count > MOTION_POINTS_MAX)
        return fail(ERR_INPUT, "%s has %d points; at most %d can be read", name, count, MOTION_POINTS_MAX);
    if (frames > (1 << 25) / count)
        return fail(ERR_INPUT, "%s is too long: %lld frames of %d points; cut it into pieces", name, (long long)frames,
                    count);
    points->points = count;
    points->frames = frames;
    points->names = calloc((size_t)count, sizeof *points->names);
    points->time_s = malloc((size_t)frames * sizeof *points->time_s);
    points->at = malloc((size_t)frames * (size_t)count * 3 * sizeof *points->at);
    return points->names && points->time_s && points->at ? OK
                                                         : fail(ERR_MEMORY, "no memory for the motion of %s", name);
}
