// Stage "skeleton": joints from depth: error against time over the tracker's settings, next to what libapriltag takes
// for the same instant's colour image.
//
// Without --data the small world's kata is rendered. With --data FOLDER, a folder with depth.txt and calibration.json,
// and joints_truth.csv and sensor_truth.txt in FOLDER/truth or FOLDER/../truth. With --motions, --bodies, --dice,
// --joints, --sequences or --empty tables of error alone, see bench_skeleton_trials.h.
#include "capture/point_finder.h"
#include "capture/tracking/tracker.h"
#include "tests/bench/bench.h"
#include "tests/bench/bench_skeleton_data.h"
#include "tests/bench/bench_skeleton_picture.h"
#include "tests/bench/bench_skeleton_trials.h"
#include "tests/bench/bench_tags_peers.h"

#include <stdio.h>
#include <stdlib.h>

struct skeleton_ours {
    const struct skeleton_data *data;
    struct tracker_options options;
    struct tracker *tracker;
    struct pose_network *network; // NULL: depth alone
    double look_ms;               // of the last image that was looked at, a frame
    struct skeleton joints;       // of the last frame
    double error_mm;
};

// Body points of the frame's colour image, if it has one that is to be looked at. The network's time is spread evenly
// over the frames up to the next such image: `record` looks in a thread of its own.
static enum status look(struct skeleton_ours *o, const struct skeleton_frame *f)
{
    struct body_points points;
    const struct lens *lens = &o->data->calibration.color;
    if (!o->network || !f->color)
        return OK;
    const double started_ms = bench_clock_ms();
    const enum status status = body_points_of_image(o->network, f->color, lens->width, lens->height, &points);
    o->look_ms = (bench_clock_ms() - started_ms) / SKELETON_LOOK_EVERY;
    if (status == OK)
        tracker_set_body_points(o->tracker, &points);
    return status < 0 ? status : OK;
}

static enum status measure_ours(void *self, int item, struct bench_measure *out)
{
    struct skeleton_ours *o = self;
    if (item == 0) { // a new round
        tracker_close(&o->tracker);
        enum status status = tracker_open(&o->tracker, &o->data->calibration, &o->options);
        if (status != OK)
            return status;
        if (o->network)
            pose_network_restart(o->network);
    }
    const struct skeleton_frame *f = &o->data->frame[item];
    struct skeleton got;
    enum status status = look(o, f);
    if (status != OK)
        return status;
    double started_ms = bench_clock_ms();
    status = tracker_next(o->tracker, f->time_ns, f->depth, &got, NULL);
    out->time_ms = bench_clock_ms() - started_ms + o->look_ms;
    if (status != OK)
        return status;
    struct tracker_times times = tracker_last_times(o->tracker);
    const int64_t steps_ns[] = {times.segment, times.evidence, times.fit, times.search};
    for (size_t i = 0; i < COUNT_OF(steps_ns); i++)
        out->extra[2 + i] = (double)steps_ns[i] * 1e-6;
    for (int j = 0; j < JOINT_COUNT; j++) {
        double e = v3_distance(got.joint[j], f->truth.joint[j]);
        out->error += 1000 * e / JOINT_COUNT;
        out->extra[0] += (e < 0.1 && got.confidence[j] > 0) * 100.0 / JOINT_COUNT;
        out->extra[1] = fmax(out->extra[1], 1000 * e);
    }
    o->joints = got;
    o->error_mm = out->error;
    return OK;
}

// The last frame by the fewest, the usual and the most points.
static void draw_pictures(struct bench *b, const struct skeleton_ours *ours, const struct bench_contender *contenders,
                          const int *shown, int count)
{
    const struct skeleton_data *data = ours->data;
    const struct skeleton_frame *f = &data->frame[data->count - 1];
    for (int i = 0; i < count; i++) {
        const struct skeleton_ours *o = &ours[shown[i]];
        const struct skeleton_instant instant = {&data->calibration, f->depth, &f->truth, &o->joints};
        char caption[100];
        snprintf(caption, sizeof caption, "%s: %.0f mm; white: the truth", contenders[shown[i]].name, o->error_mm);
        bench_skeleton_picture(b, caption, &instant);
    }
}

