// The recorder's threads and the smoothing after them.
#include "capture/recorder.h"

#include "base/clock.h"
#include "base/threads.h"
#include "capture/body_radii.h"
#include "capture/follow.h"
#include "capture/point_finder.h"
#include "capture/take_verdict.h"
#include "capture/tracking/skeleton_smoother.h"
#include "platform/files/file.h"
#include "platform/files/jpeg.h"
#include "platform/sensors/source.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// Owns copies of the sensor's images. NULL: it gave none.
struct recorder_item {
    int64_t time_ns;
    uint8_t *color, *jpeg, *mask;
    uint16_t *depth;
    size_t jpeg_bytes;
    struct pose world_from_camera;
    bool located, has_skeleton, body_changed, has_points, after_pause, has_odometry;
    struct pose odometry_from_camera; // as in struct frame
    struct body_points points;
    struct skeleton skeleton;
    struct body body;
};

// ---------------------------------------------------------------- recorder item

// NULL is fine
static void recorder_item_free(struct recorder_item *item)
{
    if (!item)
        return;
    free(item->color);
    free(item->jpeg);
    free(item->mask);
    free(item->depth);
    free(item);
}

static void *copy_bytes(const void *bytes, size_t count)
{
    void *to = malloc(count);
    return to ? memcpy(to, bytes, count) : NULL;
}

// With copies of the frame's images, and a mask of zeros where there is depth. NULL: out of memory.
static struct recorder_item *recorder_item_from_frame(const struct frame *frame, const struct calibration *calibration)
{
    struct recorder_item *item = calloc(1, sizeof *item);
    if (!item)
        return NULL;
    item->time_ns = frame->time_ns;
    item->has_odometry = frame->has_odometry;
    item->odometry_from_camera = frame->odometry_from_camera;
    item->world_from_camera = POSE_IDENTITY;
    bool whole = true;
    if (frame->color)
        whole &= (item->color = copy_bytes(frame->color, 3 * lens_pixels(&calibration->color))) != NULL;
    if (frame->jpeg) {
        whole &= (item->jpeg = copy_bytes(frame->jpeg, frame->jpeg_bytes)) != NULL;
        item->jpeg_bytes = frame->jpeg_bytes;
    }
    if (frame->depth) {
        whole &=
            (item->depth = copy_bytes(frame->depth, sizeof *frame->depth * lens_pixels(&calibration->depth))) != NULL;
        whole &= (item->mask = calloc(lens_pixels(&calibration->depth), 1)) != NULL;
    }
    if (!whole) {
        recorder_item_free(item);
        return NULL;
    }
    return item;
}

// ---------------------------------------------------------------- recorder

// Capacity of the queues before the two worker threads. At 640 x 480 a frame takes 1.9 MB; two seconds of a 30 Hz
// sensor can wait before a frame is dropped.
enum { WAITING_FRAMES = 60, WAITING_WRITES = 20 };

// What the frames of one queue may take together: of large pictures fewer wait.
enum { WAITING_BYTES_MAX = 256 << 20, WAITING_MIN = 3 };

// How far a recorded source is read ahead of what is in the file: a kill costs less than a second of film.
enum { FILM_AT_RISK_NS = 900000000 };

// Body points are looked for in every third image, 10 a second: errors of neighbouring images are alike, and a network
// takes 10 to 30 ms. A live source's image is left out where so many frames wait behind it already.
enum { LOOK_EVERY = 3, LOOK_WAITING_MAX = 15, WAITING_LOOKED = 4 };

static const int JPEG_QUALITY = 92; // for sensors that deliver raw images. Chosen by hand

struct recorder {
    const struct calibration *calibration;
    const struct recorder_options *options;
    struct recording_writer *writer;
    struct queue *to_look, *to_process, *to_write; // to_look: NULL without body points

    // used by the caller's thread only
    int64_t synced_before, written_before; // by earlier takes of the writer
    int64_t state_ns;                      // when the state was last reported

    // used by the looking thread only, until it is joined
    struct pose_network *network;
    int64_t seen, looked;
    bool live;

    // used by the processing thread only, until it is joined
    struct follower *follower;
    struct smoother *smoother; // NULL once its memory was exhausted
    bool smoothing_out_of_memory;
    struct body_radii radii;
    int64_t frames_processed;
    double busy_ms, slowest_ms;

    // used by the writing thread only, until it is joined
    int64_t written, tracked;

    // how each worker ended, with its sentence, which is kept per thread
    struct failure look_failure, process_failure, write_failure;
};

// ------------------------------------------------------------- looking for body points

