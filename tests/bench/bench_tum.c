// Stage "tum": a sequence of a moving colour and depth camera with its poses by motion capture, as the TUM RGB-D
// benchmark has them (Sturm 2012): mapped without tags and located in that map, the whole sequence, and the second half
// in a map of the first. The error is that benchmark's absolute trajectory error: what is left of the positions after
// one rigid motion. The time is next to libapriltag's on the same images.
//
// --data FOLDER: rgb.txt, depth.txt, calibration.json (docs/guide.md), and groundtruth.txt or truth/trajectory.txt.
#include "capture/mapping/mapper.h"
#include "locate/camera_tracker.h"
#include "locate/tag_corners.h"
#include "platform/sensors/source.h"
#include "tests/bench/bench.h"
#include "tests/bench/bench_tags_peers.h"
#include "tests/support/align.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

static const double TRUTH_GAP_S = 0.1; // motion capture lost the camera

// ---------------------------------------------------------------- truth

struct truth {
    double *time_s;
    struct vec3 *at; // of the camera
    int count;
};

static enum status open_truth(const char *data, FILE **out)
{
    static const char *const names[] = {"groundtruth.txt", "truth/trajectory.txt"};
    char path[4096];
    *out = NULL;
    for (size_t i = 0; i < COUNT_OF(names) && !*out; i++) {
        snprintf(path, sizeof path, "%s/%s", data, names[i]);
        *out = fopen(path, "r");
    }
    return *out ? OK
                : fail(ERR_MISSING, "%s has neither groundtruth.txt nor truth/trajectory.txt to measure against", data);
}

static enum status add_truth(struct truth *truth, double time_s, struct vec3 at)
{
    if (!(truth->count & (truth->count - 1))) { // doubled when it is a power of two
        const size_t room = truth->count ? 2 * (size_t)truth->count : 1;
        double *times = realloc(truth->time_s, room * sizeof *times);
        truth->time_s = times ? times : truth->time_s;
        struct vec3 *positions = times ? realloc(truth->at, room * sizeof *positions) : NULL;
        if (!positions)
            return fail(ERR_MEMORY, "no memory for the true path");
        truth->at = positions;
    }
    truth->time_s[truth->count] = time_s;
    truth->at[truth->count++] = at;
    return OK;
}

static enum status read_truth(const char *data, struct truth *out)
{
    char line[512];
    FILE *file;
    enum status status = open_truth(data, &file);
    while (status == OK && fgets(line, sizeof line, file)) {
        double time_s;
        struct vec3 at;
        if (sscanf(line, "%lf %lf %lf %lf", &time_s, &at.x, &at.y, &at.z) == 4)
            status = add_truth(out, time_s, at);
    }
    if (file)
        fclose(file);
    return status;
}

static void free_truth(struct truth *truth)
{
    free(truth->time_s);
    free(truth->at);
}

// Between two samples; false where motion capture has none.
static bool truth_at(const struct truth *truth, double time_s, struct vec3 *out)
{
    int low = 0, high = truth->count;
    while (low < high) {
        const int middle = (low + high) / 2;
        if (truth->time_s[middle] < time_s)
            low = middle + 1;
        else
            high = middle;
    }
    if (!low || low == truth->count || truth->time_s[low] - truth->time_s[low - 1] > TRUTH_GAP_S)
        return false;
    const double step_s = truth->time_s[low] - truth->time_s[low - 1],
                 share = step_s > 0 ? (time_s - truth->time_s[low - 1]) / step_s : 0;
    *out = v3_mix(truth->at[low - 1], truth->at[low], share);
    return true;
}

// ---------------------------------------------------------------- mapping and locating

enum { NUMBERS = 9 };
static const char *const columns[NUMBERS] = {"images", "located_%", "ate_mm",      "median_mm", "worst_mm",
                                             "map_ms", "locate_ms", "apriltag_ms", "readout_ms"};

struct sequence {
    char uri[4096];
    struct truth truth;
    int images;
};

// Frames are counted from 0; those from `first` to before `end` are used.
struct stretch {
    int first, end;
};

static enum status count_images(struct sequence *sequence)
{
    struct source *source;
    struct frame frame;
    enum status status = source_open(&source, sequence->uri, SOURCE_SENSOR);
    while (status == OK && (status = source_next(source, &frame)) == OK)
        sequence->images++;
    source_close(&source);
    return status == NOTHING ? OK : status;
}

static enum status map(const struct sequence *sequence, struct stretch of, struct place *out, double numbers[NUMBERS])
{
    struct source *source;
    struct mapper *mapper = NULL;
    struct mapper_report report;
    struct frame frame;
    enum status status = source_open(&source, sequence->uri, SOURCE_SENSOR);
    const double begun_ms = bench_all_threads_ms();
    if (status == OK)
        status = mapper_open(&mapper, source_calibration(source), NULL, 0, NULL);
    for (int i = 0; status == OK && (status = source_next(source, &frame)) == OK; i++)
        if (i >= of.first && i < of.end)
            status = mapper_add(mapper, &frame);
    if (status == NOTHING)
        status = mapper_finish(mapper, out, &report);
    numbers[5] = (bench_all_threads_ms() - begun_ms) / fmax(of.end - of.first, 1);
    numbers[8] = status == OK ? 1e3 * report.readout_s : 0;
    mapper_close(&mapper);
    source_close(&source);
    return status;
}

struct located {
    struct vec3 *found, *truth;
    int count;
};

