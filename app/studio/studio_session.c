#include "app/studio/studio_session.h"

#include "app/studio/studio_state.h"
#include "base/clock.h"
#include "base/status.h"
#include "capture/coaching/raised_hand.h"
#include "capture/follow.h"
#include "capture/mapping/map_advice.h"
#include "capture/recorder.h"
#include "platform/files/file.h"
#include "platform/sensors/source.h"
#include "recording/depth_picture.h"
#include "recording/recording.h"

#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- a snapshot's buffers

void studio_snapshot_free(struct studio_snapshot *snapshot)
{
    free(snapshot->color);
    free(snapshot->mask);
    free(snapshot->depth);
    *snapshot = (struct studio_snapshot){0};
}

// Buffers for pictures of these lenses. False: no memory, there are none.
static bool studio_snapshot_size(struct studio_snapshot *snapshot, const struct calibration *calibration)
{
    const size_t color = 3 * (size_t)calibration->color.width * (size_t)calibration->color.height,
                 depth = (size_t)calibration->depth.width * (size_t)calibration->depth.height;
    if (snapshot->color_bytes == color && snapshot->depth_pixels == depth)
        return true;
    free(snapshot->color);
    free(snapshot->mask);
    free(snapshot->depth);
    snapshot->color = malloc(color + 1);
    snapshot->mask = calloc(depth + 1, 1);
    snapshot->depth = calloc(depth + 1, sizeof *snapshot->depth);
    snapshot->color_bytes = color;
    snapshot->depth_pixels = depth;
    if (snapshot->color && snapshot->mask && snapshot->depth)
        return true;
    snapshot->color_bytes = snapshot->depth_pixels = 0;
    return false;
}

static bool same_size(const struct lens *a, const struct lens *b)
{
    return a->width == b->width && a->height == b->height;
}

void studio_snapshot_calibrate(struct studio_snapshot *snapshot, const struct calibration *calibration)
{
    snapshot->without_color = 0;
    snapshot->has_color = snapshot->has_color && same_size(&snapshot->calibration.color, &calibration->color);
    snapshot->has_depth = snapshot->has_depth && same_size(&snapshot->calibration.depth, &calibration->depth);
    snapshot->calibration = *calibration;
}

void studio_snapshot_pictures(struct studio_snapshot *snapshot, const uint8_t *color, const uint16_t *depth,
                              const uint8_t *mask)
{
    if (!studio_snapshot_size(snapshot, &snapshot->calibration))
        return;
    snapshot->has_color = color != NULL;
    snapshot->without_color = frames_without_color(snapshot->without_color, color);
    snapshot->has_depth = depth != NULL;
    if (color)
        memcpy(snapshot->color, color, snapshot->color_bytes);
    if (depth)
        memcpy(snapshot->depth, depth, snapshot->depth_pixels * sizeof *snapshot->depth);
    if (mask)
        memcpy(snapshot->mask, mask, snapshot->depth_pixels);
    else
        memset(snapshot->mask, 0, snapshot->depth_pixels);
}

bool studio_snapshot_sees_color(const struct studio_snapshot *snapshot)
{
    return snapshot->calibration.color.width > 0 &&
           (snapshot->without_color < DEPTH_PICTURE_AFTER || !snapshot->calibration.depth.width);
}

bool studio_snapshot_copy(const struct studio_snapshot *from, struct studio_snapshot *out)
{
    const bool fresh = from->number != out->number || from->doing != out->doing ||
                       from->takes_ready != out->takes_ready || from->judged != out->judged ||
                       from->room.ready != out->room.ready || from->room.not_kept != out->room.not_kept;
    if (!fresh || !studio_snapshot_size(out, &from->calibration))
        return false;
    const struct studio_snapshot kept = *out;
    *out = *from;
    out->color = kept.color;
    out->mask = kept.mask;
    out->depth = kept.depth;
    out->color_bytes = kept.color_bytes;
    out->depth_pixels = kept.depth_pixels;
    if (from->has_color)
        memcpy(out->color, from->color, from->color_bytes);
    if (from->has_depth) {
        memcpy(out->depth, from->depth, from->depth_pixels * sizeof *out->depth);
        memcpy(out->mask, from->mask, from->depth_pixels);
    }
    return true;
}