// The points of image k belong to frame k and travel with it, so that the same images give the same joints. A recorded
// source waits for them. A live one's frames queue up meanwhile, and only where the network does not keep up with the
// sensor are images left out.
static enum status look_at(struct recorder *recorder, struct recorder_item *item)
{
    const bool due =
        recorder->seen++ % LOOK_EVERY == 0 && !(recorder->live && queue_count(recorder->to_look) > LOOK_WAITING_MAX);
    if (!due || !item->color)
        return OK;
    const struct lens *lens = &recorder->calibration->color;
    enum status status = body_points_of_image(recorder->network, item->color, lens->width, lens->height, &item->points);
    item->has_points = status == OK;
    recorder->looked++;
    return status < 0 ? status : OK;
}

// Like the other workers it must not take the processor from the sensor's thread while that hands over a frame.
static void *look_at_all(void *context)
{
    struct recorder *r = context;
    thread_wake_without_preempting();
    enum status status = OK;
    struct recorder_item *item;
    while (status == OK && (item = queue_take(r->to_look))) {
        status = look_at(r, item);
        if (status != OK || !queue_put(r->to_process, item)) {
            recorder_item_free(item);
            break;
        }
    }
    failure_keep(&r->look_failure, status);
    queue_stop(r->to_look);
    queue_stop(r->to_process);
    return NULL;
}

// ------------------------------------------------------------- processing

static struct follower_frame frame_of_item(const struct recorder_item *item)
{
    return (struct follower_frame){.time_ns = item->time_ns,
                                   .color = item->color,
                                   .depth = item->depth,
                                   .mask = item->mask,
                                   .has_odometry = item->has_odometry,
                                   .odometry_from_camera = item->odometry_from_camera};
}

// Smoothing is optional: where its memory cannot grow, it is given up and recording goes on.
static enum status push_to_smoother(struct recorder *recorder, int64_t time_ns, const struct skeleton *online)
{
    if (!recorder->smoother)
        return OK;
    enum status status = smoother_push(recorder->smoother, follower_tracker(recorder->follower), time_ns, online);
    if (status != ERR_MEMORY)
        return status;
    smoother_close(&recorder->smoother);
    recorder->smoothing_out_of_memory = true;
    return OK;
}

// The item has been located.
static enum status track_item(struct recorder *recorder, struct recorder_item *item, struct followed_frame *followed)
{
    const struct follower_frame frame = frame_of_item(item);
    if (item->after_pause) // the person may stand elsewhere by now
        follower_reset(recorder->follower);
    if (item->has_points)
        follower_set_points(recorder->follower, item->time_ns, &item->points);
    enum status status = follower_track(recorder->follower, &frame, followed);
    if (status != OK)
        return status;
    item->located = followed->located;
    item->world_from_camera = followed->world_from_camera;
    item->skeleton = followed->skeleton;
    status = push_to_smoother(recorder, item->time_ns, followed->person ? &item->skeleton : NULL);
    if (status != OK || !followed->person)
        return status;
    item->has_skeleton = true;
    item->body_changed = body_radii_add_frame(&recorder->radii, recorder->frames_processed, recorder->calibration,
                                              &item->skeleton, item->depth, item->mask);
    item->body = recorder->radii.body;
    return OK;
}

static void show_item(const struct recorder *recorder, const struct recorder_item *item,
                      const struct followed_frame *followed)
{
    if (!recorder->options->on_seen)
        return;
    const struct recorder_seen seen = {.time_ns = item->time_ns,
                                       .color = item->color,
                                       .depth = item->depth,
                                       .mask = item->has_skeleton ? item->mask : NULL,
                                       .skeleton = item->has_skeleton ? &item->skeleton : NULL,
                                       .located = item->located,
                                       .sight = followed->sight,
                                       .sensor_moves = followed->sensor_moves};
    recorder->options->on_seen(recorder->options->context, &seen);
}

// Takes ownership of the item. located_before: it has been located already, as the first frames have.
static enum status process_item(struct recorder *recorder, struct recorder_item *item, bool located_before)
{
    int64_t begun = clock_now_ns();
    struct followed_frame followed;
    const struct follower_frame frame = frame_of_item(item);
    enum status status = located_before ? OK : follower_locate(recorder->follower, &frame);
    if (status == OK)
        status = track_item(recorder, item, &followed);
    if (status == OK && item->color && !item->jpeg)
        status = jpeg_encode(item->color, recorder->calibration->color.width, recorder->calibration->color.height,
                             JPEG_QUALITY, &item->jpeg, &item->jpeg_bytes);
    if (status == OK)
        show_item(recorder, item, &followed);
    double ms = (double)(clock_now_ns() - begun) / 1e6;
    recorder->busy_ms += ms;
    recorder->slowest_ms = fmax(recorder->slowest_ms, ms);
    recorder->frames_processed++;
    if (status != OK || !queue_put(recorder->to_write, item))
        recorder_item_free(item);
    return status;
}

