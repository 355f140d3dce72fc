// The recorder's threads and the smoothing after them.
#include "capture/recorder.h"

#include "base/clock.h"
#include "base/threads.h"
#include "capture/point_finder.h"
#include "capture/body_radii.h"
#include "capture/follow.h"
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
    bool located, has_skeleton, body_changed, has_points, after_pause;
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
enum { WAITING_BYTES_MAX = 256 << 20, WAITING_LEAST = 3 };

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
static enum status look_at(struct recorder *r, struct recorder_item *item)
{
    const bool due = r->seen++ % LOOK_EVERY == 0 && !(r->live && queue_count(r->to_look) > LOOK_WAITING_MAX);
    if (!due || !item->color)
        return OK;
    const struct lens *lens = &r->calibration->color;
    enum status status = body_points_of_image(r->network, item->color, lens->width, lens->height, &item->points);
    item->has_points = status == OK;
    r->looked++;
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
    return (struct follower_frame){
        .time_ns = item->time_ns, .color = item->color, .depth = item->depth, .mask = item->mask};
}

// Smoothing is optional: where its memory cannot grow, it is given up and recording goes on.
static enum status push_to_smoother(struct recorder *r, int64_t time_ns, const struct skeleton *online)
{
    if (!r->smoother)
        return OK;
    enum status status = smoother_push(r->smoother, follower_tracker(r->follower), time_ns, online);
    if (status != ERR_MEMORY)
        return status;
    smoother_close(&r->smoother);
    r->smoothing_out_of_memory = true;
    return OK;
}

// The item has been located.
static enum status track_item(struct recorder *r, struct recorder_item *item, struct followed_frame *followed)
{
    const struct follower_frame frame = frame_of_item(item);
    if (item->after_pause) // the person may stand elsewhere by now
        follower_reset(r->follower);
    if (item->has_points)
        follower_set_points(r->follower, item->time_ns, &item->points);
    enum status status = follower_track(r->follower, &frame, followed);
    if (status != OK)
        return status;
    item->located = followed->located;
    item->world_from_camera = followed->world_from_camera;
    item->skeleton = followed->skeleton;
    status = push_to_smoother(r, item->time_ns, followed->person ? &item->skeleton : NULL);
    if (status != OK || !followed->person)
        return status;
    item->has_skeleton = true;
    item->body_changed =
        body_radii_add_frame(&r->radii, r->frames_processed, r->calibration, &item->skeleton, item->depth, item->mask);
    item->body = r->radii.body;
    return OK;
}

static void show_item(const struct recorder *r, const struct recorder_item *item, const struct followed_frame *followed)
{
    if (!r->options->on_seen)
        return;
    const struct recorder_seen seen = {.time_ns = item->time_ns,
                                       .color = item->color,
                                       .depth = item->depth,
                                       .mask = item->has_skeleton ? item->mask : NULL,
                                       .skeleton = item->has_skeleton ? &item->skeleton : NULL,
                                       .located = item->located,
                                       .sight = followed->sight,
                                       .sensor_moves = followed->sensor_moves};
    r->options->on_seen(r->options->context, &seen);
}

// Takes ownership of the item. located_before: it has been located already, as the first frames have.
static enum status process_item(struct recorder *r, struct recorder_item *item, bool located_before)
{
    int64_t begun = clock_now_ns();
    struct followed_frame followed;
    const struct follower_frame frame = frame_of_item(item);
    enum status status = located_before ? OK : follower_locate(r->follower, &frame);
    if (status == OK)
        status = track_item(r, item, &followed);
    if (status == OK && item->color && !item->jpeg)
        status = jpeg_encode(item->color, r->calibration->color.width, r->calibration->color.height, JPEG_QUALITY,
                             &item->jpeg, &item->jpeg_bytes);
    if (status == OK)
        show_item(r, item, &followed);
    double ms = (double)(clock_now_ns() - begun) / 1e6;
    r->busy_ms += ms;
    r->slowest_ms = fmax(r->slowest_ms, ms);
    r->frames_processed++;
    if (status != OK || !queue_put(r->to_write, item))
        recorder_item_free(item);
    return status;
}

