#include "capture/take_verdict.h"

#include "capture/body_radii.h"
#include "capture/depth_cause.h"
#include "capture/sensor_pose.h"
#include "recording/place.h"
#include "recording/recorded_verdict.h"
#include "recording/recording_reader.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct take_facts {
    int64_t frames, with_skeleton, with_color, with_depth, dropped, lost;
    double step_s;          // median time between two frames; 0: of fewer than two
    double duration_s;      // of all of it
    double gap_s, gap_at_s; // the longest time between two frames, and when it begins
    double unseen_s;        // the longest time without a person
    bool complete, has_place, located;
    bool absurd_times; // they cannot be a sensor's
    bool jumps;        // its clock was set while it filmed: at gap_at_s
};

// ---------------------------------------------------------------- take frames

static enum status read_frame(struct source *source, const struct recorder_options *options, struct frame *frame,
                              struct recorder_result *result)
{
    for (;;) {
        if (options->should_stop && options->should_stop())
            return NOTHING;
        enum status status = source_next(source, frame);
        if (status != ERR_INPUT && status != ERR_CORRUPT && status != ERR_MISSING)
            return status;
        if (!result->damaged++)
            snprintf(result->first_damage, sizeof result->first_damage, "%.255s", status_message());
    }
}

enum status take_frames_next(struct take_clock *clock, struct source *source, const struct recorder_options *options,
                             struct frame *frame, struct recorder_result *result)
{
    bool paused = false;
    for (;;) {
        enum status status = read_frame(source, options, frame, result);
        if (status != OK)
            return status;
        if (!options->paused || !options->paused(options->context))
            break;
        result->pauses += !paused;
        paused = true;
        if (options->on_paused)
            options->on_paused(options->context, frame);
    }
    clock->after_pause = paused && clock->frames;
    if (clock->after_pause)
        clock->closed_ns = frame->time_ns - clock->last_ns - RECORDER_PAUSE_NS;
    frame->time_ns -= clock->closed_ns;
    clock->last_ns = frame->time_ns;
    clock->first_ns = clock->frames++ ? clock->first_ns : clock->last_ns;
    return OK;
}

// ---------------------------------------------------------------- take smoothing

// The backward pass over the take's depth. NOTHING: stopped.
static enum status smooth_backward(struct smoother *smoother, struct tracker *tracker, struct take *take,
                                   const struct recorder_options *options)
{
    int64_t count = take_frame_count(take);
    enum status status = OK;
    if (options->on_smoothing_begin)
        options->on_smoothing_begin(options->context, count);
    for (int64_t i = count - 1; i >= 0 && status == OK; i--) {
        struct take_images images;
        if (options->should_stop && options->should_stop())
            return NOTHING;
        if (take_entry(take, i)->has_depth) {
            status = take_read(take, i, TAKE_DEPTH, &images);
            if (status == OK)
                status = smoother_backward(smoother, tracker, i, images.depth);
            else if (status == ERR_CORRUPT) // a damaged frame costs itself alone
                status = OK;
        }
        if (options->on_smoothed)
            options->on_smoothed(options->context);
    }
    return status == OK ? smoother_solve(smoother) : status;
}

struct scored_frame {
    int64_t frame;
    double score;
};

// Best first, then the earlier.
static int by_score(const void *a, const void *b)
{
    const struct scored_frame *x = a, *y = b;
    return x->score != y->score ? (x->score < y->score) - (x->score > y->score)
                                : (x->frame > y->frame) - (x->frame < y->frame);
}

static bool is_whole(const struct body_radii *radii)
{
    bool whole = true;
    for (int p = 0; p < PART_COUNT; p++)
        whole = whole && radii->part_best[p] >= 0;
    return whole;
}