// ---------------------------------------------------------------- wishes

// The name of a take for which something is wanted, handed from the window's thread to the session's.
struct studio_wish {
    pthread_mutex_t lock;
    char take[256]; // "": none
};

static void open_wish(struct studio_wish *wish)
{
    *wish->take = 0;
    pthread_mutex_init(&wish->lock, NULL);
}

static void close_wish(struct studio_wish *wish) { pthread_mutex_destroy(&wish->lock); }

static void put_wish(struct studio_wish *wish, const char *take)
{
    pthread_mutex_lock(&wish->lock);
    snprintf(wish->take, sizeof wish->take, "%s", take);
    pthread_mutex_unlock(&wish->lock);
}

static bool wish_waits(struct studio_wish *wish)
{
    pthread_mutex_lock(&wish->lock);
    const bool waits = *wish->take != 0;
    pthread_mutex_unlock(&wish->lock);
    return waits;
}

// And there is none any more; false: there was none.
static bool take_wish(struct studio_wish *wish, char take[256])
{
    pthread_mutex_lock(&wish->lock);
    memcpy(take, wish->take, sizeof wish->take);
    *wish->take = 0;
    pthread_mutex_unlock(&wish->lock);
    return *take != 0;
}

// ---------------------------------------------------------------- a sweep

// The room swept in the studio: frames into the mapper until the sweep ends, then the map. On the session's thread.
enum studio_sweep_end { STUDIO_SWEEP_ON, STUDIO_SWEEP_END, STUDIO_SWEEP_DROP };

struct studio_sweep_wish {
    struct source *source;
    const char *tags;          // tags.json; NULL: by landmarks and depth
    const struct place *prior; // that the sweep adds to; NULL: a new place
    atomic_int *end;           // enum studio_sweep_end
    void (*show)(void *self, const struct frame *frame, const struct sweep_plan *plan);
    void (*finishing)(void *self); // the map is computed now: some seconds
    void *self;
};

struct studio_room {
    struct place place;
    struct sweep_plan plan; // of the finished place
    struct map_advice advice;
    bool cut; // the sensor failed; the map is of what was swept until then
};

static void free_room(struct studio_room *room)
{
    place_free(&room->place);
    *room = (struct studio_room){0};
}

// The list of tags beside the file, if there is one: out gets the path. False: none.
static bool find_tags(const char *file, char *out, size_t capacity)
{
    const char *slash = strrchr(file, '/');
    const int folder = slash ? (int)(slash - file) + 1 : 0;
    if (snprintf(out, capacity, "%.*stags.json", folder, file) >= (int)capacity)
        return false;
    return file_exists(out);
}

// Until the source or the sweep ends. A sensor that fails ends it, too, with what there is by then.
static enum status feed(const struct studio_sweep_wish *wish, struct mapper *mapper, struct sweep_trouble *trouble)
{
    for (bool any = false;; any = true) {
        struct frame frame;
        if (atomic_load(wish->end) == STUDIO_SWEEP_DROP)
            return NOTHING;
        if (atomic_load(wish->end) == STUDIO_SWEEP_END)
            return OK;
        enum status status = source_next(wish->source, &frame);
        if (status == NOTHING)
            return OK;
        if (status == ERR_INPUT) {
            trouble->damaged++;
            continue;
        }
        if (status == ERR_DEVICE && any) {
            snprintf(trouble->cut, sizeof trouble->cut, "%s", status_message());
            return OK;
        }
        if (status == OK)
            status = mapper_add(mapper, &frame);
        if (status != OK)
            return status;
        wish->show(wish->self, &frame, mapper_plan(mapper));
    }
}