// The first frames are held back until the sensor's pose has been averaged over all of them.
static enum status process_first(struct recorder *r)
{
    struct recorder_item *held[SENSOR_POSE_WARM_UP];
    int count = 0;
    enum status status = OK;
    while (count < SENSOR_POSE_WARM_UP && status == OK && (held[count] = queue_take(r->to_process))) {
        const struct follower_frame frame = frame_of_item(held[count++]);
        status = follower_locate(r->follower, &frame);
    }
    for (int i = 0; i < count; i++) {
        if (status == OK)
            status = process_item(r, held[i], true);
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

static enum status write_item(struct recorder *r, const struct recorder_item *item)
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
    enum status status = recording_add_frame(r->writer, &frame);
    if (status == OK && item->body_changed)
        status = recording_put_body(r->writer, &item->body);
    if (status == OK) {
        r->written++;
        r->tracked += item->has_skeleton;
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

// Frames that a queue of up to `most` may hold.
static int waiting_frames(const struct calibration *c, int most)
{
    const size_t bytes =
        4 * lens_pixels(&c->color) + 3 * lens_pixels(&c->depth) + 1; // with the JPEG, at most a byte a pixel
    const size_t fit = WAITING_BYTES_MAX / bytes;
    return fit < WAITING_LEAST ? WAITING_LEAST : fit < (size_t)most ? (int)fit : most;
}

// Waits until so little film is on its way that a kill would cost less than a second. The first frames are held back
// until the sensor is located, and two must be on their way in any case, so that slow films move on.
static void wait_for_file(struct recorder *r, int64_t time_ns, int64_t frames_read)
{
    struct queue *first = r->to_look ? r->to_look : r->to_process;
    while (!r->live && !queue_is_stopped(first)) {
        const struct recording_counters c = recording_writer_count(r->writer);
        const int64_t kept = c.synced_frames - r->synced_before;
        if (c.failed || frames_read - kept < (kept > 0 ? 2 : SENSOR_POSE_WARM_UP + 2) ||
            (kept > 0 && time_ns - c.synced_ns < FILM_AT_RISK_NS))
            return;
        clock_sleep_until_ns(clock_now_ns() + 1000000);
    }
}

static int waiting_now(struct recorder *r)
{
    return (r->to_look ? queue_count(r->to_look) : 0) + queue_count(r->to_process) + queue_count(r->to_write) +
           (int)recording_writer_count(r->writer).waiting_frames;
}

static void report_state(struct recorder *r, const struct recorder_options *options, int64_t film_ns,
                         struct recorder_result *result)
{
    const int waiting = waiting_now(r);
    result->waiting_most = waiting > result->waiting_most ? waiting : result->waiting_most;
    const double seconds = (double)film_ns * 1e-9,
                 written = (double)(recording_writer_count(r->writer).written_bytes - r->written_before);
    result->mb_per_s = seconds > 0.5 ? written * 1e-6 / seconds : 0;
    struct recorder_state state = {
        .waiting = waiting, .dropped = result->dropped, .mb_per_s = result->mb_per_s, .minutes_left = -1};
    const int64_t now_ns = clock_now_ns();
    if (!options->on_state || now_ns - r->state_ns < 1000000000)
        return;
    r->state_ns = now_ns;
    const double room = (double)file_room_bytes(recording_writer_path(r->writer)) * 1e-6;
    if (result->mb_per_s > 0 && room >= 0)
        state.minutes_left = room / result->mb_per_s / 60;
    options->on_state(options->context, &state);
}

// Hands one frame to the workers. NOTHING: one of them failed; its own status says why.
static enum status hand_over(struct recorder *r, const struct frame *frame, bool after_pause,
                             struct recorder_result *result)
{
    const int64_t begun_ns = clock_now_ns();
    struct recorder_item *item = recorder_item_from_frame(frame, r->calibration);
    if (!item)
        return fail(ERR_MEMORY, "no memory for another frame");
    item->after_pause = after_pause;
    struct queue *first = r->to_look ? r->to_look : r->to_process;
    const bool taken = r->live ? queue_try_put(first, item) : queue_put(first, item);
    if (r->live)
        result->handover_ms = fmax(result->handover_ms, (double)(clock_now_ns() - begun_ns) * 1e-6);
    if (taken)
        return OK;
    recorder_item_free(item);
    result->dropped += r->live;
    return r->live ? OK : NOTHING;
}

// Until the source ends, the user stops or a worker fails.
static enum status read_all(struct recorder *r, struct source *source, const struct recorder_options *options,
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
        wait_for_file(r, frame.time_ns, clock.frames - 1);
        status = hand_over(r, &frame, clock.after_pause, result);
        if (status != OK)
            return status == NOTHING ? OK : status;
        report_state(r, options, frame.time_ns - clock.first_ns, result);
        if (options->on_frame)
            options->on_frame(options->context);
    }
}

// ------------------------------------------------------------- the take

static void drain(struct queue *queue)
{
    struct recorder_item *item;
    if (!queue)
        return;
    queue_stop(queue);
    while ((item = queue_take(queue)))
        recorder_item_free(item);
}

static void recorder_free(struct recorder *r)
{
    drain(r->to_look);
    drain(r->to_process);
    drain(r->to_write);
    queue_close(&r->to_look);
    queue_close(&r->to_process);
    queue_close(&r->to_write);
    follower_close(&r->follower);
    smoother_close(&r->smoother);
    pose_network_close(&r->network);
}

// Without the networks everything works from depth alone; the result says so.
static enum status prepare_points(struct recorder *r, struct recorder_result *result)
{
    if (r->calibration->color.width <= 0)
        return OK;
    enum status status = pose_network_open(&r->network, NULL, POSE_NETWORK_LITE);
    if (status == ERR_MISSING) {
        snprintf(result->no_body_points, sizeof result->no_body_points, "%.255s", status_message());
        return OK;
    }
    return status == OK ? queue_open(&r->to_look, waiting_frames(r->calibration, WAITING_FRAMES)) : status;
}

static enum status recorder_prepare(struct recorder *r, const struct place *place, const struct recorder_options *given,
                                    struct recorder_result *result)
{
    struct follower_options options = follower_default_options();
    options.place = place;
    body_radii_start(&r->radii);
    enum status status = given->body_points ? prepare_points(r, result) : OK;
    if (status == OK)
        status = follower_open(&r->follower, r->calibration, &options);
    if (status == OK)
        status = smoother_open(&r->smoother, r->calibration);
    if (status == OK)
        smoother_limit_memory(r->smoother, given->smoother_bytes_max);
    if (status == OK)
        status =
            queue_open(&r->to_process, waiting_frames(r->calibration, r->to_look ? WAITING_LOOKED : WAITING_FRAMES));
    if (status == OK)
        status = queue_open(&r->to_write, waiting_frames(r->calibration, WAITING_WRITES));
    return status;
}

static void fill_result(const struct recorder *r, const struct source *source, struct recorder_result *result)
{
    struct pose pose;
    const struct sensor_pose *sensor = r->follower ? follower_sensor_pose(r->follower) : NULL;
    result->frames = r->written;
    result->tracked = r->tracked;
    result->looked = r->looked;
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
    result->smoothing_out_of_memory = r->smoothing_out_of_memory;
    result->slowest_ms = r->slowest_ms;
    result->mean_ms = r->frames_processed ? r->busy_ms / (double)r->frames_processed : 0;
}

// The take is complete already, and stays so whatever fails here.
static enum status smooth_take(struct recorder *r, const char *name, const struct recorder_options *options,
                               struct recorder_result *result)
{
    if (!r->tracked || !r->smoother)
        return OK;
    const struct sensor_pose *sensor = follower_sensor_pose(r->follower);
    if (sensor && sensor_pose_far_moves(sensor))
        return OK;
    int64_t begun = clock_now_ns();
    enum status status = take_smooth(r->smoother, follower_tracker(r->follower), r->writer, name, options);
    if (status == ERR_MEMORY) {
        result->smoothing_out_of_memory = true;
        return OK;
    }
    if (status == OK)
        result->smoothing_ms = (double)(clock_now_ns() - begun) / 1e6 / (double)r->written;
    return status == NOTHING ? OK : status;
}

// Runs the workers beside read_all. Of several failures the likeliest cause is returned: writing, then processing, then
// looking, then the sensor.
static enum status run_threads(struct recorder *r, struct source *source, const struct recorder_options *options,
                               struct recorder_result *result)
{
    struct worker_thread looking, processing, writing;
    worker_thread_open(&looking);
    worker_thread_open(&processing);
    worker_thread_open(&writing);
    enum status status = worker_thread_start(&processing, process_all, r, "to track the person on");
    if (status == OK)
        status = worker_thread_start(&writing, write_all, r, "to write the recording on");
    if (status == OK && r->to_look)
        status = worker_thread_start(&looking, look_at_all, r, "to look for body points on");
    if (status == OK)
        status = read_all(r, source, options, result);
    if (r->to_look)
        queue_stop(r->to_look);
    worker_thread_close(&looking);
    queue_stop(r->to_process);
    worker_thread_close(&processing);
    queue_stop(r->to_write);
    worker_thread_close(&writing);
    if (r->write_failure.status != OK)
        return failure_restore(&r->write_failure);
    if (r->process_failure.status != OK)
        return failure_restore(&r->process_failure);
    if (r->look_failure.status != OK)
        return failure_restore(&r->look_failure);
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