// What body_radii_add_frame makes of all frames with the smoothed joints, but for what is measured in none of the best
// LOOKED frames. NOTHING: nothing was measured.
static enum status measure_smoothed(struct smoother *smoother, struct take *take, struct body_radii *out)
{
    enum { LOOKED = 40 }; // a second of film at 30 Hz, in which a pose changes; chosen by hand
    const int64_t count = take_frame_count(take);
    struct scored_frame *best = calloc((size_t)count + 1, sizeof *best);
    int64_t known = 0;
    enum status status = best ? OK : fail(ERR_MEMORY, "no memory to measure the body");
    body_radii_start(out);
    for (int64_t i = 0; i < count && status == OK; i++)
        if (smoother_skeleton(smoother, i) && take_entry(take, i)->has_depth)
            best[known++] = (struct scored_frame){i, pose_score(smoother_skeleton(smoother, i))};
    if (status == OK)
        qsort(best, (size_t)known, sizeof *best, by_score);
    for (int64_t i = 0; i < known && i < LOOKED && status == OK && !is_whole(out); i++) {
        struct take_images images;
        status = take_read(take, best[i].frame, TAKE_DEPTH | TAKE_MASK, &images);
        if (status == OK && images.depth && images.mask)
            body_radii_add_frame(out, best[i].frame, take_calibration(take), smoother_skeleton(smoother, best[i].frame),
                                 images.depth, images.mask);
        status = status == ERR_CORRUPT ? OK : status; // a damaged frame costs itself alone
    }
    free(best);
    return status == OK && out->body.representative_frame < 0 ? NOTHING : status;
}

// Rates that no frame gave with the smoothed joints stay those of the online ones.
static enum status put_measured(struct recording_writer *writer, const struct body *online,
                                const struct body_radii *smoothed)
{
    struct body body = smoothed->body;
    for (int p = 0; p < PART_COUNT; p++)
        if (smoothed->part_best[p] < 0)
            body.radius_rate[p] = online->radius_rate[p];
    return recording_put_body(writer, &body);
}

static enum status put_smoothed(struct smoother *smoother, struct recording_writer *writer, int64_t count)
{
    const struct skeleton **skeleton = calloc((size_t)count, sizeof *skeleton);
    if (!skeleton)
        return fail(ERR_MEMORY, "no memory to smooth a take");
    static const struct skeleton absent; // an online detection may turn out to be furniture
    for (int64_t i = 0; i < count; i++) {
        skeleton[i] = smoother_skeleton(smoother, i);
        skeleton[i] = skeleton[i] ? skeleton[i] : &absent;
    }
    enum status status = recording_put_skeletons(writer, skeleton, count);
    free(skeleton);
    return status;
}

enum status take_smooth(struct smoother *smoother, struct tracker *tracker, struct recording_writer *writer,
                        const char *name, const struct recorder_options *options)
{
    struct recording *recording = NULL;
    struct take *take = NULL;
    enum status status = recording_open(&recording, recording_writer_path(writer));
    if (status == OK)
        status = take_open(&take, recording, name);
    struct body_radii radii;
    struct body online = {.representative_frame = -1};
    const int64_t count = status == OK ? take_frame_count(take) : 0;
    if (status == OK && take_lost(take)) // the smoother's frames would not be the take's
        status = NOTHING;
    if (status == OK)
        status = smooth_backward(smoother, tracker, take, options);
    enum status measured = status == OK ? measure_smoothed(smoother, take, &radii) : NOTHING;
    if (measured == OK)
        online = *take_body(take);
    take_close(&take);
    recording_free(&recording);
    if (status == OK)
        status = put_smoothed(smoother, writer, count);
    if (status == OK && measured == OK)
        measured = put_measured(writer, &online, &radii);
    return status == OK && measured < 0 ? measured : status;
}

// ---------------------------------------------------------------- take facts

// A film of a movement has from one picture a second, as the slowest webcams in the dark, to 1000, as no depth sensor.
static const double SLOWEST_STEP_S = 0.95, FASTEST_STEP_S = 1e-3, USUAL_STEP_S = 1.0 / 30;
// The longest that a sensor was seen to stall and come back is some seconds. Beyond this its clock was set.
static const double JUMP_S = 60;