// The first frames are held back until the sensor's pose has been averaged over all of them.
static enum status process_first(struct recorder *recorder)
{
    struct recorder_item *held[SENSOR_POSE_WARM_UP];
    int count = 0;
    enum status status = OK;
    while (count < SENSOR_POSE_WARM_UP && status == OK && (held[count] = queue_take(recorder->to_process))) {
        const struct follower_frame frame = frame_of_item(held[count++]);
        status = follower_locate(recorder->follower, &frame);
    }
    for (int i = 0; i < count; i++) {
        if (status == OK)
            status = process_item(recorder, held[i], true);
        else
            recorder_item_free(held[i]);
    }
    return status;
}

static void *process_all(void *context)
{
    struct recorder *r = context;
    thread_wake_without_preempting();
    enum status status = process_first(r);
    struct recorder_item *item;
    while (status == OK && (item = queue_take(r->to_process)))
        status = process_item(r, item, false);
    failure_keep(&r->process_failure, status);
    queue_stop(r->to_process);
    queue_stop(r->to_write);
    return NULL;
}

// ------------------------------------------------------------- writing

static enum status write_item(struct recorder *recorder, const struct recorder_item *item)
{
    struct take_frame frame = {
        .time_ns = item->time_ns,
        .world_from_camera = item->world_from_camera,
        .located = item->located,
        .jpeg = item->jpeg,
        .jpeg_bytes = item->jpeg_bytes,
        .depth = item->depth,
        .mask = item->has_skeleton ? item->mask : NULL,
        .has_skeleton = item->has_skeleton,
        .skeleton = item->skeleton,
    };
    enum status status = recording_add_frame(recorder->writer, &frame);
    if (status == OK && item->body_changed)
        status = recording_put_body(recorder->writer, &item->body);
    if (status == OK) {
        recorder->written++;
        recorder->tracked += item->has_skeleton;
    }
    return status;
}

static void *write_all(void *context)
{
    struct recorder *r = context;
    thread_wake_without_preempting();
    enum status status = OK;
    struct recorder_item *item;
    while (status == OK && (item = queue_take(r->to_write))) {
        status = write_item(r, item);
        recorder_item_free(item);
    }
    failure_keep(&r->write_failure, status);
    queue_stop(r->to_write);
    queue_stop(r->to_process);
    return NULL;
}

// ------------------------------------------------------------- reading

// Frames that a queue of up to `max` may hold.
static int waiting_frames(const struct calibration *calibration, int max)
{
    const size_t bytes = 4 * lens_pixels(&calibration->color) + 3 * lens_pixels(&calibration->depth) +
                         1; // with the JPEG, at most a byte a pixel
    const size_t fit = WAITING_BYTES_MAX / bytes;
    if (fit < WAITING_MIN)
        return WAITING_MIN;
    return fit < (size_t)max ? (int)fit : max;
}

// Waits until so little film is on its way that a kill would cost less than a second. The first frames are held back
// until the sensor is located, and two must be on their way in any case, so that slow films move on.
static void wait_for_file(struct recorder *recorder, int64_t time_ns, int64_t frames_read)
{
    struct queue *first = recorder->to_look ? recorder->to_look : recorder->to_process;
    while (!recorder->live && !queue_is_stopped(first)) {
        const struct recording_counters c = recording_writer_count(recorder->writer);
        const int64_t kept = c.synced_frames - recorder->synced_before;
        if (c.failed || frames_read - kept < (kept > 0 ? 2 : SENSOR_POSE_WARM_UP + 2) ||
            (kept > 0 && time_ns - c.synced_ns < FILM_AT_RISK_NS))
            return;
        clock_sleep_until_ns(clock_now_ns() + 1000000);
    }
}

static int waiting_now(struct recorder *recorder)
{
    return (recorder->to_look ? queue_count(recorder->to_look) : 0) + queue_count(recorder->to_process) +
           queue_count(recorder->to_write) + (int)recording_writer_count(recorder->writer).waiting_frames;
}

