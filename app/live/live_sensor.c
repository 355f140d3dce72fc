#include "app/live/live_sensor.h"

#include "app/camera/mailbox.h"
#include "base/clock.h"
#include "base/condition.h"
#include "recording/depth_picture.h"
#include "platform/sensors/source.h"

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { SENSOR_SLOTS = 4 };  // one waits, one is drawn, one is filled, one is being exchanged
enum { MOST_LEFT_OUT = 4 }; // frames of a film in a row, however slow the machine

static const int64_t RETRY_NS = 1000000000;

struct sensor_slot {
    struct live_frame frame;
    uint8_t *rgb, *mask;
    uint16_t *depth;
    struct sensor_slot *next_free;
};

struct live_sensor {
    struct live_sensor_options options; // .sensor is a copy
    char *uri;
    struct sensor_slot slots[SENSOR_SLOTS];
    struct mailbox *judged;
    struct sensor_slot *shown; // by the drawing thread
    pthread_t thread;
    bool runs;

    // used by the sensor's thread only
    struct source *source;
    struct live_tracker *tracker;
    int attempt;                                 // being collected; 0: none yet
    bool collecting;                             // the wish's run, as of the last frame
    bool keeping;                                // the keeper gets the attempt's frames
    int left_out;                                // frames of a film in a row
    int without_color;                           // frames in a row that brought no colour image
    bool at_start;                               // a film has delivered nothing but its first frame
    int64_t began_ns, first_ns, due_ns, late_ns; // of a film: clock and film time of its start; when a frame is due

    pthread_mutex_t lock; // protects the fields below
    pthread_cond_t changed;
    struct sensor_slot *free_slots;
    struct live_sensor_state state;
    struct live_wish wish;
    struct joint_samples samples; // of samples_attempt
    int samples_attempt;
    bool samples_cut; // there was no memory for more of them
    bool suspended, closing;
};

static void notify(struct live_sensor *s)
{
    if (s->options.notify)
        s->options.notify(s->options.notify_self);
}

static bool must_stop(struct live_sensor *s)
{
    pthread_mutex_lock(&s->lock);
    const bool stop = s->closing || s->suspended;
    pthread_mutex_unlock(&s->lock);
    return stop;
}

static struct live_wish wish_now(struct live_sensor *s)
{
    pthread_mutex_lock(&s->lock);
    const struct live_wish wish = s->wish;
    pthread_mutex_unlock(&s->lock);
    return wish;
}

static void report(struct live_sensor *s, const char *sentence)
{
    pthread_mutex_lock(&s->lock);
    const bool same = !strcmp(s->state.trouble, sentence);
    snprintf(s->state.trouble, sizeof s->state.trouble, "%s", sentence);
    if (*sentence)
        s->state.seeing = false;
    pthread_mutex_unlock(&s->lock);
    if (!same)
        notify(s);
}

// ---------------------------------------------------------------- slots

static struct sensor_slot *acquire(struct live_sensor *s)
{
    pthread_mutex_lock(&s->lock);
    struct sensor_slot *slot = s->free_slots;
    assert(slot); // SENSOR_SLOTS suffices for both threads
    s->free_slots = slot->next_free;
    pthread_mutex_unlock(&s->lock);
    return slot;
}

static void release(struct live_sensor *s, struct sensor_slot *slot)
{
    if (!slot)
        return;
    pthread_mutex_lock(&s->lock);
    slot->next_free = s->free_slots;
    s->free_slots = slot;
    pthread_mutex_unlock(&s->lock);
}