// OK: *out is filled, the caller frees it. NOTHING: the sweep was dropped. ERR_INPUT: no map can be made, with the
// reason. ERR_DEVICE: the sensor failed before enough for a map was swept. Else as mapper_finish. *out is zeroed unless
// OK.
static enum status sweep_room(const struct studio_sweep_wish *wish, struct studio_room *out)
{
    struct mapper *mapper = NULL;
    struct mapper_tag *tags = NULL;
    struct mapper_report report;
    int32_t count = 0;
    struct sweep_trouble trouble = {0};
    struct mapper_options options = mapper_default_options();
    options.prior = wish->prior;
    options.plan = true;
    *out = (struct studio_room){0};
    enum status status = wish->tags ? mapper_read_tags(wish->tags, &tags, &count) : OK;
    if (status == OK)
        status = mapper_open(&mapper, source_calibration(wish->source), tags, count, &options);
    if (status == OK)
        status = feed(wish, mapper, &trouble);
    if (status == OK) {
        wish->finishing(wish->self);
        status = mapper_finish(mapper, &out->place, &report);
        if (status == ERR_INPUT && *trouble.cut) // too little of the room: then the sensor is what to mend
            status = fail(ERR_DEVICE, "%s", trouble.cut);
    }
    if (status == OK) {
        out->cut = *trouble.cut;
        map_advise(&out->place, &report, &trouble, &out->advice);
        sweep_plan_of_place(&out->place, &out->plan);
        for (int32_t i = 0; i < count; i++) // those that are not in the place, too
            sweep_plan_set_tag(&out->plan, tags[i].id, false, NULL, 0);
    }
    mapper_close(&mapper);
    free(tags);
    return status;
}

// Into the file, which is made where it does not exist; its takes stay.
static enum status write_room(const struct studio_room *room, const char *file)
{
    struct recording_writer *writer = NULL;
    const bool existed = file_exists(file);
    enum status status = existed ? recording_append(&writer, file) : recording_create(&writer, file);
    if (status != OK)
        return status;
    status = recording_put_place(writer, &room->place);
    struct failure first;
    failure_keep(&first, status);
    enum status closed = recording_close(&writer);
    if ((status != OK || closed != OK) && !existed)
        recording_discard(file);
    return status != OK ? failure_restore(&first) : closed;
}

// The place in the file; nothing where there is no file. ERR_CORRUPT, ERR_IO, ERR_MEMORY, ERR_FORMAT.
static enum status read_place_of(const char *file, struct place *out, bool *has_place)
{
    struct recording *recording = NULL;
    if (!file_exists(file))
        return OK;
    enum status status = recording_open(&recording, file);
    if (status == OK)
        status = recording_read_place(recording, out);
    recording_free(&recording);
    *has_place = status == OK && out->tag_count + out->point_count > 0;
    return status == NOTHING ? OK : status;
}

// ---------------------------------------------------------------- a take's verdict

// After the take was recorded, which ended with `recorded`: judges and keeps. Returns what went wrong first; the take
// stays what it is where it cannot be judged.
static enum status judge_take(const char *file, const char *take, const struct coach *watched, enum status recorded,
                              struct take_judgement *out)
{
    const struct take_filming filming = {watched->purpose, watched};
    struct failure first;
    failure_keep(&first, recorded);
    const enum status status = take_verdict_keep(file, take, &filming, out);
    return first.status != OK ? failure_restore(&first) : status;
}

// ---------------------------------------------------------------- session

enum room_decision { ROOM_UNDECIDED, ROOM_KEEP, ROOM_DROP };

struct studio_session {
    struct studio_session_options options;
    char file[1024], tags[1024];
    struct source_player player; // on the session's thread
    atomic_bool end_take, paused, wants_sweep;
    atomic_int end_sweep;                     // enum studio_sweep_end
    atomic_int room_decision;                 // enum room_decision
    struct studio_wish wanted, wanted_judged; // takes to record; takes whose verdict is to be recomputed
    atomic_int purpose;                       // enum verdict_purpose, of the takes from here on

    // Under the player's lock:
    struct studio_snapshot shown;
    int64_t newest_ns; // of the frame that a take's reader has got last

    // of the session's thread
    struct place place;
    bool has_place;
    struct follower *follower; // of the preview; takes have the recorder's
    struct studio_rate rate;
    struct studio_room room; // swept, not decided yet
    uint8_t *mask;
    // of whichever thread sees the frames: the session's in the preview, the recorder's in a take
    struct coach coach;
    struct raised_hand hand;
    bool taking;
    int64_t take_first_ns, take_frames, rate_ns, rate_frames;
    double rate_hz;
};

// ---------------------------------------------------------------- snapshots