static void report_state(struct recorder *recorder, const struct recorder_options *options, int64_t film_ns,
                         struct recorder_result *result)
{
    const int waiting = waiting_now(recorder);
    result->waiting_max = waiting > result->waiting_max ? waiting : result->waiting_max;
    const double seconds = (double)film_ns * 1e-9,
                 written = (double)(recording_writer_count(recorder->writer).written_bytes - recorder->written_before);
    result->mb_per_s = seconds > 0.5 ? written * 1e-6 / seconds : 0;
    struct recorder_state state = {
        .waiting = waiting, .dropped = result->dropped, .mb_per_s = result->mb_per_s, .minutes_left = -1};
    const int64_t now_ns = clock_now_ns();
    if (!options->on_state || now_ns - recorder->state_ns < 1000000000)
        return;
    recorder->state_ns = now_ns;
    const double room = (double)file_room_bytes(recording_writer_path(recorder->writer)) * 1e-6;
    if (result->mb_per_s > 0 && room >= 0)
        state.minutes_left = room / result->mb_per_s / 60;
    options->on_state(options->context, &state);
}

// Hands one frame to the workers. NOTHING: one of them failed; its own status says why.
static enum status hand_over(struct recorder *recorder, const struct frame *frame, bool after_pause,
                             struct recorder_result *result)
{
    const int64_t begun_ns = clock_now_ns();
    struct recorder_item *item = recorder_item_from_frame(frame, recorder->calibration);
    if (!item)
        return fail(ERR_MEMORY, "no memory for another frame");
    item->after_pause = after_pause;
    struct queue *first = recorder->to_look ? recorder->to_look : recorder->to_process;
    const bool taken = recorder->live ? queue_try_put(first, item) : queue_put(first, item);
    if (recorder->live)
        result->handover_ms = fmax(result->handover_ms, (double)(clock_now_ns() - begun_ns) * 1e-6);
    if (taken)
        return OK;
    recorder_item_free(item);
    result->dropped += recorder->live;
    return recorder->live ? OK : NOTHING;
}

// Until the source ends, the user stops or a worker fails.
static enum status read_all(struct recorder *recorder, struct source *source, const struct recorder_options *options,
                            struct recorder_result *result)
{
    struct take_clock clock = {0};
    for (;;) {
        struct frame frame;
        enum status status = take_frames_next(&clock, source, options, &frame, result);
        if (status != OK)
            return status == NOTHING ? OK : status;
        if (options->on_read)
            options->on_read(options->context, &frame);
        wait_for_file(recorder, frame.time_ns, clock.frames - 1);
        status = hand_over(recorder, &frame, clock.after_pause, result);
        if (status != OK)
            return status == NOTHING ? OK : status;
        report_state(recorder, options, frame.time_ns - clock.first_ns, result);
        if (options->on_frame)
            options->on_frame(options->context);
    }
}

// ------------------------------------------------------------- the take

static void drain_queue(struct queue *queue)
{
    struct recorder_item *item;
    if (!queue)
        return;
    queue_stop(queue);
    while ((item = queue_take(queue)))
        recorder_item_free(item);
}

static void recorder_free(struct recorder *recorder)
{
    drain_queue(recorder->to_look);
    drain_queue(recorder->to_process);
    drain_queue(recorder->to_write);
    queue_close(&recorder->to_look);
    queue_close(&recorder->to_process);
    queue_close(&recorder->to_write);
    follower_close(&recorder->follower);
    smoother_close(&recorder->smoother);
    pose_network_close(&recorder->network);
}

// Without the networks everything works from depth alone; the result says so.
static enum status prepare_points(struct recorder *recorder, struct recorder_result *result)
{
    if (recorder->calibration->color.width <= 0)
        return OK;
    enum status status = pose_network_open(&recorder->network, NULL, POSE_NETWORK_LITE);
    if (status == ERR_MISSING) {
        snprintf(result->no_body_points, sizeof result->no_body_points, "%.255s", status_message());
        return OK;
    }
    return status == OK ? queue_open(&recorder->to_look, waiting_frames(recorder->calibration, WAITING_FRAMES))
                        : status;
}

static enum status recorder_prepare(struct recorder *recorder, const struct place *place,
                                    const struct recorder_options *given, struct recorder_result *result)
{
    struct follower_options options = follower_default_options();
    options.place = place;
    body_radii_start(&recorder->radii);
    enum status status = given->body_points ? prepare_points(recorder, result) : OK;
    if (status == OK)
        status = follower_open(&recorder->follower, recorder->calibration, &options);
    if (status == OK)
        status = smoother_open(&recorder->smoother, recorder->calibration);
    if (status == OK)
        smoother_limit_memory(recorder->smoother, given->smoother_bytes_max);
    if (status == OK)
        status = queue_open(&recorder->to_process,
                            waiting_frames(recorder->calibration, recorder->to_look ? WAITING_LOOKED : WAITING_FRAMES));
    if (status == OK)
        status = queue_open(&recorder->to_write, waiting_frames(recorder->calibration, WAITING_WRITES));
    return status;
}

