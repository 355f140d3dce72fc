#include "app/live/live_sensor.h"

#include "app/camera/camera_feed.h"
#include "base/clock.h"
#include "platform/sensors/source.h"
#include "recording/depth_picture.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { SENSOR_SLOTS = 4 }; // one waits, one is drawn, one is filled, one is being exchanged
enum { MAX_LEFT_OUT = 4 }; // frames of a film in a row, however slow the machine

struct sensor_slot {
    struct live_frame frame;
    uint8_t *rgb, *mask;
    uint16_t *depth;
    struct sensor_slot *next_free;
};

struct live_sensor {
    struct live_sensor_options options; // .sensor is the caller's no longer
    struct sensor_slot slots[SENSOR_SLOTS];
    struct mailbox *judged;
    struct sensor_slot *shown;   // by the drawing thread
    struct source_player player; // on the sensor's thread

    // used by the sensor's thread only
    struct live_tracker *tracker;
    int attempt;       // being collected; 0: none yet
    bool collecting;   // the wish's run, as of the last frame
    bool keeping;      // the keeper gets the attempt's frames
    int left_out;      // frames of a film in a row
    int without_color; // frames in a row that brought no colour image
    bool first;        // the next frame is a film's first
    bool at_start;     // a film has delivered nothing but its first frame

    // Under the player's lock:
    struct sensor_slot *free_slots;
    struct live_sensor_state state;
    struct live_wish wish;
    struct joint_samples samples; // of samples_attempt
    int samples_attempt;
    bool samples_cut; // there was no memory for more of them
};

static void notify(struct live_sensor *sensor)
{
    if (sensor->options.notify)
        sensor->options.notify(sensor->options.notify_self);
}

static struct live_wish wish_now(struct live_sensor *sensor)
{
    pthread_mutex_lock(&sensor->player.worker.lock);
    const struct live_wish wish = sensor->wish;
    pthread_mutex_unlock(&sensor->player.worker.lock);
    return wish;
}

static void report(struct live_sensor *sensor, const char *sentence)
{
    pthread_mutex_lock(&sensor->player.worker.lock);
    const bool same = !strcmp(sensor->state.trouble, sentence);
    snprintf(sensor->state.trouble, sizeof sensor->state.trouble, "%s", sentence);
    if (*sentence)
        sensor->state.seeing = false;
    pthread_mutex_unlock(&sensor->player.worker.lock);
    if (!same)
        notify(sensor);
}

// ---------------------------------------------------------------- slots

static struct sensor_slot *acquire(struct live_sensor *sensor)
{
    pthread_mutex_lock(&sensor->player.worker.lock);
    struct sensor_slot *slot = sensor->free_slots;
    assert(slot); // SENSOR_SLOTS suffices for both threads
    sensor->free_slots = slot->next_free;
    pthread_mutex_unlock(&sensor->player.worker.lock);
    return slot;
}

static void release(struct live_sensor *sensor, struct sensor_slot *slot)
{
    if (!slot)
        return;
    pthread_mutex_lock(&sensor->player.worker.lock);
    slot->next_free = sensor->free_slots;
    sensor->free_slots = slot;
    pthread_mutex_unlock(&sensor->player.worker.lock);
}

// drawn: there is no colour; the picture is drawn once the person's mask is there.
static enum status fill(struct sensor_slot *slot, const struct frame *frame, const struct calibration *calibration,
                        bool drawn)
{
    const size_t color = lens_pixels(&calibration->color), depth = lens_pixels(&calibration->depth);
    struct live_frame *f = &slot->frame;
    const bool allocated = slot->rgb && slot->depth && slot->mask;
    if (color != lens_pixels(&f->calibration.color) || depth != lens_pixels(&f->calibration.depth) || !allocated) {
        free(slot->rgb);
        free(slot->depth);
        free(slot->mask);
        slot->rgb = malloc(3 * color + 1);
        slot->depth = malloc(sizeof *slot->depth * depth);
        slot->mask = malloc(depth);
    }
    f->calibration = *calibration;
    if (!slot->rgb || !slot->depth || !slot->mask)
        return fail(ERR_MEMORY, "no memory for the sensor's frame");
    f->rgb = frame->color || drawn ? slot->rgb : NULL;
    f->depth = slot->depth;
    f->mask = slot->mask;
    if (frame->color)
        memcpy(slot->rgb, frame->color, 3 * color);
    memcpy(slot->depth, frame->depth, sizeof *slot->depth * depth);
    return OK;
}

// ---------------------------------------------------------------- an attempt's joints