bool studio_session_read(struct studio_session *session, struct studio_snapshot *out)
{
    pthread_mutex_lock(&session->player.worker.lock);
    const bool fresh = studio_snapshot_copy(&session->shown, out);
    pthread_mutex_unlock(&session->player.worker.lock);
    return fresh;
}

static void wake(const struct studio_session *session)
{
    if (session->options.wake)
        session->options.wake(session->options.wake_self);
}

static void set_doing(struct studio_session *session, enum studio_doing doing, const char *failure)
{
    pthread_mutex_lock(&session->player.worker.lock);
    session->shown.doing = doing;
    if (failure)
        snprintf(session->shown.failure, sizeof session->shown.failure, "%s", failure);
    pthread_mutex_unlock(&session->player.worker.lock);
    wake(session);
}

static void count_frame(struct studio_session *session, const struct recorder_seen *seen,
                        struct studio_counters *counters)
{
    const int64_t now_ns = clock_now_ns();
    session->rate_frames++;
    if (now_ns - session->rate_ns > 1000000000) {
        session->rate_hz = (double)session->rate_frames / ((double)(now_ns - session->rate_ns) * 1e-9);
        session->rate_ns = now_ns;
        session->rate_frames = 0;
    }
    *counters = (struct studio_counters){.frames_per_s = session->rate_hz,
                                         .minutes_left = -1,
                                         .dropped = session->taking ? 0 : source_dropped(session->player.source)};
    if (!session->taking) {
        const double room = (double)file_room_bytes(session->file);
        const double bytes_per_s = session->rate.frame_bytes * session->rate_hz;
        counters->mb_per_s = bytes_per_s * 1e-6;
        counters->minutes_left = bytes_per_s > 0 && room >= 0 ? room / bytes_per_s / 60 : -1;
        return;
    }
    session->take_first_ns = session->take_frames ? session->take_first_ns : seen->time_ns;
    counters->frames = ++session->take_frames;
    counters->take_s = (double)(seen->time_ns - session->take_first_ns) * 1e-9;
}

static void start_coach(struct studio_session *session)
{
    coach_start(&session->coach, source_calibration(session->player.source),
                (enum verdict_purpose)atomic_load(&session->purpose));
}

// One frame, as the preview or the recorder saw it: coach, gesture, snapshot.
static void show(struct studio_session *session, const struct recorder_seen *seen)
{
    const struct coach_frame frame = {.time_ns = seen->time_ns,
                                      .color = seen->color,
                                      .depth = seen->depth,
                                      .mask = seen->mask,
                                      .skeleton = seen->skeleton,
                                      .sensor_moves = seen->sensor_moves,
                                      .depth_scale = seen->sight.depth_scale};
    struct studio_counters counters;
    session->coach.purpose =
        (enum verdict_purpose)atomic_load(&session->purpose); // may be chosen while the preview runs
    coach_next(&session->coach, &frame);
    const bool gesture = raised_hand_next(&session->hand, seen->time_ns, seen->skeleton);
    count_frame(session, seen, &counters);
    pthread_mutex_lock(&session->player.worker.lock);
    struct studio_snapshot *out = &session->shown;
    if (!session->taking || !source_is_live(session->player.source))
        studio_snapshot_pictures(out, seen->color, seen->depth, seen->mask);
    out->number++;
    out->has_skeleton = seen->skeleton != NULL;
    if (seen->skeleton)
        out->skeleton = *seen->skeleton;
    out->located = seen->located;
    out->sight = seen->sight;
    const struct studio_counters before = out->counters;
    out->counters = counters;
    if (session->taking) { // on_state's
        out->counters.dropped = before.dropped;
        out->counters.mb_per_s = before.mb_per_s;
        out->counters.minutes_left = before.minutes_left;
        out->counters.skeleton_behind_s = fmax((double)(session->newest_ns - seen->time_ns) * 1e-9, 0);
        out->counters.behind_s = source_is_live(session->player.source) ? 0 : out->counters.skeleton_behind_s;
    }
    out->gestures += gesture;
    snprintf(out->text, sizeof out->text, "%s", coach_text(&session->coach));
    out->fault = coach_any_fault(&session->coach);
    out->share = session->coach.share;
    out->advice = session->coach.advice;
    out->coverage = session->coach.coverage;
    out->distance_m = session->coach.distance_m;
    pthread_mutex_unlock(&session->player.worker.lock);
    wake(session);
}