static void fill_result(const struct recorder *recorder, const struct source *source, struct recorder_result *result)
{
    struct pose pose;
    const struct sensor_pose *sensor = recorder->follower ? follower_sensor_pose(recorder->follower) : NULL;
    result->frames = recorder->written;
    result->tracked = recorder->tracked;
    result->looked = recorder->looked;
    result->dropped += source_dropped(source);
    result->first_moved = -1;
    if (sensor) {
        struct sensor_sight sight;
        sensor_pose_get_sight(sensor, &sight);
        result->located = sensor_pose_get(sensor, &pose);
        result->sensor_moves = sensor_pose_moves(sensor);
        result->mirrored = sight.mirrored;
        result->tags_moved = sensor_pose_moved_tags(sensor, &result->first_moved);
    }
    result->smoothing_out_of_memory = recorder->smoothing_out_of_memory;
    result->slowest_ms = recorder->slowest_ms;
    result->mean_ms = recorder->frames_processed ? recorder->busy_ms / (double)recorder->frames_processed : 0;
}

// The take is complete already, and stays so whatever fails here.
static enum status smooth_take(struct recorder *recorder, const char *name, const struct recorder_options *options,
                               struct recorder_result *result)
{
    if (!recorder->tracked || !recorder->smoother)
        return OK;
    const struct sensor_pose *sensor = follower_sensor_pose(recorder->follower);
    if (sensor && sensor_pose_far_moves(sensor))
        return OK;
    int64_t begun = clock_now_ns();
    enum status status =
        take_smooth(recorder->smoother, follower_tracker(recorder->follower), recorder->writer, name, options);
    if (status == ERR_MEMORY) {
        result->smoothing_out_of_memory = true;
        return OK;
    }
    if (status == OK)
        result->smoothing_ms = (double)(clock_now_ns() - begun) / 1e6 / (double)recorder->written;
    return status == NOTHING ? OK : status;
}

// Runs the workers beside read_all. Of several failures the likeliest cause is returned: writing, then processing, then
// looking, then the sensor.
static enum status run_threads(struct recorder *recorder, struct source *source, const struct recorder_options *options,
                               struct recorder_result *result)
{
    struct worker_thread looking, processing, writing;
    worker_thread_open(&looking);
    worker_thread_open(&processing);
    worker_thread_open(&writing);
    enum status status = worker_thread_start(&processing, process_all, recorder, "to track the person on");
    if (status == OK)
        status = worker_thread_start(&writing, write_all, recorder, "to write the recording on");
    if (status == OK && recorder->to_look)
        status = worker_thread_start(&looking, look_at_all, recorder, "to look for body points on");
    if (status == OK)
        status = read_all(recorder, source, options, result);
    if (recorder->to_look)
        queue_stop(recorder->to_look);
    worker_thread_close(&looking);
    queue_stop(recorder->to_process);
    worker_thread_close(&processing);
    queue_stop(recorder->to_write);
    worker_thread_close(&writing);
    if (recorder->write_failure.status != OK)
        return failure_restore(&recorder->write_failure);
    if (recorder->process_failure.status != OK)
        return failure_restore(&recorder->process_failure);
    if (recorder->look_failure.status != OK)
        return failure_restore(&recorder->look_failure);
    return status;
}

enum status recorder_run(struct source *source, struct recording_writer *writer, const char *name,
                         const struct place *place, const struct recorder_options *options,
                         struct recorder_result *result)
{
    *result = (struct recorder_result){0};
    struct recorder r = {.calibration = source_calibration(source),
                         .options = options,
                         .writer = writer,
                         .live = source_is_live(source)};
    enum status status = recording_begin_take(writer, name, r.calibration);
    if (status == OK) {
        r.synced_before = recording_writer_count(writer).synced_frames;
        r.written_before = recording_writer_count(writer).written_bytes;
        status = recorder_prepare(&r, place, options, result);
        if (status == OK)
            status = run_threads(&r, source, options, result);
        fill_result(&r, source, result);
        if (r.write_failure.status == OK) {
            // A take that lost its sensor is complete as far as it goes; keep the first sentence.
            struct failure first;
            failure_keep(&first, status);
            enum status ended = recording_put_dropped(writer, result->dropped);
            if (ended == OK)
                ended = recording_end_take(writer);
            if (ended == OK && r.process_failure.status == OK)
                ended = smooth_take(&r, name, options, result);
            status = status == OK ? ended : failure_restore(&first);
        }
    }
    recorder_free(&r);
    return status;
}