// One image by the tracker and, for the time alone, by libapriltag.
static enum status locate_image(const struct sequence *sequence, struct camera_tracker *tracker,
                                const struct frame *frame, struct located *located, double numbers[NUMBERS])
{
    struct location at;
    struct camera_motion motion;
    const double begun_ms = bench_clock_ms();
    const enum status status = camera_tracker_process(tracker, frame->color, NULL, frame->time_ns, &at, &motion);
    numbers[6] += bench_clock_ms() - begun_ms;
    if (status < 0 && status != ERR_SOLVER)
        return status;
    numbers[1] += status == OK;
    if (status == OK && truth_at(&sequence->truth, (double)frame->time_ns * 1e-9, &located->truth[located->count]))
        located->found[located->count++] = at.world_from_camera.translation;
    return OK;
}

static void time_apriltag(struct apriltag_peer *peer, const struct lens *lens, const struct frame *frame,
                          double numbers[NUMBERS])
{
    struct pose ignored;
    uint8_t *gray = malloc(lens_pixels(lens));
    if (!gray)
        return;
    gray_from_rgb(frame->color, lens_pixels(lens), gray);
    const double begun_ms = bench_clock_ms();
    status_ignore(apriltag_peer_find(peer, gray, lens, 0, 0.1, &ignored)); // there is none
    numbers[7] += bench_clock_ms() - begun_ms;
    free(gray);
}

static enum status locate(const struct sequence *sequence, const struct place *place, struct stretch of,
                          struct located *located, double numbers[NUMBERS])
{
    struct source *source;
    struct camera_tracker *tracker = NULL;
    struct apriltag_peer *peer = NULL;
    struct frame frame;
    enum status status = source_open(&source, sequence->uri, SOURCE_SENSOR);
    struct lens lens = {0};
    if (status == OK) {
        lens = source_calibration(source)->color;
        lens.readout_s = place->calibration.color.readout_s; // the same camera's, as the map has it
        status = camera_tracker_open(&tracker, place, &lens, NULL);
    }
    if (status == OK)
        status = apriltag_peer_open(&peer, 2);
    for (int i = 0; status == OK && (status = source_next(source, &frame)) == OK; i++)
        if (i >= of.first && i < of.end && frame.color) {
            numbers[0]++;
            status = locate_image(sequence, tracker, &frame, located, numbers);
            time_apriltag(peer, &lens, &frame, numbers);
        }
    camera_tracker_close(&tracker);
    apriltag_peer_close(&peer);
    source_close(&source);
    return status == NOTHING ? OK : status;
}

static int compare_doubles(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

// Fills the errors, mm; NaN where too few images were located.
static void judge(const struct located *located, double numbers[NUMBERS])
{
    double squares = 0, *off = calloc((size_t)located->count + 1, sizeof *off);
    numbers[2] = numbers[3] = numbers[4] = NAN;
    if (off && located->count > 2) {
        const struct pose truth_from_map = align_points(located->found, located->truth, located->count);
        for (int i = 0; i < located->count; i++) {
            off[i] = 1e3 * v3_distance(pose_apply(truth_from_map, located->found[i]), located->truth[i]);
            squares += off[i] * off[i];
        }
        qsort(off, (size_t)located->count, sizeof *off, compare_doubles);
        numbers[2] = sqrt(squares / located->count);
        numbers[3] = off[located->count / 2];
        numbers[4] = off[located->count - 1];
    }
    free(off);
}

static enum status run_row(struct bench *b, const char *name, const struct sequence *sequence, struct stretch mapped,
                           struct stretch sought)
{
    struct place place = {0};
    double numbers[NUMBERS] = {0};
    struct located located = {calloc((size_t)sequence->images + 1, sizeof(struct vec3)),
                              calloc((size_t)sequence->images + 1, sizeof(struct vec3)), 0};
    enum status status = located.found && located.truth ? OK : fail(ERR_MEMORY, "no memory for the path");
    if (status == OK)
        status = map(sequence, mapped, &place, numbers);
    if (status == OK)
        status = locate(sequence, &place, sought, &located, numbers);
    if (status == OK) {
        judge(&located, numbers);
        const double images = fmax(numbers[0], 1);
        numbers[1] *= 100 / images;
        numbers[6] /= images;
        numbers[7] /= images;
        status = bench_add_row(b, name, numbers);
    }
    place_free(&place);
    free(located.found);
    free(located.truth);
    return status;
}

static enum status run(struct bench *b)
{
    static struct sequence sequence;
    const char *data = bench_inputs(b)->data;
    sequence = (struct sequence){.images = 0};
    bench_columns(b, columns, NUMBERS);
    if (!data)
        return fail(ERR_INPUT, "give a sequence with --data FOLDER");
    snprintf(sequence.uri, sizeof sequence.uri, "folder:%s", data);
    enum status status = read_truth(data, &sequence.truth);
    if (status == OK)
        status = count_images(&sequence);
    const struct stretch all = {0, sequence.images}, first = {0, sequence.images / 2},
                         second = {sequence.images / 2, sequence.images};
    if (status == OK)
        status = run_row(b, "map and locate the same images", &sequence, all, all);
    if (status == OK)
        status = run_row(b, "map the first half, locate the second", &sequence, first, second);
    free_truth(&sequence.truth);
    return status;
}

const struct bench_stage bench_stage_tum = {
    .name = "tum",
    .about = "a sequence of TUM's RGB-D benchmark (--data FOLDER), mapped and located without tags",
    .error_name = "ate_mm",
    .time_name = "locate_ms",
    .run = run,
};