static void begin_collecting(struct live_sensor *sensor, const struct live_wish *wish)
{
    sensor->attempt = wish->attempt;
    live_tracker_restart_judge(sensor->tracker);
    pthread_mutex_lock(&sensor->player.worker.lock);
    joint_samples_free(&sensor->samples);
    sensor->samples_attempt = wish->attempt;
    sensor->samples_cut = false;
    pthread_mutex_unlock(&sensor->player.worker.lock);
    sensor->keeping = sensor->options.keeper;
    if (sensor->keeping)
        live_keeper_begin(sensor->options.keeper, source_calibration(sensor->player.source), wish->attempt);
}

// Also where the sensor fails meanwhile: it may come back with another clock, or be another one with larger images.
static void end_keeping(struct live_sensor *sensor)
{
    if (sensor->keeping)
        live_keeper_end(sensor->options.keeper);
    sensor->keeping = false;
}

static void collect(struct live_sensor *sensor, const struct frame *frame, const struct sensor_slot *slot)
{
    const struct live_look *look = &slot->frame.look;
    pthread_mutex_lock(&sensor->player.worker.lock);
    struct joint_samples *to = &sensor->samples;
    const bool room = !to->count || look->sample.time_ns - to->at[0].time_ns < ATTEMPT_MAX_S * INT64_C(1000000000);
    if (look->person && room && sensor->samples_attempt == sensor->attempt && !sensor->samples_cut) {
        to->sigma_given = true; // the tracker's covariances
        sensor->samples_cut = joint_samples_add(to, &look->sample) != OK;
    }
    pthread_mutex_unlock(&sensor->player.worker.lock);
    if (!sensor->keeping)
        return;
    const struct keeper_frame kept = {.time_ns = frame->time_ns,
                                      .located = look->located,
                                      .world_from_camera = look->place_from_camera,
                                      .color = frame->color,
                                      .jpeg = frame->jpeg,
                                      .jpeg_bytes = frame->jpeg_bytes,
                                      .depth = frame->depth,
                                      .mask = slot->mask,
                                      .skeleton = look->person ? &look->skeleton : NULL};
    live_keeper_add(sensor->options.keeper, &kept);
}

enum status live_sensor_take_samples(struct live_sensor *s, int attempt, struct joint_samples *out)
{
    bool cut = false;
    *out = (struct joint_samples){0};
    pthread_mutex_lock(&s->player.worker.lock);
    if (s->samples_attempt == attempt) {
        *out = s->samples;
        cut = s->samples_cut;
        s->samples = (struct joint_samples){0};
        s->samples_attempt = 0; // what comes after its end is not collected
    }
    pthread_mutex_unlock(&s->player.worker.lock);
    joint_samples_start_at_zero(out);
    if (cut)
        return fail(ERR_MEMORY, "No memory for the whole attempt: it is judged as far as %.0f s",
                    out->count ? (double)out->at[out->count - 1].time_ns * 1e-9 : 0);
    return out->count ? OK : NOTHING;
}

// ---------------------------------------------------------------- one frame

static void publish(struct live_sensor *sensor, struct sensor_slot *slot)
{
    struct live_frame *f = &slot->frame;
    pthread_mutex_lock(&sensor->player.worker.lock);
    f->number = ++sensor->state.received;
    f->tracked_ns = clock_now_ns();
    sensor->state.received_ns = f->received_ns;
    sensor->state.track_ms += f->look.track_ms;
    sensor->state.judge_ms += f->look.judge_ms;
    sensor->state.seeing = true;
    sensor->state.ended = false;
    sensor->state.trouble[0] = 0;
    pthread_mutex_unlock(&sensor->player.worker.lock);
    struct sensor_slot *late = mailbox_put(sensor->judged, slot);
    if (late) {
        pthread_mutex_lock(&sensor->player.worker.lock);
        sensor->state.dropped++;
        pthread_mutex_unlock(&sensor->player.worker.lock);
        release(sensor, late);
    }
    notify(sensor);
}

static void follow_wish(struct live_sensor *sensor, const struct live_wish *wish)
{
    const bool begins = wish->run && wish->attempt != sensor->attempt;
    if (begins)
        begin_collecting(sensor, wish);
    if (sensor->collecting && !wish->run)
        end_keeping(sensor);
    sensor->collecting = wish->run;
    live_tracker_hold_world(sensor->tracker, wish->run && !begins); // in a loop one attempt follows the other
    if (wish->shown.end > wish->shown.first)
        live_tracker_show(sensor->tracker, &wish->shown);
}