static void on_state(void *context, const struct recorder_state *state)
{
    struct studio_session *s = context;
    pthread_mutex_lock(&s->player.worker.lock);
    s->shown.counters.dropped = state->dropped;
    s->shown.counters.mb_per_s = state->mb_per_s;
    s->shown.counters.minutes_left = state->minutes_left;
    pthread_mutex_unlock(&s->player.worker.lock);
}

// A live sensor's picture is shown immediately, whatever still waits to be tracked; a film's with its skeleton.
static void on_read(void *context, const struct frame *frame)
{
    struct studio_session *s = context;
    const bool live = source_is_live(s->player.source);
    pthread_mutex_lock(&s->player.worker.lock);
    s->newest_ns = frame->time_ns;
    if (live) {
        studio_snapshot_pictures(&s->shown, frame->color, frame->depth, NULL);
        s->shown.number++;
        s->shown.counters.behind_s = 0;
    }
    pthread_mutex_unlock(&s->player.worker.lock);
    if (live)
        wake(s);
}

static void on_seen(void *context, const struct recorder_seen *seen) { show(context, seen); }

static bool is_paused(void *context) { return atomic_load(&((struct studio_session *)context)->paused); }

// Pictures alone, as of a sweep and of a take that pauses.
static void show_pictures(struct studio_session *session, const struct frame *frame, const char *text)
{
    pthread_mutex_lock(&session->player.worker.lock);
    struct studio_snapshot *out = &session->shown;
    studio_snapshot_pictures(out, frame->color, frame->depth, NULL);
    out->number++;
    out->has_skeleton = out->fault = false;
    snprintf(out->text, sizeof out->text, "%s", text);
    pthread_mutex_unlock(&session->player.worker.lock);
    wake(session);
}

static void on_paused(void *context, const struct frame *frame)
{
    struct studio_session *s = context;
    show_pictures(s, frame, "paused: nothing is recorded");
    if (!source_is_live(s->player.source)) // a film waits, as the person would
        clock_sleep_until_ns(clock_now_ns() + 33000000);
}

// ---------------------------------------------------------------- the sensor

// As the recorder follows the person, but with body points on a thread of their own: the picture must not wait for
// them.
static enum status open_follower(struct studio_session *session)
{
    struct follower_options options = follower_default_options();
    options.place = session->has_place ? &session->place : NULL;
    options.finds_points = session->options.body_points;
    pthread_mutex_lock(&session->player.worker.lock);
    session->shown.has_place = session->has_place;
    pthread_mutex_unlock(&session->player.worker.lock);
    return follower_open(&session->follower, source_calibration(session->player.source), &options);
}

static enum status open_sensor(struct studio_session *session)
{
    enum status status = source_player_open_source(&session->player);
    if (status != OK)
        return status;
    const struct calibration *c = source_calibration(session->player.source);
    pthread_mutex_lock(&session->player.worker.lock);
    studio_snapshot_calibrate(&session->shown, c);
    pthread_mutex_unlock(&session->player.worker.lock);
    start_coach(session);
    status = open_follower(session);
    free(session->mask);
    session->mask = calloc((size_t)c->depth.width * (size_t)c->depth.height + 1, 1);
    return status == OK && !session->mask ? fail(ERR_MEMORY, "no memory for the preview") : status;
}

static void close_sensor(struct studio_session *session)
{
    follower_close(&session->follower);
    source_player_close_source(&session->player);
}

static enum status preview_frame(struct studio_session *session, const struct frame *frame)
{
    const struct follower_frame to_follow = {
        .time_ns = frame->time_ns, .color = frame->color, .depth = frame->depth, .mask = session->mask};
    struct followed_frame followed;
    studio_rate_see(&session->rate, frame, source_calibration(session->player.source), clock_now_ns());
    enum status status = follower_next(session->follower, &to_follow, &followed);
    if (status != OK)
        return status;
    const struct follower_points points = follower_query_points(session->follower);
    pthread_mutex_lock(&session->player.worker.lock);
    session->shown.points = points;
    pthread_mutex_unlock(&session->player.worker.lock);
    const struct recorder_seen seen = {.time_ns = frame->time_ns,
                                       .color = frame->color,
                                       .depth = frame->depth,
                                       .mask = followed.person ? session->mask : NULL,
                                       .skeleton = followed.person ? &followed.skeleton : NULL,
                                       .located = followed.located,
                                       .sight = followed.sight,
                                       .sensor_moves = followed.sensor_moves};
    show(session, &seen);
    return OK;
}