static int by_size(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

// Converted first: the difference of times in a malformed file may overflow an int64.
static double seconds_between(const struct take *take, int64_t a, int64_t b)
{
    return ((double)take_entry(take, b)->time_ns - (double)take_entry(take, a)->time_ns) * 1e-9;
}

// The median time between frames, of at most STEPS of them.
static double median_step_s(const struct take *take)
{
    enum { STEPS = 500 };
    double steps[STEPS];
    const int64_t count = take_frame_count(take) - 1;
    int used = 0;
    if (count < 1)
        return 0;
    const int64_t stride = (count + STEPS - 1) / STEPS;
    for (int64_t i = 0; i < count && used < STEPS; i += stride)
        steps[used++] = seconds_between(take, i, i + 1);
    qsort(steps, (size_t)used, sizeof *steps, by_size);
    return steps[used / 2];
}

static void count_frames(const struct take *take, struct take_facts *facts)
{
    int64_t seen = -1; // the last frame with a person
    for (int64_t i = 0; i < facts->frames; i++) {
        const struct take_entry *e = take_entry(take, i);
        const double gap_s = i ? seconds_between(take, i - 1, i) : 0;
        facts->with_skeleton += e->has_skeleton;
        facts->with_color += e->has_color;
        facts->with_depth += e->has_depth;
        facts->located = facts->located || e->located;
        if (gap_s > facts->gap_s) {
            facts->gap_s = gap_s;
            facts->gap_at_s = seconds_between(take, 0, i - 1);
        }
        if (e->has_skeleton)
            seen = i;
        else
            facts->unseen_s = fmax(facts->unseen_s, seconds_between(take, seen < 0 ? 0 : seen, i));
    }
}

// ERR_MEMORY, ERR_IO.
static enum status take_facts_read(struct take *take, struct take_facts *out)
{
    int64_t places = 0;
    *out = (struct take_facts){.frames = take_frame_count(take),
                               .dropped = take_dropped(take),
                               .lost = take_lost(take),
                               .complete = take_is_complete(take)};
    enum status status =
        database_number(recording_database(take_recording(take)), "SELECT count(*) FROM place", &places);
    if (status != OK)
        return status;
    out->has_place = places > 0;
    count_frames(take, out);
    if (out->frames < 2)
        return OK;
    out->duration_s = seconds_between(take, 0, out->frames - 1);
    out->step_s = median_step_s(take);
    out->absurd_times = out->step_s >= SLOWEST_STEP_S || out->step_s < FASTEST_STEP_S;
    out->jumps = !out->absurd_times && out->gap_s > JUMP_S;
    return OK;
}

// The time between two frames that are `frames` apart, by a clock that a sensor could have: absurd times and jumps
// count as frames at the usual rate.
static int64_t take_facts_step_ns(const struct take_facts *facts, int64_t from_ns, int64_t to_ns, int64_t frames)
{
    const double usual_s = (facts->absurd_times ? USUAL_STEP_S : facts->step_s) * (double)frames,
                 step_s = ((double)to_ns - (double)from_ns) * 1e-9;
    const bool usual = facts->absurd_times || (facts->jumps && step_s > JUMP_S);
    return (int64_t)((usual ? usual_s : step_s) * 1e9);
}

// ------------------------------------------------------------- in words

static void say_times(const struct take_facts *facts, struct take_verdict *out)
{
    // Units that were taken for seconds, by the step that each gives at 5 to 200 pictures a second.
    static const struct {
        const char *name, *factor;
        double a_second;
    } units[] = {{"milliseconds", "1000", 1e3}, {"microseconds", "1000000", 1e6}, {"nanoseconds", "1000000000", 1e9}};
    if (facts->jumps)
        verdict_say(out, USE_ANY,
                    "the clock jumped ahead by %.1f %s at %.1f s: it was set while filming; trim the take there",
                    facts->gap_s > 7200 ? facts->gap_s / 3600 : facts->gap_s / 60, facts->gap_s > 7200 ? "h" : "min",
                    facts->gap_at_s);
    if (!facts->absurd_times)
        return;
    for (size_t i = 0; i < COUNT_OF(units); i++)
        if (facts->step_s >= 0.005 * units[i].a_second && facts->step_s <= 0.2 * units[i].a_second) {
            verdict_say(out, USE_ANY,
                        "its times are %s taken for seconds, one picture in %.0f s: divide the film's times by %s and "
                        "record it again",
                        units[i].name, facts->step_s, units[i].factor);
            return;
        }
    if (facts->step_s >= SLOWEST_STEP_S)
        verdict_say(out, USE_ANY,
                    "its times cannot be right, one picture in %.1f s: give the film's times in seconds and record it "
                    "again",
                    facts->step_s);
    else
        verdict_say(out, USE_ANY,
                    "its times cannot be right, %.0f pictures a second: give the film's times in seconds and record it "
                    "again",
                    1 / fmax(facts->step_s, 1e-9));
}

// Thresholds chosen by hand: what is seen when the take is watched.
static void take_facts_say(const struct take_facts *facts, struct take_verdict *out)
{
    const double frames = facts->frames ? (double)facts->frames : 1;
    if (!facts->frames)
        verdict_say(out, USE_ANY, "empty");
    if (facts->lost)
        verdict_say(out, USE_ANY, "%lld frames lost to damage", (long long)facts->lost);
    if (!facts->complete)
        verdict_say(out, USE_ANY, "interrupted");
    say_times(facts, out);
    if (facts->with_skeleton && (double)facts->with_skeleton < 0.9 * frames)
        verdict_say(out, USE_ANY, "a person in %.0f %% of the frames", 100 * (double)facts->with_skeleton / frames);
    else if (facts->with_skeleton && facts->unseen_s > 1 && !facts->absurd_times && !facts->jumps)
        verdict_say(out, USE_ANY, "the person out of sight for %.1f s", facts->unseen_s);
    if (facts->frames && !facts->with_color)
        verdict_say(out, USE_WATCH, "no colour");
    else if ((double)facts->with_color < 0.9 * frames)
        verdict_say(out, USE_WATCH, "colour in %.0f %% of the frames", 100 * (double)facts->with_color / frames);
    if (facts->frames && !facts->with_depth)
        verdict_say(out, USE_ANY, "no depth");
    if ((double)facts->dropped > 0.02 * frames)
        verdict_say(out, USE_ANY, "%.0f %% of the frames dropped",
                    100 * (double)facts->dropped / (frames + (double)facts->dropped));
    if (facts->gap_s > 0.5 && facts->step_s < 0.2 && !facts->jumps)
        verdict_say(out, USE_ANY, "a gap of %.1f s", facts->gap_s);
    if (facts->has_place && facts->frames && !facts->located)
        verdict_say(out, USE_WATCH, "where the actor stood is not known");
    if (facts->duration_s < 1 && facts->frames)
        verdict_say(out, USE_ANY, "shorter than a second");
}

// ---------------------------------------------------------------- take verdict

// ------------------------------------------------------------- the frames

// A fault counts when it lasts for 0.4 s (coach.h). Colour says how bright it is, which changes slowly.
static const double LOOK_S = 0.1;
enum { COLOR_EVERY = 3 }; // looks

// Like the recorder's count: by how much a sensor's pose must change to have been moved.
static bool has_moved(const struct take_entry *before, const struct take_entry *now)
{
    const double shift_m = 0.02, turn_rad = 0.0175;
    if (!before || !before->located || !now->located)
        return false;
    const struct pose moved = pose_multiply(pose_inverse(before->world_from_camera), now->world_from_camera);
    return v3_length(moved.translation) > shift_m ||
           pose_angle(before->world_from_camera, now->world_from_camera) > turn_rad;
}

struct viewing {
    struct take *take;
    struct coach *coach;
    const struct take_facts *facts;
    int64_t time_ns; // of the frame shown last, by a clock without absurd jumps
    int moves;
};

// Shows the coach one frame; of its images as many as are wanted. A damaged one is one that nobody looked at.
static enum status show_frame(struct viewing *viewing, int64_t i, enum coach_unread unread)
{
    static const unsigned want[] = {
        [UNREAD_NONE] = TAKE_COLOR | TAKE_DEPTH | TAKE_MASK, [UNREAD_COLOR] = TAKE_DEPTH | TAKE_MASK};
    const struct take_entry *e = take_entry(viewing->take, i), *before = i ? take_entry(viewing->take, i - 1) : NULL;
    const int64_t step_ns = before ? take_facts_step_ns(viewing->facts, before->time_ns, e->time_ns, 1) : 0;
    struct take_images images = {0};
    const enum status status = unread == UNREAD_ALL ? OK : take_read(viewing->take, i, want[unread], &images);
    if (status != OK && status != ERR_CORRUPT)
        return status;
    viewing->time_ns += step_ns;
    viewing->moves += has_moved(before, e);
    const bool person = e->has_skeleton && e->has_mask;
    const struct coach_frame frame = {.time_ns = viewing->time_ns,
                                      .color = images.color,
                                      .depth = images.depth,
                                      .mask = person ? images.mask : NULL,
                                      .skeleton = person ? &e->skeleton : NULL,
                                      .sensor_moves = viewing->moves,
                                      .step_s = 1e-9 * (double)step_ns,
                                      .unread = status == OK ? unread : UNREAD_ALL};
    coach_next(viewing->coach, &frame);
    return OK;
}

// Of how many frames the images of one are looked at.
static int64_t look_every(const struct take_facts *facts)
{
    const double step_s = 1e-9 * (double)take_facts_step_ns(facts, 0, (int64_t)(facts->step_s * 1e9), 1);
    const int64_t by_time = step_s > 0 ? (int64_t)fmin(LOOK_S / step_s + 0.5, 1e3) : 1,
                  by_least = facts->frames / VERDICT_LOOKS_MIN,
                  by_most = (facts->frames + VERDICT_LOOKS_MAX - 1) / VERDICT_LOOKS_MAX;
    int64_t every = by_time < by_least ? by_time : by_least;
    every = every > by_most ? every : by_most;
    return every > 1 ? every : 1;
}

static enum status show_frames(struct take *take, const struct take_facts *facts,
                               const struct take_verdict_patience *patience, struct coach *coach)
{
    struct viewing v = {.take = take, .coach = coach, .facts = facts, .time_ns = 1};
    const int64_t every = look_every(facts);
    enum status status = OK;
    for (int64_t i = 0; i < facts->frames && status == OK; i++) {
        if (patience && !patience->goes_on(patience->self))
            return NOTHING;
        const enum coach_unread color = i / every % COLOR_EVERY ? UNREAD_COLOR : UNREAD_NONE;
        status = show_frame(&v, i, i % every ? UNREAD_ALL : color);
    }
    return status;
}

// ------------------------------------------------------------- the verdict

static void add_lines(struct take_verdict *verdict, const struct take_verdict *more, bool filming_only)
{
    for (int i = 0; i < more->count; i++)
        if ((more->line[i].filming || !filming_only) && verdict->count < VERDICT_LINES)
            verdict->line[verdict->count++] = more->line[i];
}

// What was seen while filming and is not in the frames.
static void add_filming(struct take_verdict *verdict, const struct take_verdict *before, const struct coach *coach)
{
    struct take_verdict watched;
    if (coach) {
        coach_verdict(coach, &watched);
        before = &watched;
    }
    for (int i = 0; i < before->count; i++)
        if (before->line[i].filming)
            verdict->spoilt |= before->line[i].spoils;
    add_lines(verdict, before, true);
}

// What is known before.
struct judging {
    struct take_verdict before;    // whose purpose stays
    const struct coach *filmed_by; // NULL: none
    const struct take_verdict_patience *patience;
};

static enum status judge_take(struct take *take, const struct judging *by, struct take_judgement *judgement)
{
    struct take_verdict *out = &judgement->verdict;
    struct take_facts facts;
    struct take_verdict watched, tilt = {.seen = true};
    struct depth_finding finding;
    struct coach *coach = malloc(sizeof *coach);
    if (!coach)
        return fail(ERR_MEMORY, "no memory to judge a take");
    coach_start(coach, take_calibration(take), by->before.purpose);
    enum status status = take_facts_read(take, &facts);
    if (status == OK)
        status = show_frames(take, &facts, by->patience, coach);
    if (status == OK)
        status = depth_cause_find(take, &finding);
    if (status == OK)
        status = sensor_tilt_judge(take, &tilt);
    if (status == OK) {
        coach_verdict(coach, &watched);
        *out = (struct take_verdict){.purpose = by->before.purpose, .seen = watched.seen};
        depth_cause_say(&finding, out);
        take_facts_say(&facts, out);
        add_lines(out, &tilt, false);
        out->spoilt |= watched.spoilt;
        add_filming(out, &by->before, by->filmed_by);
        add_lines(out, &watched, false);
        if (!out->count)
            verdict_say(out, 0, "there is nothing to watch and nothing to compare");
        judgement->seen = coach->coverage;
        judgement->frames = facts.frames;
    }
    free(coach);
    return status;
}

enum status take_verdict_keep(const char *path, const char *name, const struct take_filming *filming,
                              struct take_judgement *out)
{
    struct recording *r = NULL;
    struct take *take = NULL;
    struct judging by = {.before = {.purpose = PURPOSE_BOTH}, .filmed_by = filming ? filming->coach : NULL};
    struct verdict_key key = {0};
    bool fits;
    enum status status = recording_open(&r, path);
    if (status == OK)
        status = take_open(&take, r, name);
    if (status == OK && !filming)
        status = recorded_verdict_read(take, &by.before, &fits);
    if (status == NOTHING)
        status = OK;
    if (filming)
        by.before.purpose = filming->purpose;
    if (status == OK)
        status = judge_take(take, &by, out);
    if (status == OK)
        key = verdict_key_of(take);
    take_close(&take);
    recording_free(&r);
    if (status != OK)
        return status;
    status = recorded_verdict_write(path, &key, &out->verdict);
    return status == ERR_MEMORY ? status : OK;
}

// Whether the verdict that is kept was made from the frames as they are.
static enum status check_kept_verdict(struct recording *recording, const char *name, bool *out)
{
    struct take *take = NULL;
    struct take_verdict kept;
    enum status status = take_open(&take, recording, name);
    if (status == OK)
        status = recorded_verdict_read(take, &kept, out);
    take_close(&take);
    return status == NOTHING ? OK : status;
}

// *more: there is a take number `i`.
static enum status keep_one_missing(const char *path, int i, bool *more)
{
    struct recording *r;
    struct take_judgement judgement;
    bool stand = true;
    char *name = NULL;
    enum status status = recording_open(&r, path);
    if (status != OK)
        return status;
    *more = i < recording_take_count(r);
    if (*more)
        status = check_kept_verdict(r, recording_take_name(r, i), &stand);
    if (status == OK && !stand && !(name = strdup(recording_take_name(r, i))))
        status = fail(ERR_MEMORY, "no memory to judge a take");
    recording_free(&r); // a reader would hinder the writer
    if (name)
        status = take_verdict_keep(path, name, NULL, &judgement);
    free(name);
    return status;
}

enum status take_verdict_keep_missing(const char *path)
{
    enum status status = OK;
    bool more = true;
    for (int i = 0; more && status == OK; i++)
        status = keep_one_missing(path, i, &more);
    return status;
}

enum status take_verdict_get(struct recording *recording, const char *name,
                             const struct take_verdict_patience *patience, struct take_verdict *out)
{
    struct take *take = NULL;
    struct judging by = {.before = {.purpose = PURPOSE_BOTH}, .patience = patience};
    bool fits = false;
    enum status status = take_open(&take, recording, name);
    if (status == OK)
        status = recorded_verdict_read(take, &by.before, &fits);
    if (status == OK && fits) {
        *out = by.before;
    } else if (status == OK || status == NOTHING) {
        struct take_judgement judgement;
        status = judge_take(take, &by, &judgement);
        if (status == OK)
            *out = judgement.verdict;
    }
    take_close(&take);
    return status;
}