static void note_points(struct live_sensor *sensor)
{
    const struct follower_points points = live_tracker_query_points(sensor->tracker);
    pthread_mutex_lock(&sensor->player.worker.lock);
    sensor->state.looked = points.looked;
    memcpy(sensor->state.no_body_points, points.why_not, sizeof sensor->state.no_body_points);
    pthread_mutex_unlock(&sensor->player.worker.lock);
}

static enum status process(struct live_sensor *sensor, const struct frame *frame, int64_t received_ns)
{
    const struct live_wish wish = wish_now(sensor);
    struct sensor_slot *slot = acquire(sensor);
    struct live_frame *f = &slot->frame;
    follow_wish(sensor, &wish);
    note_points(sensor);
    struct calibration calibration = *source_calibration(sensor->player.source);
    sensor->without_color = frames_without_color(sensor->without_color, frame->color);
    if (sensor->without_color == DEPTH_PICTURE_AFTER && calibration.registered)
        calibration.color = (struct lens){0}; // it has failed
    const bool drawn = depth_picture_replaces_color(&calibration);
    enum status status = fill(slot, frame, &calibration, drawn);
    if (status == OK)
        status = live_tracker_next(sensor->tracker, frame->time_ns, frame->color, f->depth, slot->mask, &f->look);
    if (status != OK) {
        release(sensor, slot);
        return status;
    }
    if (drawn)
        depth_picture_draw(&calibration.depth, f->depth, slot->mask, slot->rgb);
    f->received_ns = received_ns;
    f->attempt = wish.attempt;
    if (wish.run)
        collect(sensor, frame, slot);
    publish(sensor, slot);
    return OK;
}

// ---------------------------------------------------------------- films

// Blocks until there is another wish, or the thread must stop.
static void wait_for_wish(struct live_sensor *sensor, const struct live_wish *wish)
{
    struct worker_thread *worker = &sensor->player.worker;
    pthread_mutex_lock(&worker->lock);
    while (!worker->closing && !sensor->player.suspended && sensor->wish.run == wish->run &&
           sensor->wish.attempt == wish->attempt)
        pthread_cond_wait(&worker->changed, &worker->lock);
    pthread_mutex_unlock(&worker->lock);
}

// Back to the first frame. As if another person came in.
static enum status rewind_film(struct live_sensor *sensor)
{
    enum status status = source_player_open_source(&sensor->player);
    if (status == OK)
        live_tracker_reset(sensor->tracker);
    sensor->first = sensor->at_start = true;
    return status;
}

// Holds a film at its start until it is to run, and paces it. True: this frame comes too late and is left out.
static bool pace_film(struct live_sensor *sensor)
{
    struct source_player *player = &sensor->player;
    const bool first = sensor->first;
    sensor->first = false;
    if (first) // is shown immediately
        return false;
    for (struct live_wish wish = wish_now(sensor); sensor->at_start && !wish.run && !source_player_must_stop(player);
         wish = wish_now(sensor))
        wait_for_wish(sensor, &wish);
    if (sensor->at_start) {
        sensor->at_start = false;
        source_player_begin(player);
    }
    const int64_t late_ns = clock_now_ns() - player->due_ns;
    const bool too_late = late_ns > player->interval_ns;
    if (too_late && sensor->options.every_frame)
        source_player_delay(player, late_ns); // the film slows down instead
    if (too_late && player->interval_ns && !sensor->options.every_frame && sensor->left_out < MAX_LEFT_OUT) {
        sensor->left_out++;
        pthread_mutex_lock(&player->worker.lock);
        sensor->state.dropped++;
        pthread_mutex_unlock(&player->worker.lock);
        return true;
    }
    sensor->left_out = 0;
    source_player_wait_for_frame(player);
    return false;
}

// A film starts again when another attempt begins, or none is made any more.
static bool must_rewind(const struct live_sensor *sensor, const struct live_wish *wish)
{
    return !sensor->at_start && (!wish->run || wish->attempt != sensor->attempt);
}

static void wait_at_end(struct live_sensor *sensor)
{
    pthread_mutex_lock(&sensor->player.worker.lock);
    sensor->state.ended = true;
    pthread_mutex_unlock(&sensor->player.worker.lock);
    notify(sensor);
    for (struct live_wish wish = wish_now(sensor);
         !source_player_must_stop(&sensor->player) && !must_rewind(sensor, &wish); wish = wish_now(sensor))
        wait_for_wish(sensor, &wish);
}

// ---------------------------------------------------------------- the thread