static bool something_is_wanted(struct studio_session *session)
{
    return wish_waits(&session->wanted) || wish_waits(&session->wanted_judged) || atomic_load(&session->wants_sweep) ||
           atomic_load(&session->room_decision) != ROOM_UNDECIDED || source_player_must_stop(&session->player);
}

// Until a take or a sweep is wanted. NOTHING: the film ended. A film is shown as fast as it was made.
static enum status preview(struct studio_session *session)
{
    source_player_resume(&session->player);
    set_doing(session, STUDIO_DOING_PREVIEW, NULL);
    while (!something_is_wanted(session)) {
        struct frame frame;
        enum status status = source_player_next(&session->player, &frame);
        if (status == ERR_INPUT)
            continue;
        if (status != OK)
            return status;
        source_player_wait_for_frame(&session->player);
        status = preview_frame(session, &frame);
        if (status != OK)
            return status;
    }
    return OK;
}

// ---------------------------------------------------------------- takes

// recorder_options.should_stop has no context; there is one studio in a process.
static struct studio_session *the_session;
static bool take_should_stop(void)
{
    return atomic_load(&the_session->end_take) || source_player_must_stop(&the_session->player);
}

static void on_smoothing(void *context, int64_t frames)
{
    struct studio_session *s = context;
    (void)frames;
    atomic_store(&s->end_take, false); // that ended the filming; another one would leave the online joints
    set_doing(s, STUDIO_DOING_SMOOTH, NULL);
}

static enum status record(struct studio_session *session, const char *name, struct recorder_result *result)
{
    struct recording_writer *writer = NULL;
    enum status status = file_exists(session->file) ? recording_append(&writer, session->file)
                                                    : recording_create(&writer, session->file);
    if (status != OK)
        return status;
    const struct recorder_options options = {.should_stop = take_should_stop,
                                             .on_smoothing_begin = on_smoothing,
                                             .on_seen = on_seen,
                                             .on_state = on_state,
                                             .on_read = on_read,
                                             .paused = is_paused,
                                             .on_paused = on_paused,
                                             .context = session,
                                             .body_points = session->options.body_points};
    status = recorder_run(session->player.source, writer, name, session->has_place ? &session->place : NULL, &options,
                          result);
    struct failure first;
    failure_keep(&first, status);
    enum status closed = recording_close(&writer);
    return status != OK ? failure_restore(&first) : closed;
}

// A film from its beginning again.
static enum status rewind_source(struct studio_session *session)
{
    close_sensor(session);
    return open_sensor(session);
}

static enum status run_take(struct studio_session *session)
{
    char name[256];
    struct recorder_result result = {0};
    enum status status = source_is_live(session->player.source) ? OK : rewind_source(session);
    if (status != OK)
        return status;
    if (!take_wish(&session->wanted, name))
        return OK;
    the_session = session;
    session->taking = true;
    session->take_frames = 0;
    start_coach(session);
    pthread_mutex_lock(&session->player.worker.lock);
    session->shown.counters.frames = 0; // the last take's
    session->shown.counters.take_s = 0;
    pthread_mutex_unlock(&session->player.worker.lock);
    set_doing(session, STUDIO_DOING_TAKE, NULL);
    status = record(session, name, &result);
    session->taking = false;
    struct take_judgement judgement = {.frames = result.frames};
    set_doing(session, STUDIO_DOING_SMOOTH, NULL);
    if (result.frames)
        status = judge_take(session->file, name, &session->coach, status, &judgement);
    pthread_mutex_lock(&session->player.worker.lock);
    session->shown.judgement = judgement;
    session->shown.takes_ready++;
    snprintf(session->shown.failure, sizeof session->shown.failure, "%s", status == OK ? "" : status_message());
    pthread_mutex_unlock(&session->player.worker.lock);
    start_coach(session);
    follower_reset(session->follower);
    set_doing(session, STUDIO_DOING_PREVIEW, NULL);
    return status;
}

