// Stage "skeleton" on images of rooms without a person: how many are taken for one at a film's start.
#include "capture/point_finder.h"
#include "capture/tracking/tracker.h"
#include "platform/sensors/source.h"
#include "tests/bench/bench_skeleton_trials.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum { IMAGES = 30 }; // of a folder, evenly spaced

enum { LOOKED, TAKEN, TAKEN_WITH_COLOR, COLUMNS };
static const char *const columns[COLUMNS] = {"images", "taken", "taken_with_color"};

// A new tracker on one image, as the first of a film whose room was not swept. The sensor moves between images, so no
// second image of the same view follows. points NULL: by depth alone.
static enum status is_taken(const struct calibration *calibration, const struct frame *frame,
                            const struct body_points *points, bool *taken)
{
    struct tracker *tracker;
    struct skeleton got;
    enum status status = tracker_open(&tracker, calibration, NULL);
    if (status != OK)
        return status;
    if (points)
        tracker_set_body_points(tracker, points);
    status = tracker_next(tracker, frame->time_ns, frame->depth, &got, NULL);
    *taken = status == OK;
    tracker_close(&tracker);
    return status < 0 ? status : OK;
}

// network NULL: none is there.
static enum status look_at(const struct calibration *calibration, const struct frame *frame,
                           struct pose_network *network, double count[COLUMNS])
{
    bool taken;
    enum status status = is_taken(calibration, frame, NULL, &taken);
    if (status != OK)
        return status;
    count[LOOKED]++;
    count[TAKEN] += taken;
    if (!network || !frame->color)
        return OK;
    struct body_points points;
    pose_network_restart(network);
    status = body_points_of_image(network, frame->color, calibration->color.width, calibration->color.height, &points);
    if (status >= 0)
        status = is_taken(calibration, frame, status == OK ? &points : NULL, &taken);
    count[TAKEN_WITH_COLOR] += taken;
    return status;
}

static enum status add_folder(struct bench *b, const char *folder, struct pose_network *network, double sum[COLUMNS])
{
    char uri[4096];
    struct source *source;
    struct frame frame;
    double count[COLUMNS] = {0, 0, network ? 0 : NAN};
    snprintf(uri, sizeof uri, "folder:%s", folder);
    enum status status = source_open(&source, uri, SOURCE_SENSOR);
    if (status != OK)
        return status;
    const int64_t all = source_remaining(source);
    const int64_t wanted = all < IMAGES ? all : IMAGES;
    for (int64_t i = 0, taken = 0; status == OK && (status = source_next(source, &frame)) == OK; i++) {
        if (taken >= wanted || i < taken * all / wanted || !frame.depth)
            continue;
        taken++;
        status = look_at(source_calibration(source), &frame, network, count);
    }
    source_close(&source);
    for (int k = 0; k < COLUMNS; k++)
        sum[k] += count[k];
    return status < 0 ? status : bench_add_row(b, folder, count);
}

enum status trial_empty(struct bench *b, const struct bench_folders *folders)
{
    struct pose_network *network;
    double sum[COLUMNS] = {0};
    enum status status = pose_network_open(&network, NULL, POSE_NETWORK_LITE);
    if (status == ERR_MISSING && !bench_inputs(b)->json)
        fprintf(stderr, "by depth alone: %s\n", status_message());
    if (status == ERR_MISSING)
        status = OK;
    bench_columns(b, columns, COLUMNS);
    for (int i = 0; i < folders->count && status == OK; i++)
        status = add_folder(b, folders->path[i], network, sum);
    if (status == OK)
        status = bench_add_row(b, "all", sum);
    pose_network_close(&network);
    return status;
}