// drawn: there is no colour; the picture is drawn once the person's mask is there.
static enum status fill(struct sensor_slot *slot, const struct frame *frame, const struct calibration *c, bool drawn)
{
    const size_t color = lens_pixels(&c->color), depth = lens_pixels(&c->depth);
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
    f->calibration = *c;
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

static void begin_collecting(struct live_sensor *s, const struct live_wish *wish)
{
    s->attempt = wish->attempt;
    live_tracker_restart_judge(s->tracker);
    pthread_mutex_lock(&s->lock);
    joint_samples_free(&s->samples);
    s->samples_attempt = wish->attempt;
    s->samples_cut = false;
    pthread_mutex_unlock(&s->lock);
    s->keeping = s->options.keeper;
    if (s->keeping)
        live_keeper_begin(s->options.keeper, source_calibration(s->source), wish->attempt);
}

// Also where the sensor fails meanwhile: it may come back with another clock, or be another one with larger images.
static void end_keeping(struct live_sensor *s)
{
    if (s->keeping)
        live_keeper_end(s->options.keeper);
    s->keeping = false;
}

static void collect(struct live_sensor *s, const struct frame *frame, const struct sensor_slot *slot)
{
    const struct live_look *look = &slot->frame.look;
    pthread_mutex_lock(&s->lock);
    struct joint_samples *to = &s->samples;
    const bool room = !to->count || look->sample.time_ns - to->at[0].time_ns < ATTEMPT_MOST_S * INT64_C(1000000000);
    if (look->person && room && s->samples_attempt == s->attempt && !s->samples_cut)
        s->samples_cut = joint_samples_add(to, &look->sample) != OK;
    pthread_mutex_unlock(&s->lock);
    if (!s->keeping)
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
    live_keeper_add(s->options.keeper, &kept);
}

enum status live_sensor_take_samples(struct live_sensor *s, int attempt, struct joint_samples *out)
{
    bool cut = false;
    *out = (struct joint_samples){0};
    pthread_mutex_lock(&s->lock);
    if (s->samples_attempt == attempt) {
        *out = s->samples;
        cut = s->samples_cut;
        s->samples = (struct joint_samples){0};
        s->samples_attempt = 0; // what comes after its end is not collected
    }
    pthread_mutex_unlock(&s->lock);
    joint_samples_start_at_zero(out);
    if (cut)
        return fail(ERR_MEMORY, "No memory for the whole attempt: it is judged as far as %.0f s",
                    out->count ? (double)out->at[out->count - 1].time_ns * 1e-9 : 0);
    return out->count ? OK : NOTHING;
}

// ---------------------------------------------------------------- one frame

static void publish(struct live_sensor *s, struct sensor_slot *slot)
{
    struct live_frame *f = &slot->frame;
    pthread_mutex_lock(&s->lock);
    f->number = ++s->state.received;
    f->tracked_ns = clock_now_ns();
    s->state.received_ns = f->received_ns;
    s->state.track_ms += f->look.track_ms;
    s->state.judge_ms += f->look.judge_ms;
    s->state.seeing = true;
    s->state.ended = false;
    s->state.trouble[0] = 0;
    pthread_mutex_unlock(&s->lock);
    struct sensor_slot *late = mailbox_put(s->judged, slot);
    if (late) {
        pthread_mutex_lock(&s->lock);
        s->state.dropped++;
        pthread_mutex_unlock(&s->lock);
        release(s, late);
    }
    notify(s);
}

static void follow_wish(struct live_sensor *s, const struct live_wish *wish)
{
    const bool begins = wish->run && wish->attempt != s->attempt;
    if (begins)
        begin_collecting(s, wish);
    if (s->collecting && !wish->run)
        end_keeping(s);
    s->collecting = wish->run;
    live_tracker_hold_world(s->tracker, wish->run && !begins); // in a loop one attempt follows the other
    if (wish->shown.end > wish->shown.first)
        live_tracker_show(s->tracker, &wish->shown);
}

static void note_points(struct live_sensor *s)
{
    const struct follower_points points = live_tracker_query_points(s->tracker);
    pthread_mutex_lock(&s->lock);
    s->state.looked = points.looked;
    memcpy(s->state.no_body_points, points.why_not, sizeof s->state.no_body_points);
    pthread_mutex_unlock(&s->lock);
}

static enum status process(struct live_sensor *s, const struct frame *frame, int64_t received_ns)
{
    const struct live_wish wish = wish_now(s);
    struct sensor_slot *slot = acquire(s);
    struct live_frame *f = &slot->frame;
    follow_wish(s, &wish);
    note_points(s);
    struct calibration calibration = *source_calibration(s->source);
    s->without_color = frames_without_color(s->without_color, frame->color);
    if (s->without_color == DEPTH_PICTURE_AFTER && calibration.registered)
        calibration.color = (struct lens){0}; // it has failed
    const bool drawn = depth_picture_replaces_color(&calibration);
    enum status status = fill(slot, frame, &calibration, drawn);
    if (status == OK)
        status = live_tracker_next(s->tracker, frame->time_ns, frame->color, f->depth, slot->mask, &f->look);
    if (status != OK) {
        release(s, slot);
        return status;
    }
    if (drawn)
        depth_picture_draw(&calibration.depth, f->depth, slot->mask, slot->rgb);
    f->received_ns = received_ns;
    f->attempt = wish.attempt;
    if (wish.run)
        collect(s, frame, slot);
    publish(s, slot);
    return OK;
}

// ---------------------------------------------------------------- films

// Blocks until that time, the wish changes (where `wish` is given), or the thread must stop.
static void wait_for(struct live_sensor *s, int64_t when_ns, const struct live_wish *wish)
{
    pthread_mutex_lock(&s->lock);
    while (!s->closing && !s->suspended && !(wish && (s->wish.run != wish->run || s->wish.attempt != wish->attempt)) &&
           condition_wait_until_ns(&s->changed, &s->lock, when_ns))
        continue;
    pthread_mutex_unlock(&s->lock);
}

// Back to the first frame. As if another person came in.
static enum status rewind_film(struct live_sensor *s)
{
    source_close(&s->source);
    enum status status = source_open(&s->source, s->uri, SOURCE_SENSOR);
    if (status == OK)
        live_tracker_reset(s->tracker);
    s->at_start = true;
    s->first_ns = s->began_ns = s->due_ns = 0;
    return status;
}

// Holds a film at its start until it is to run, and paces it. True: this frame comes too late and is left out.
static bool pace_film(struct live_sensor *s, const struct frame *frame)
{
    if (!s->first_ns)
        s->first_ns = frame->time_ns;
    if (frame->time_ns == s->first_ns) // the first is shown immediately
        return false;
    for (struct live_wish wish = wish_now(s); s->at_start && !wish.run && !must_stop(s); wish = wish_now(s))
        wait_for(s, clock_now_ns() + RETRY_NS, &wish);
    if (s->at_start) {
        s->at_start = false;
        s->began_ns = clock_now_ns();
        s->late_ns = 0;
    }
    const int64_t before_ns = s->due_ns, now_ns = clock_now_ns();
    s->due_ns = s->began_ns + frame->time_ns - s->first_ns + s->late_ns;
    const int64_t interval_ns = before_ns ? s->due_ns - before_ns : 0;
    if (now_ns > s->due_ns + interval_ns && s->options.every_frame)
        s->late_ns += now_ns - s->due_ns; // the film slows down instead
    if (now_ns > s->due_ns + interval_ns && interval_ns && !s->options.every_frame && s->left_out < MOST_LEFT_OUT) {
        s->left_out++;
        pthread_mutex_lock(&s->lock);
        s->state.dropped++;
        pthread_mutex_unlock(&s->lock);
        return true;
    }
    s->left_out = 0;
    wait_for(s, s->due_ns, NULL);
    return false;
}

// A film starts again when another attempt begins, or none is made any more.
static bool must_rewind(struct live_sensor *s)
{
    const struct live_wish wish = wish_now(s);
    return !s->at_start && (!wish.run || wish.attempt != s->attempt);
}

static void wait_at_end(struct live_sensor *s)
{
    pthread_mutex_lock(&s->lock);
    s->state.ended = true;
    pthread_mutex_unlock(&s->lock);
    notify(s);
    while (!must_stop(s) && !must_rewind(s)) {
        const struct live_wish wish = wish_now(s);
        wait_for(s, clock_now_ns() + RETRY_NS, &wish);
    }
}

// ---------------------------------------------------------------- the thread

static enum status open_sensor(struct live_sensor *s)
{
    enum status status = source_open(&s->source, s->uri, SOURCE_SENSOR);
    s->without_color = 0;
    if (status != OK)
        return status;
    const struct live_tracker_options how = {.calibration = source_calibration(s->source),
                                             .place = s->options.place,
                                             .reference = s->options.reference,
                                             .mirrored = s->options.mirrored,
                                             .finds_points = !s->options.no_body_points};
    pthread_mutex_lock(&s->lock);
    s->state.film = !source_is_live(s->source);
    pthread_mutex_unlock(&s->lock);
    s->at_start = true;
    s->first_ns = s->began_ns = s->due_ns = 0;
    return live_tracker_open(&s->tracker, &how);
}

// Until the sensor fails, ends (a live one: ERR_DEVICE), or the thread must stop.
static enum status run_sensor(struct live_sensor *s)
{
    const bool film = !source_is_live(s->source);
    while (!must_stop(s)) {
        if (film && must_rewind(s)) {
            enum status status = rewind_film(s);
            if (status != OK)
                return status;
        }
        struct frame frame;
        enum status status = source_next(s->source, &frame);
        if (status == ERR_INPUT || (status == OK && !frame.depth))
            continue; // one damaged image
        if (status == NOTHING && film) {
            wait_at_end(s);
            continue;
        }
        if (status != OK)
            return status == NOTHING ? fail(ERR_DEVICE, "the sensor has stopped") : status;
        if (film && pace_film(s, &frame))
            continue;
        status = process(s, &frame, clock_now_ns());
        if (status != OK)
            return status;
    }
    return OK;
}

static void *sensor_thread(void *self)
{
    struct live_sensor *s = self;
    for (;;) {
        pthread_mutex_lock(&s->lock);
        while (s->suspended && !s->closing)
            pthread_cond_wait(&s->changed, &s->lock);
        const bool closing = s->closing;
        pthread_mutex_unlock(&s->lock);
        if (closing)
            return NULL;
        enum status status = open_sensor(s);
        if (status == OK)
            status = run_sensor(s);
        if (status != OK)
            report(s, status_message());
        end_keeping(s);
        live_tracker_close(&s->tracker);
        source_close(&s->source);
        if (status != OK)
            wait_for(s, clock_now_ns() + RETRY_NS, NULL);
    }
}

// ---------------------------------------------------------------- for the drawing thread

enum status live_sensor_open(struct live_sensor **out, const struct live_sensor_options *options)
{
    *out = NULL;
    struct live_sensor *s = calloc(1, sizeof *s);
    if (!s)
        return fail(ERR_MEMORY, "no memory for the sensor");
    pthread_mutex_init(&s->lock, NULL);
    condition_open(&s->changed);
    s->options = *options;
    s->options.sensor = s->uri = strdup(options->sensor);
    for (int i = 0; i < SENSOR_SLOTS; i++) {
        s->slots[i].next_free = s->free_slots;
        s->free_slots = &s->slots[i];
    }
    enum status status = s->uri ? mailbox_open(&s->judged) : fail(ERR_MEMORY, "no memory for the sensor");
    if (status == OK && pthread_create(&s->thread, NULL, sensor_thread, s))
        status = fail(ERR_MEMORY, "no thread for the sensor");
    s->runs = status == OK;
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
    pthread_mutex_lock(&s->lock);
    s->closing = true;
    pthread_cond_broadcast(&s->changed);
    pthread_mutex_unlock(&s->lock);
    if (s->runs)
        pthread_join(s->thread, NULL);
    mailbox_close(&s->judged);
    for (int i = 0; i < SENSOR_SLOTS; i++) {
        free(s->slots[i].rgb);
        free(s->slots[i].depth);
        free(s->slots[i].mask);
    }
    joint_samples_free(&s->samples);
    pthread_cond_destroy(&s->changed);
    pthread_mutex_destroy(&s->lock);
    free(s->uri);
    free(s);
    *out = NULL;
}

const struct live_frame *live_sensor_latest(struct live_sensor *s)
{
    struct sensor_slot *newest = mailbox_take(s->judged, false);
    if (newest) {
        release(s, s->shown);
        s->shown = newest;
    }
    return s->shown ? &s->shown->frame : NULL;
}

void live_sensor_wish(struct live_sensor *s, const struct live_wish *wish)
{
    pthread_mutex_lock(&s->lock);
    s->wish = *wish;
    pthread_cond_broadcast(&s->changed);
    pthread_mutex_unlock(&s->lock);
}

struct live_sensor_state live_sensor_query(struct live_sensor *s)
{
    pthread_mutex_lock(&s->lock);
    const struct live_sensor_state state = s->state;
    pthread_mutex_unlock(&s->lock);
    return state;
}

void live_sensor_suspend(struct live_sensor *s, bool suspend)
{
    pthread_mutex_lock(&s->lock);
    s->suspended = suspend;
    s->state.seeing = s->state.seeing && !suspend;
    pthread_cond_broadcast(&s->changed);
    pthread_mutex_unlock(&s->lock);
}