// ---------------------------------------------------------------- the room

static void show_sweep(void *self, const struct frame *frame, const struct sweep_plan *plan)
{
    struct studio_session *s = self;
    pthread_mutex_lock(&s->player.worker.lock);
    s->shown.room.plan = *plan;
    s->shown.located = plan->located;
    pthread_mutex_unlock(&s->player.worker.lock);
    show_pictures(s, frame, plan->text);
}

static void show_finishing(void *self) { set_doing(self, STUDIO_DOING_MAP, NULL); }

// A map that is neither kept nor dropped yet.
static bool room_waits(const struct studio_session *session)
{
    return session->room.place.tag_count + session->room.place.point_count > 0;
}

// A room that cannot be kept now, as on a full disk, waits for another try.
static bool keep_room(struct studio_session *session)
{
    if (write_room(&session->room, session->file) == OK)
        return true;
    pthread_mutex_lock(&session->player.worker.lock);
    session->shown.room.not_kept++;
    snprintf(session->shown.room.why_not_kept, sizeof session->shown.room.why_not_kept, "Not kept: %s",
             status_message());
    pthread_mutex_unlock(&session->player.worker.lock);
    if (session->options.wake)
        session->options.wake(session->options.wake_self);
    return false;
}

// Where the room is kept, the sensor is looked for in it from here on.
static enum status decide_room(struct studio_session *session)
{
    const int decision = atomic_exchange(&session->room_decision, ROOM_UNDECIDED);
    const bool keeps = decision == ROOM_KEEP && room_waits(session);
    if (decision == ROOM_UNDECIDED || (keeps && !keep_room(session)))
        return OK;
    free_room(&session->room);
    if (!keeps)
        return OK;
    follower_close(&session->follower); // it has the place
    place_free(&session->place);
    enum status status = read_place_of(session->file, &session->place, &session->has_place);
    return status == OK ? open_follower(session) : status;
}

// A sensor that failed while a room waits is opened again once that is kept or dropped.
static enum status after_cut(struct studio_session *session)
{
    static const int64_t LOOK_NS = 20000000;
    enum status status = OK;
    while (status == OK && room_waits(session) && !source_player_must_stop(&session->player)) {
        clock_sleep_until_ns(clock_now_ns() + LOOK_NS);
        status = decide_room(session);
    }
    return status == OK && !source_player_must_stop(&session->player) ? rewind_source(session) : status;
}

// A sweep that gives no map is an answer, not the session's failure.
static enum status run_sweep(struct studio_session *session)
{
    enum status status = source_is_live(session->player.source) ? OK : rewind_source(session);
    if (status != OK)
        return status;
    char found[1024];
    const char *tags = session->tags;
    if (!*tags)
        tags = find_tags(session->file, found, sizeof found) ? found : NULL;
    const struct studio_sweep_wish wish = {.source = session->player.source,
                                           .tags = tags,
                                           .prior = session->has_place ? &session->place : NULL,
                                           .end = &session->end_sweep,
                                           .show = show_sweep,
                                           .finishing = show_finishing,
                                           .self = session};
    free_room(&session->room);
    set_doing(session, STUDIO_DOING_SWEEP, NULL);
    status = sweep_room(&wish, &session->room);
    if (status == ERR_DEVICE || status == ERR_MEMORY)
        return status;
    pthread_mutex_lock(&session->player.worker.lock);
    struct studio_room_view *room = &session->shown.room;
    snprintf(room->failure, sizeof room->failure, "%s", status < 0 ? status_message() : "");
    if (status == OK) {
        room->plan = session->room.plan;
        room->advice = session->room.advice;
    }
    room->ready += status != NOTHING;
    pthread_mutex_unlock(&session->player.worker.lock);
    follower_reset(session->follower);
    start_coach(session);
    set_doing(session, STUDIO_DOING_PREVIEW, NULL);
    return session->room.cut ? after_cut(session) : OK;
}

// A take that cannot be judged keeps the verdict that is shown.
static void judge_anew(struct studio_session *session)
{
    char name[256];
    struct take_judgement judgement;
    if (!take_wish(&session->wanted_judged, name) || take_verdict_keep(session->file, name, NULL, &judgement) != OK)
        return;
    pthread_mutex_lock(&session->player.worker.lock);
    session->shown.judgement = judgement;
    session->shown.judged++;
    pthread_mutex_unlock(&session->player.worker.lock);
    wake(session);
}