struct skeleton_peer {
    const struct skeleton_data *data;
    struct apriltag_peer *apriltag;
};

// Only its time counts: it does not estimate joints.
static enum status measure_peer(void *self, int item, struct bench_measure *out)
{
    struct skeleton_peer *o = self;
    struct pose found;
    double started_ms = bench_clock_ms();
    enum status status =
        apriltag_peer_find(o->apriltag, o->data->frame[item].gray, &o->data->calibration.color, -1, 1, &found);
    out->time_ms = bench_clock_ms() - started_ms;
    return status < 0 ? status : NOTHING;
}

enum { FILMED = 90 };
static const char POINTED[] = "600, 5 and body points";

static enum status run_settings(struct bench *b)
{
    static const struct {
        const char *name;
        int points, iterations;
    } settings[] = {
        {"150 points, 3 rounds", 150, 3}, {"300 points, 4 rounds", 300, 4},   {"600 points, 5 rounds", 600, 5},
        {"600 points, 7 rounds", 600, 7}, {"1200 points, 7 rounds", 1200, 7}, {"1600 points, 12 rounds", 1600, 12},
    };
    enum { SETTINGS = COUNT_OF(settings) };
    struct skeleton_data data;
    struct skeleton_ours ours[SETTINGS], pointed = {.data = &data, .options = tracker_default_options()};
    struct bench_contender contenders[SETTINGS + 2];
    struct skeleton_peer peer = {.data = &data};
    enum status status = skeleton_data_open(&data, bench_inputs(b)->data, bench_count(b, FILMED, 0.25));
    for (int i = 0; i < SETTINGS; i++) {
        ours[i] = (struct skeleton_ours){.data = &data, .options = tracker_default_options()};
        ours[i].options.points = settings[i].points;
        ours[i].options.iterations = settings[i].iterations;
        contenders[i] = (struct bench_contender){settings[i].name, measure_ours, &ours[i], false};
    }
    contenders[SETTINGS] = (struct bench_contender){"libapriltag, decimate 2", measure_peer, &peer, true};
    contenders[SETTINGS + 1] = (struct bench_contender){POINTED, measure_ours, &pointed, false};
    if (status == OK)
        status = pose_network_open(&pointed.network, NULL, POSE_NETWORK_LITE);
    const bool networks = status == OK;
    if (status == ERR_MISSING) {
        if (!bench_inputs(b)->json)
            fprintf(stderr, "without body points: %s\n", status_message());
        status = OK;
    }
    if (status == OK)
        status = apriltag_peer_open(&peer.apriltag, 2);
    if (status == OK)
        status = bench_run(b, contenders, SETTINGS + 1 + networks, data.count);
    if (status == OK)
        draw_pictures(b, ours, contenders, (const int[]){0, 2, SETTINGS - 1}, 3);
    for (int i = 0; i < SETTINGS; i++)
        tracker_close(&ours[i].tracker);
    tracker_close(&pointed.tracker);
    pose_network_close(&pointed.network);
    apriltag_peer_close(&peer.apriltag);
    skeleton_data_close(&data);
    return status;
}

static enum status run(struct bench *b)
{
    const struct bench_inputs *in = bench_inputs(b);
    return in->dice.films    ? trial_dice(b, &in->dice, in->motions)
           : in->motions     ? trial_motions(b, in->motions)
           : in->joints      ? trial_joints(b, in->joints)
           : in->empty.count ? trial_empty(b, &in->empty)
           : in->sequences   ? trial_sequences(b, in->sequences)
           : in->bodies      ? trial_bodies(b)
                             : run_settings(b);
}

const struct bench_stage bench_stage_skeleton = {
    .name = "skeleton",
    .about = "16 joints from depth, segmentation included",
    .error_name = "mean_error_mm",
    .time_name = "time_ms",
    .extra_names = {"within_10cm_percent", "worst_joint_mm", "segment_ms", "evidence_ms", "fit_ms", "search_ms"},
    .run = run,
};