static enum status open_sensor(struct live_sensor *sensor)
{
    enum status status = source_player_open_source(&sensor->player);
    sensor->without_color = 0;
    if (status != OK)
        return status;
    const struct live_tracker_options options = {.calibration = source_calibration(sensor->player.source),
                                                 .place = sensor->options.place,
                                                 .reference = sensor->options.reference,
                                                 .mirrored = sensor->options.mirrored,
                                                 .finds_points = !sensor->options.no_body_points};
    pthread_mutex_lock(&sensor->player.worker.lock);
    sensor->state.film = sensor->player.film;
    pthread_mutex_unlock(&sensor->player.worker.lock);
    sensor->first = sensor->at_start = true;
    return live_tracker_open(&sensor->tracker, &options);
}

// Until the sensor fails or ends (ERR_DEVICE), or the thread must stop.
static enum status run_sensor(struct live_sensor *sensor)
{
    while (!source_player_must_stop(&sensor->player)) {
        struct frame frame;
        const struct live_wish wish = wish_now(sensor);
        enum status status = sensor->player.film && must_rewind(sensor, &wish) ? rewind_film(sensor) : OK;
        if (status != OK)
            return status;
        status = source_player_next(&sensor->player, &frame);
        if (status == ERR_INPUT || (status == OK && !frame.depth))
            continue; // one damaged image
        if (status == NOTHING) {
            wait_at_end(sensor);
            continue;
        }
        if (status != OK)
            return status;
        if (sensor->player.film && pace_film(sensor))
            continue;
        status = process(sensor, &frame, clock_now_ns());
        if (status != OK)
            return status;
    }
    return OK;
}

static void *play_sensor(void *self)
{
    struct live_sensor *s = self;
    while (source_player_wait_to_play(&s->player)) {
        enum status status = open_sensor(s);
        if (status == OK)
            status = run_sensor(s);
        if (status != OK)
            report(s, status_message());
        end_keeping(s);
        live_tracker_close(&s->tracker);
        source_player_close_source(&s->player);
        if (status != OK)
            source_player_wait_to_retry(&s->player);
    }
    return NULL;
}

// ---------------------------------------------------------------- for the drawing thread

enum status live_sensor_open(struct live_sensor **out, const struct live_sensor_options *options)
{
    *out = NULL;
    struct live_sensor *s = calloc(1, sizeof *s);
    if (!s)
        return fail(ERR_MEMORY, "no memory for the sensor");
    s->options = *options;
    enum status status = source_player_open(&s->player, options->sensor, SOURCE_SENSOR);
    for (int i = 0; i < SENSOR_SLOTS; i++) {
        s->slots[i].next_free = s->free_slots;
        s->free_slots = &s->slots[i];
    }
    if (status == OK)
        status = mailbox_open(&s->judged);
    if (status == OK)
        status = worker_thread_start(&s->player.worker, play_sensor, s, "for the sensor");
    *out = s;
    if (status != OK)
        live_sensor_close(out);
    return status;
}

void live_sensor_close(struct live_sensor **out)
{
    struct live_sensor *s = *out;
    if (!s)
        return;
    worker_thread_stop(&s->player.worker);
    mailbox_close(&s->judged);
    for (int i = 0; i < SENSOR_SLOTS; i++) {
        free(s->slots[i].rgb);
        free(s->slots[i].depth);
        free(s->slots[i].mask);
    }
    joint_samples_free(&s->samples);
    source_player_close(&s->player);
    free(s);
    *out = NULL;
}

const struct live_frame *live_sensor_latest(struct live_sensor *sensor)
{
    struct sensor_slot *newest = mailbox_take(sensor->judged, false);
    if (newest) {
        release(sensor, sensor->shown);
        sensor->shown = newest;
    }
    return sensor->shown ? &sensor->shown->frame : NULL;
}

void live_sensor_wish(struct live_sensor *sensor, const struct live_wish *wish)
{
    pthread_mutex_lock(&sensor->player.worker.lock);
    sensor->wish = *wish;
    pthread_cond_broadcast(&sensor->player.worker.changed);
    pthread_mutex_unlock(&sensor->player.worker.lock);
}

struct live_sensor_state live_sensor_query(struct live_sensor *sensor)
{
    pthread_mutex_lock(&sensor->player.worker.lock);
    const struct live_sensor_state state = sensor->state;
    pthread_mutex_unlock(&sensor->player.worker.lock);
    return state;
}

void live_sensor_suspend(struct live_sensor *sensor, bool suspend)
{
    pthread_mutex_lock(&sensor->player.worker.lock);
    sensor->state.seeing = sensor->state.seeing && !suspend;
    pthread_mutex_unlock(&sensor->player.worker.lock);
    source_player_suspend(&sensor->player, suspend);
}