// What was asked for while the preview ran.
static enum status serve(struct studio_session *session)
{
    judge_anew(session);
    enum status status = decide_room(session);
    if (status != OK || source_player_must_stop(&session->player))
        return status;
    return atomic_exchange(&session->wants_sweep, false) ? run_sweep(session) : run_take(session);
}

static void *run(void *context)
{
    struct studio_session *s = context;
    enum status status = read_place_of(s->file, &s->place, &s->has_place);
    if (status == OK)
        status = open_sensor(s);
    while (status == OK && !source_player_must_stop(&s->player)) {
        status = preview(s);
        if (status < 0 && room_waits(s))
            status = after_cut(s);
        if (status == OK && !source_player_must_stop(&s->player))
            status = serve(s);
        const bool over = s->player.source && !source_is_live(s->player.source) && !source_remaining(s->player.source);
        if (status == NOTHING || (status == OK && over && !source_player_must_stop(&s->player)))
            status = rewind_source(s);
    }
    if (status < 0)
        set_doing(s, STUDIO_DOING_FAILED, status_message());
    close_sensor(s);
    if (atomic_load(&s->room_decision) == ROOM_KEEP && room_waits(s) && write_room(&s->room, s->file) != OK)
        fprintf(stderr, "reenact-capture studio: the room is not kept: %s\n", status_message());
    return NULL;
}

// ---------------------------------------------------------------- the window's side

enum status studio_session_open(struct studio_session **out, const struct studio_session_options *options)
{
    *out = NULL;
    struct studio_session *s = calloc(1, sizeof *s);
    if (!s)
        return fail(ERR_MEMORY, "no memory for the studio");
    s->options = *options;
    snprintf(s->file, sizeof s->file, "%s", options->file);
    snprintf(s->tags, sizeof s->tags, "%s", options->tags ? options->tags : "");
    atomic_init(&s->purpose, options->purpose);
    open_wish(&s->wanted);
    open_wish(&s->wanted_judged);
    enum status status = source_player_open(&s->player, options->sensor, SOURCE_SENSOR);
    if (status == OK)
        status = worker_thread_start(&s->player.worker, run, s, "for the sensor");
    *out = s;
    if (status != OK)
        studio_session_close(out);
    return status;
}

// What is asked for from here on is meant for this take, even before the session's thread has begun it.
void studio_session_begin(struct studio_session *session, const char *take)
{
    atomic_store(&session->end_take, false);
    atomic_store(&session->paused, false);
    put_wish(&session->wanted, take);
}

void studio_session_judge(struct studio_session *session, const char *take) { put_wish(&session->wanted_judged, take); }

void studio_session_choose(struct studio_session *session, enum verdict_purpose to)
{
    atomic_store(&session->purpose, to);
}

void studio_session_end(struct studio_session *session) { atomic_store(&session->end_take, true); }

void studio_session_pause(struct studio_session *session, bool pause) { atomic_store(&session->paused, pause); }

void studio_session_sweep(struct studio_session *session)
{
    atomic_store(&session->end_sweep, STUDIO_SWEEP_ON);
    atomic_store(&session->wants_sweep, true);
}

void studio_session_end_sweep(struct studio_session *session, bool drop)
{
    atomic_store(&session->end_sweep, drop ? STUDIO_SWEEP_DROP : STUDIO_SWEEP_END);
}

void studio_session_keep_room(struct studio_session *session, bool keep)
{
    atomic_store(&session->room_decision, keep ? ROOM_KEEP : ROOM_DROP);
}

void studio_session_close(struct studio_session **out)
{
    struct studio_session *s = *out;
    if (!s)
        return;
    atomic_store(&s->end_sweep, STUDIO_SWEEP_DROP);
    source_player_close(&s->player);
    close_wish(&s->wanted);
    close_wish(&s->wanted_judged);
    studio_snapshot_free(&s->shown);
    place_free(&s->place);
    free_room(&s->room);
    studio_rate_close(&s->rate);
    free(s->mask);
    free(s);
    *out = NULL;
}
