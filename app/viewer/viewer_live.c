// The viewer's part for doing the move beside the actor.
#include "app/live/live_attempt.h"
#include "app/live/live_picture.h"
#include "app/live/live_sensor.h"
#include "app/ui/screen_live.h"
#include "app/viewer/live_expectation.h"
#include "app/viewer/viewer_inside.h"
#include "app/viewer/viewer_parts.h"
#include "base/clamp.h"
#include "base/clock.h"
#include "compare/expected_take.h"
#include "compare/findings.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// Chosen by hand.
static const double MIRROR_M = 0.95;                 // from the person to the actor in the mirror
static const double BESIDE_M = 1.35;                 // and where both are figures
static const double PAIR_WIDE_M = 3.3, TALL_M = 2.4; // two figures with their arms out, a hand raised
static const double BEHIND_S = 1.5, AHEAD_S = 0.6;   // about the actor's instant the person's is looked for
static const double NEXT_S = 0.45;                   // the ghost is so far ahead of the person
static const double FIGURE_MIDDLE_M = 0.85;          // of the summary's figures, over their feet
static const int64_t FROZEN_NS = 1500000000;

// The frame of the take and that of the live world put together: the actor's beginning beside the person.
struct live_anchor {
    bool known;
    double yaw_rad;           // by which a live direction is turned to be one of the take's
    struct vec3 person, left; // of the person, live world: on the floor; the unit vector to the left
    struct vec3 actor;        // of the actor, take's world: on the floor
};

struct viewer_live {
    struct viewer_shared *shared;
    struct live_keeper *keeper;
    struct live_sensor *sensor;
    struct movement reference;      // of the take
    struct movement mirrored;       // its mirror image
    struct expected_take expecting; // what counts of it
    bool unkept;                    // that was changed by touch, and is not in the file yet
    int64_t offset_ns;              // of its first frame in the take
    struct body body;               // the actor's
    const struct live_frame *frame; // the newest at the last update; NULL: none
    struct live_anchor anchor;
    bool image_mirrored; // shared->image shows the actor mirrored

    struct gpu_texture *picture, *front; // of the sensor's colour image
    bool has_front;                      // something stands before the actor in it
    int64_t uploaded;                    // number of the frame in `picture`
    uint8_t *rgba;                       // scratch, of `pixels`
    float *scratch;
    size_t pixels;

    int finished;       // of live_state, as seen last
    int32_t first, end; // the reference's frames that are done
    struct attempt_judge *judge;
    struct live_attempt shown; // of the summary
    int kept;                  // live_keeper_state.kept, as seen last
    bool no_points_told;       // that no body points are looked for

    // what the page borrows
    enum verdict verdicts[PART_COUNT], review_verdicts[PART_COUNT];
    struct skeleton person, ghost, attempt_figure, reference_figure;
    struct live_page page;
    struct overlay_stroke strokes[2 * FIGURE_STROKES_MAX]; // of the room: person and ghost
    struct overlay overlay;
};

static int32_t frame_at(const struct viewer_live *live, int64_t take_ns)
{
    const int32_t f = (int32_t)lround((double)(take_ns - live->offset_ns) * 1e-9 * MOVEMENT_RATE_HZ);
    return clamp_int(f, 0, live->reference.count - 1);
}

static int64_t take_time_of(const struct viewer_live *live, double frame)
{
    return live->offset_ns + (int64_t)(frame / MOVEMENT_RATE_HZ * 1e9);
}

// What an attempt is judged by.
static const struct movement *reference_of(const struct viewer_live *live, bool mirrored)
{
    return mirrored ? &live->mirrored : &live->reference;
}

// ---------------------------------------------------------------- opening

// What was touched.
static void take_counting(struct viewer_live *live)
{
    struct live_state *s = &live->shared->state.live;
    struct expectation *expected = &live->expecting.expected;
    if (!s->counting_changed)
        return;
    s->counting_changed = false;
    if (live_counting_apply(&s->counting, live->offset_ns, live->expecting.seconds, expected) != OK)
        view_state_warn(&live->shared->state, "Too little of the actor is seen in the marked part for it to count",
                        clock_now_ns());
    s->counting = live_counting_of(expected, live->offset_ns);
    live->unkept = true;
}

// Beside the take, for the next time; where the file cannot be written, it held for this time.
static void keep_counting(struct viewer_live *live)
{
    struct expected_take *e = &live->expecting;
    if (!live->unkept)
        return;
    live->unkept = false;
    expectation_to_take(&e->expected, e->first_ns, e->seconds, &e->kept);
    if (recorded_expectation_write(live->shared->options.file, e->number, &e->kept) != OK)
        view_state_warn(&live->shared->state, "What counts could not be kept in the recording", clock_now_ns());
}

static enum status read_take(struct viewer_live *live, const char *name)
{
    struct movement_source source;
    struct reference_spread spread = {.references = 0};
    struct take *take = NULL;
    enum status status = movement_read(live->shared->options.file, name, &live->reference, &source);
    if (status == OK)
        status = movement_mirror(&live->reference, &live->mirrored);
    struct expected_take *expecting = &live->expecting; // what of it cannot be used is left out
    if (status == OK)
        status = expected_take_read(live->shared->options.file, name, &live->reference, expecting);
    if (status == OK)
        status = expected_take_measure(live->shared->options.file, &live->reference, expecting, &spread);
    if (status == OK && spread.references)
        reference_spread_put(&spread, &expecting->expected);
    if (status == OK && expecting->notes.count)
        view_state_warn(&live->shared->state, expecting->notes.line[0], clock_now_ns());
    if (status == OK)
        status = take_open(&take, live->shared->recording, name);
    if (status != OK)
        return status;
    live->body = *take_body(take);
    const int64_t first = take_first_sample(take);
    if (first >= 0)
        live->offset_ns = take_entry(take, first)->time_ns - take_entry(take, 0)->time_ns;
    take_close(&take);
    live->shared->state.live.counting = live_counting_of(&expecting->expected, live->offset_ns);
    return OK;
}

static void close_take(struct viewer_live *live)
{
    keep_counting(live);
    live_sensor_close(&live->sensor);
    live_keeper_close(&live->keeper);
    attempt_judge_close(&live->judge);
    live_attempt_free(&live->shown);
    movement_free(&live->reference);
    movement_free(&live->mirrored);
    live->expecting = (struct expected_take){.number = -1};
    live->frame = NULL;
    live->anchor = (struct live_anchor){0};
    live->offset_ns = live->uploaded = 0;
    live->kept = 0;
}

enum status viewer_live_open_take(struct viewer_live *live, const char *take)
{
    close_take(live);
    enum status status = read_take(live, take);
    if (status != OK)
        return status;
    live->end = live->reference.count;
    const struct place *place = live->shared->has_place ? &live->shared->place : NULL;
    const struct live_keeper_options keep = {live->shared->options.file, place};
    status = live_keeper_open(&live->keeper, &keep);
    const struct live_sensor_options how = {.sensor = live->shared->options.sensor,
                                            .place = place,
                                            .reference = &live->reference,
                                            .mirrored = &live->mirrored,
                                            .keeper = live->keeper,
                                            .no_body_points = live->shared->options.no_body_points,
                                            .every_frame = live->shared->options.every_frame,
                                            .notify = live->shared->options.wake,
                                            .notify_self = live->shared->options.wake_self};
    return status == OK ? live_sensor_open(&live->sensor, &how) : status;
}

enum status viewer_live_open(struct viewer_live **out, struct viewer_shared *shared)
{
    struct viewer_live *l = *out = calloc(1, sizeof *l);
    if (!l)
        return fail(ERR_MEMORY, "no memory for the live screens");
    l->shared = shared;
    return OK;
}

void viewer_live_close(struct viewer_live **live)
{
    struct viewer_live *l = *live;
    if (!l)
        return;
    close_take(l);
    gpu_texture_close(&l->picture);
    gpu_texture_close(&l->front);
    free(l->rgba);
    free(l->scratch);
    free(l);
    *live = NULL;
}

void viewer_live_suspend(struct viewer_live *live, bool suspend)
{
    if (live->sensor)
        live_sensor_suspend(live->sensor, suspend);
}

// ---------------------------------------------------------------- time

static void tell_sight(struct viewer_live *live, int64_t now_ns)
{
    const struct live_sensor_state state = live_sensor_query(live->sensor);
    const struct live_frame *f = live->frame;
    struct live_sight sight = {.seeing =
                                   state.seeing && f &&
                                   (state.film || now_ns - state.received_ns < FROZEN_NS), // a film waits, or is late
                               .ended = state.ended && f && f->attempt == live->shared->state.live.attempt,
                               .frame = f ? f->number : 0,
                               .trouble = state.trouble};
    if (f) {
        const struct live_look *look = &f->look;
        sight.person = look->person;
        sight.second_person = look->second_person;
        sight.in_place = look->in_place && take_view_is_located(live->shared->take_view);
        sight.located = look->located && take_view_is_located(live->shared->take_view);
        sight.judged = look->judged && f->attempt == live->shared->state.live.attempt;
        sight.reference_ns = take_time_of(live, look->reference);
        sight.away_rad = look->away_rad;
    }
    live_state_on_sight(&live->shared->state.live, &sight, now_ns);
    if (*state.no_body_points && !live->no_points_told) { // once; what is tracked from depth alone is less sure
        char notice[200];
        snprintf(notice, sizeof notice, "Tracked from depth alone: %.150s", state.no_body_points);
        view_state_notify(&live->shared->state, notice, now_ns);
        live->no_points_told = true;
    }
}

// Nothing is judged by this one: the screen says why.
static void show_failure(struct viewer_live *live, int64_t now_ns)
{
    const struct live_result none = {0};
    live_attempt_free(&live->shown);
    live->shown.number = live->shared->state.live.finished;
    snprintf(live->shown.why, sizeof live->shown.why, "%.199s", status_message());
    live_state_on_result(&live->shared->state.live, &none, 0, now_ns);
}

// The take that was chosen as the attempt, of this recording or of the other one.
static const char *attempt_name(const struct viewer_shared *shared)
{
    const struct take_list *list = shared->state.compare.attempt_count ? &shared->attempts : &shared->takes;
    return list->cards[shared->state.compare.attempt].name;
}

// Two takes were chosen. While an earlier result is still being made they wait for it.
static void compare_takes(struct viewer_live *live, int64_t now_ns)
{
    struct take_choice *choice = &live->shared->state.compare;
    if (!choice->wanted || live->judge)
        return;
    choice->wanted = false;
    const struct takes_task task = {.path = live->shared->options.file,
                                    .reference = live->shared->takes.cards[choice->reference].name,
                                    .attempt_path = live->shared->options.compare_with
                                                        ? live->shared->options.compare_with
                                                        : live->shared->options.file,
                                    .attempt = attempt_name(live->shared),
                                    .number = live->shared->state.live.finished,
                                    .notify = live->shared->options.wake,
                                    .notify_self = live->shared->options.wake_self};
    if (attempt_judge_start_takes(&live->judge, &task) != OK)
        show_failure(live, now_ns);
}

// The floor point under a skeleton and the direction to its left. False: not known.
static bool find_stance(const struct skeleton *skeleton, struct vec3 *floor_point, struct vec3 *left)
{
    if (!(skeleton->confidence[JOINT_LEFT_HIP] > 0 && skeleton->confidence[JOINT_RIGHT_HIP] > 0))
        return false;
    *left = v3_sub(skeleton->joint[JOINT_LEFT_HIP], skeleton->joint[JOINT_RIGHT_HIP]);
    left->z = 0;
    if (v3_length(*left) < 0.02)
        return false;
    *left = v3_unit(*left);
    *floor_point = v3_mix(skeleton->joint[JOINT_LEFT_HIP], skeleton->joint[JOINT_RIGHT_HIP], 0.5);
    double z = INFINITY;
    for (int f = 0; f < 2; f++) {
        const enum joint foot = f ? JOINT_RIGHT_FOOT : JOINT_LEFT_FOOT;
        z = skeleton->confidence[foot] > 0 ? fmin(z, skeleton->joint[foot].z) : z;
    }
    floor_point->z = isfinite(z) ? z : 0;
    return true;
}

// Who was filmed is seen from the front, a little from their left.
static void look_at_front(struct viewer_live *live)
{
    static const double ASIDE_RAD = 0.3, RISE_RAD = 0.1, DISTANCE_M = 3;
    struct vec3 at, left = {1, 0, 0};
    struct skeleton skeleton;
    if (!live_attempt_skeleton(&live->shown, 0, &skeleton) || !find_stance(&skeleton, &at, &left))
        left = v3(1, 0, 0);
    live->shared->state.live.orbit =
        (struct orbit){.angle_rad = atan2(left.y, left.x) + ASIDE_RAD, .rise_rad = RISE_RAD, .distance_m = DISTANCE_M};
}

static void adopt_result(struct viewer_live *live, int64_t now_ns)
{
    struct live_attempt attempt;
    if (!live->judge || !attempt_judge_finished(live->judge, &attempt))
        return;
    attempt_judge_close(&live->judge);
    const struct live_state *state = &live->shared->state.live;
    if (attempt.number != state->finished || state->judged == state->finished) { // it was left meanwhile
        live_attempt_free(&attempt);
        return;
    }
    live_attempt_free(&live->shown);
    live->shown = attempt;
    if (state->of_takes)
        look_at_front(live);
    if (*attempt.note)
        view_state_warn(&live->shared->state, attempt.note, now_ns);
    const struct joint_samples *s = &attempt.samples;
    const int64_t length_ns = s->count ? s->at[s->count - 1].time_ns : 0;
    const struct comparison *c = &attempt.comparison;
    const struct live_result result = {.worst_ns = c->finding_count ? finding_moment_ns(c, &c->findings[0]) : 0,
                                       .score = c->score,
                                       .sigma = c->score_sigma,
                                       .length_s = (double)length_ns * 1e-9,
                                       .findings = attempt.comparison.finding_count,
                                       .compared = attempt.compared && c->relation == RELATION_SAME};
    live_state_on_result(&live->shared->state.live, &result, length_ns, now_ns);
    live->shared->state.changed = true;
}

static void tell_kept(struct viewer_live *live, int64_t now_ns)
{
    const struct live_keeper_state state = live_keeper_query(live->keeper);
    if (state.kept == live->kept)
        return;
    live->kept = state.kept;
    if (state.failed)
        view_state_warn(&live->shared->state, state.sentence, now_ns);
    else
        view_state_notify(&live->shared->state, state.sentence, now_ns);
}

void viewer_live_update(struct viewer_live *live, int64_t now_ns)
{
    adopt_result(live, now_ns);
    compare_takes(live, now_ns);
    if (!live->sensor)
        return;
    const int64_t before = live->frame ? live->frame->number : 0;
    live->frame = live_sensor_latest(live->sensor);
    live->shared->state.changed |=
        live->frame && live->frame->number != before && live->shared->state.page == PAGE_LIVE;
    tell_sight(live, now_ns);
    tell_kept(live, now_ns);
}

// An attempt has ended: judged on a thread of its own.
static void judge_attempt(struct viewer_live *live, int64_t now_ns)
{
    struct joint_samples samples;
    if (live->judge) { // a loop that is shorter than judging it takes: the former is not shown
        attempt_judge_close(&live->judge);
    }
    if (live_sensor_take_samples(live->sensor, live->shared->state.live.finished, &samples) < 0)
        view_state_warn(&live->shared->state, status_message(), now_ns);
    const bool mirrored = live->shared->state.live.attempt_mirrored;
    const struct expectation *e = &live->expecting.expected, expected = mirrored ? expectation_mirror(e) : *e;
    const struct attempt_task task = {.reference = reference_of(live, mirrored),
                                      .mirrored = mirrored,
                                      .expected = &expected,
                                      .first = live->first,
                                      .end = live->end,
                                      .number = live->shared->state.live.finished,
                                      .notify = live->shared->options.wake,
                                      .notify_self = live->shared->options.wake_self};
    if (attempt_judge_start(&live->judge, &task, &samples) != OK)
        show_failure(live, now_ns);
}

void viewer_live_after_tick(struct viewer_live *live, int64_t now_ns)
{
    struct live_state *s = &live->shared->state.live;
    if (!live->sensor)
        return;
    take_counting(live);
    if (s->finished != live->finished) {
        live->finished = s->finished;
        if (!s->of_takes)
            judge_attempt(live, now_ns);
    }
    const int32_t at = frame_at(live, s->at_ns);
    live->first = frame_at(live, s->marked_from_ns);
    live->end = frame_at(live, s->marked_to_ns) + 1;
    const int32_t behind = at - (int32_t)(BEHIND_S * MOVEMENT_RATE_HZ),
                  ahead = at + (int32_t)(AHEAD_S * MOVEMENT_RATE_HZ);
    const struct live_wish wish = {.attempt = s->attempt,
                                   .run = s->phase == LIVE_DOING,
                                   .shown = {.frame = at,
                                             .first = behind > live->first ? behind : live->first,
                                             .end = ahead < live->end ? ahead : live->end,
                                             .mirrored = s->mirrored,
                                             .expected = live->expecting.expected}};
    live_sensor_wish(live->sensor, &wish);
    if (s->keep_wanted) {
        s->keep_wanted = false;
        live_keeper_keep(live->keeper);
    }
}

// ---------------------------------------------------------------- the two worlds

// While nothing moves: the actor is put beside the person, facing alike.
static void update_anchor(struct viewer_live *live)
{
    const struct live_state *s = &live->shared->state.live;
    struct vec3 person, left, actor, actor_left;
    if ((s->phase == LIVE_DOING && live->anchor.known) || s->phase == LIVE_SUMMARY || !live->frame ||
        !live->frame->look.person || !live->shared->image.has_skeleton ||
        !find_stance(&live->frame->look.in_world, &person, &left) ||
        !find_stance(&live->shared->image.skeleton, &actor, &actor_left))
        return;
    if (live->image_mirrored) // the joints are where the mirror shows them, under their own names
        actor_left = v3_scale(actor_left, -1);
    live->anchor = (struct live_anchor){.known = true,
                                        .yaw_rad = atan2(actor_left.y, actor_left.x) - atan2(left.y, left.x),
                                        .person = person,
                                        .left = left,
                                        .actor = actor};
}

// offset_m: how far to the person's left the actor stands.
static struct pose take_from_live(const struct viewer_live *live, double offset_m)
{
    const struct live_anchor *a = &live->anchor;
    if (!a->known)
        return POSE_IDENTITY;
    const struct quat turn = quat_from_rotation_vector(v3(0, 0, a->yaw_rad));
    const struct vec3 meets = v3_add(a->person, v3_scale(a->left, offset_m));
    return (struct pose){turn, v3_sub(a->actor, quat_rotate(turn, meets))};
}

// Horizontal, to the right of the picture: the figures stand so beside each other from whatever side they are seen.
static struct vec3 picture_right(const struct viewer_live *live)
{
    return quat_rotate(orbit_world_from_camera(&live->shared->state.live.orbit).rotation, v3(1, 0, 0));
}

// ---------------------------------------------------------------- the page

static void fill_verdicts(struct viewer_live *live)
{
    const struct live_look *look = &live->frame->look;
    if (live->shared->state.live.phase != LIVE_DOING || !look->judged ||
        live->frame->attempt != live->shared->state.live.attempt)
        return;
    for (int p = 0; p < PART_COUNT; p++)
        live->verdicts[p] = look->parts[p].verdict;
    live->page.verdicts = live->verdicts;
    live->page.parts = look->parts;
    live->page.person_ns = take_time_of(live, look->reference);
}

// The pose that comes next, where the person stands.
static void fill_ghost(struct viewer_live *live)
{
    const struct live_look *look = &live->frame->look;
    const struct live_state *s = &live->shared->state.live;
    if (!s->ghost || (s->phase != LIVE_DOING && s->phase != LIVE_COUNT_IN) || !live->reference.count)
        return;
    const int32_t at = frame_at(live, s->at_ns), now = live->page.verdicts ? look->reference : at;
    int32_t next = now + (int32_t)(NEXT_S * MOVEMENT_RATE_HZ);
    next = next < live->end ? next : live->end - 1;
    if (s->phase == LIVE_COUNT_IN)
        next = at;
    const struct movement_frame *frames = reference_of(live, s->mirrored)->frames;
    if (pose_figure_make(&live->person, &frames[now], &frames[next], &live->ghost))
        live->page.ghost = &live->ghost;
}

static void fill_person(struct viewer_live *live, struct pose world_from_live)
{
    if (!live->frame || !live->frame->look.person)
        return;
    live->person = skeleton_transform(world_from_live, &live->frame->look.in_world);
    live->page.person = &live->person;
    fill_verdicts(live);
    fill_ghost(live);
}

// A figure from the origin to the side, turned so that it is seen there as it would be at the origin: the same pose
// looks the same on both sides.
static struct skeleton put_beside(const struct viewer_live *live, const struct skeleton *figure, struct vec3 to)
{
    const struct vec3 eye = live->shared->image.world_from_camera.translation, from = v3_sub(eye, to);
    const double yaw_rad = atan2(from.y, from.x) - atan2(eye.y, eye.x);
    const struct pose pose = {quat_from_rotation_vector(v3(0, 0, yaw_rad)), to};
    return skeleton_transform(pose, figure);
}

// The attempt at the reviewed instant, and the reference's pose on the same bones to its right.
static void fill_review(struct viewer_live *live)
{
    const struct live_attempt *a = &live->shown;
    const struct live_state *s = &live->shared->state.live;
    const bool judged = s->judged == s->finished && a->number == s->finished;
    live->page.comparison = judged && a->compared ? &a->comparison : NULL;
    live->page.mirrored = judged && a->mirrored;
    live->page.why_not = judged && !a->compared ? a->why : NULL;
    live->page.strip = a->strip;
    live->page.strip_cells = ATTEMPT_CELLS;
    if (!live->page.comparison || !live_attempt_skeleton(a, s->review_at_ns, &live->attempt_figure))
        return;
    struct vec3 at, left;
    const struct vec3 right = v3_scale(picture_right(live), 0.5 * BESIDE_M);
    const struct skeleton in_world = live->attempt_figure;
    struct skeleton figure = in_world;
    if (find_stance(&in_world, &at, &left))
        figure = skeleton_transform((struct pose){{0, 0, 0, 1}, v3_scale(at, -1)}, &in_world);
    live->attempt_figure = put_beside(live, &figure, right);
    live->page.attempt = &live->attempt_figure;
    const double frame = live_attempt_reference(a, s->review_at_ns);
    if (isnan(frame))
        return;
    const struct movement_frame pose = movement_at(&a->comparison.a, frame - a->first);
    if (pose_figure_make(&figure, &pose, &pose, &live->reference_figure)) {
        live->reference_figure = put_beside(live, &live->reference_figure, v3_scale(right, -1));
        live->page.reference = &live->reference_figure;
    }
    const int32_t f = (int32_t)lround((double)s->review_at_ns * 1e-9 * MOVEMENT_RATE_HZ);
    struct part_difference parts[PART_COUNT];
    comparison_differences(&a->comparison, &a->comparison.judged,
                           f < a->comparison.b.count ? f : a->comparison.b.count - 1, parts);
    for (int p = 0; p < PART_COUNT; p++)
        live->review_verdicts[p] = parts[judged_part(&a->comparison, p)].verdict;
    live->page.review_verdicts = live->review_verdicts;
}

// ---------------------------------------------------------------- the figures' viewpoint

void viewer_live_request(struct viewer_live *live, const struct viewer_surface *surface,
                         struct take_view_request *request)
{
    struct live_state *s = &live->shared->state.live;
    struct orbit orbit = s->orbit;
    const bool summary = s->phase == LIVE_SUMMARY;
    const double width = surface->width / surface->px_per_dp, height = surface->height / surface->px_per_dp;
    const struct ui_box free = summary ? screen_summary_figures(width, height) : layout_live_free(width, height);
    const double px = surface->px_per_dp;
    const struct ui_box box = {free.x * px, free.y * px, free.w * px, free.h * px};
    const struct lens lens = take_view_orbit_lens(surface->width, surface->height, box);
    if (summary)
        orbit.centre = v3(0, 0, FIGURE_MIDDLE_M);
    else if (live->shared->image.has_skeleton && live->shared->image.skeleton.confidence[JOINT_WAIST] > 0 &&
             s->screen != LIVE_MIRROR)
        s->orbit.centre = orbit.centre = v3_mix(orbit.centre, live->shared->image.skeleton.joint[JOINT_WAIST], 0.1);
    if (!summary)
        orbit.centre = v3_add(orbit.centre, v3_scale(picture_right(live), 0.5 * BESIDE_M));
    // The lens is made for one figure: for two the viewpoint goes back until both are inside.
    orbit.distance_m *= fmax(1, lens.fx / ORBIT_NEAREST_M / fmin(box.h / TALL_M, box.w / PAIR_WIDE_M));
    *request = (struct take_view_request){.lens = lens,
                                          .world_from_camera = orbit_world_from_camera(&orbit),
                                          .resolution_scale = request->resolution_scale,
                                          .detail = live->shared->state.detail,
                                          .error_px = live->shared->state.error_px};
}

// ---------------------------------------------------------------- the mirror's picture

static enum status upload_picture(struct viewer_live *live)
{
    const struct live_frame *f = live->frame;
    const struct lens *color = &f->calibration.color;
    if (live->picture && f->number == live->uploaded)
        return OK;
    live->uploaded = f->number;
    const struct gpu_texture_layout layout = {GPU_RGB8, color->width, color->height, GPU_LINEAR};
    return gpu_texture_put(&live->picture, live->shared->gpu, &layout, f->rgb);
}

static enum status make_scratch(struct viewer_live *live, size_t pixels)
{
    if (live->pixels == pixels)
        return OK;
    free(live->rgba);
    free(live->scratch);
    live->rgba = calloc(pixels, 4);
    live->scratch = malloc(2 * pixels * sizeof *live->scratch);
    live->pixels = live->rgba && live->scratch ? pixels : 0;
    return live->pixels ? OK : fail(ERR_MEMORY, "no memory for the sensor's picture");
}

// What the sensor sees before the actor.
static enum status upload_front(struct viewer_live *live)
{
    const struct live_frame *f = live->frame;
    const struct lens *color = &f->calibration.color;
    const struct gpu_texture_layout layout = {GPU_RGBA8, color->width, color->height, GPU_LINEAR};
    const struct skeleton actor =
        skeleton_transform(pose_inverse(live->shared->image.world_from_camera), &live->shared->image.skeleton);
    enum status status = make_scratch(live, lens_pixels(color));
    if (status != OK)
        return status;
    const struct live_occlusion how = {&f->calibration, f->rgb, f->depth, &actor, &live->body, live->scratch};
    live->has_front = live_occlusion_make(&how, live->rgba);
    return live->has_front ? gpu_texture_put(&live->front, live->shared->gpu, &layout, live->rgba) : OK;
}

static enum status draw_mirror(struct viewer_live *live, struct take_view_request *request)
{
    const struct live_frame *f = live->frame;
    if (!f || (!f->rgb && !live->uploaded))
        return OK;
    enum status status = f->rgb ? upload_picture(live) : OK; // an image that was lost: the one before it stays
    if (status != OK)
        return status;
    const struct pose world_from_live = take_from_live(live, live->shared->state.live.over ? 0 : MIRROR_M);
    request->lens = f->calibration.color;
    request->world_from_camera = pose_multiply(world_from_live, f->look.world_from_camera);
    request->camera = NULL; // the place's surface is not asked for: the live depth hides the actor
    request->camera_lost = !live->anchor.known && live->shared->image.has_skeleton;
    status = take_view_draw(live->shared->take_view, request, &live->shared->image);
    if (status != OK)
        return status;
    live->page.picture = live->picture;
    if (live->shared->image.has_skeleton && !live->shared->state.live.over) {
        if (f->rgb)
            status = upload_front(live);
        live->page.front = live->has_front ? live->front : NULL;
    }
    fill_person(live, world_from_live);
    return status;
}

// Beside the actor in the picture, to the right.
static struct pose pose_beside_actor(const struct viewer_live *live)
{
    struct pose p = take_from_live(live, 0);
    p.translation = v3_add(p.translation, v3_scale(picture_right(live), BESIDE_M));
    return p;
}

// Person and ghost where they stand in the room, drawn with the actor: hidden by it and by furniture, and not hidden by
// either where they are before it.
static void fill_overlay(struct viewer_live *live, const struct viewer_surface *surface,
                         struct take_view_request *request)
{
    const struct theme *t = theme_of(live->shared->state.dark);
    const double px = surface->px_per_dp;
    const struct ui_box all = {0, 0, surface->width / px, surface->height / px};
    const struct figure_view view = {request->lens, request->world_from_camera, cover_of(&request->lens, all), false};
    const struct figure limbs = {FIGURE_LIMBS, live->page.person, live->page.verdicts, false, 0},
                        ghost = {FIGURE_GHOST, live->page.ghost, NULL, false, 0};
    int count = 0;
    if (live->page.ghost)
        count += figure_strokes(t, &view, &ghost, live->strokes);
    if (live->page.person)
        count += figure_strokes(t, &view, &limbs, live->strokes + count);
    live->overlay = (struct overlay){.strokes = live->strokes, .stroke_count = count};
    request->overlay = count ? &live->overlay : NULL;
}

enum status viewer_live_draw(struct viewer_live *live, const struct viewer_surface *surface,
                             struct take_view_request *request)
{
    const struct live_state *s = &live->shared->state.live;
    live->page = (struct live_page){.file = live->shared->takes.file,
                                    .take = live->shared->takes.cards[live->shared->state.take].name,
                                    .image = &live->shared->image,
                                    .person_ns = -1};
    update_anchor(live);
    request->placement = (struct placement){.mirrored = s->mirrored};
    request->time_ns = s->at_ns;
    request->playing = s->phase == LIVE_DOING && !s->waits;
    request->loop = s->loop;
    live->image_mirrored = s->mirrored;
    if (s->phase == LIVE_SUMMARY) {
        const struct take_choice *choice = &live->shared->state.compare;
        if (s->of_takes) {
            live->page.names[0] = live->shared->takes.cards[choice->reference].name;
            live->page.names[1] = attempt_name(live->shared);
        }
        live->shared->image =
            (struct take_view_image){.lens = request->lens, .world_from_camera = request->world_from_camera};
        fill_review(live);
        return OK;
    }
    if (s->screen == LIVE_MIRROR)
        return draw_mirror(live, request);
    const bool same_world = take_view_is_located(live->shared->take_view) && live->frame && live->frame->look.in_place;
    if (s->screen == LIVE_ROOM && same_world) {
        fill_person(live, POSE_IDENTITY);
        fill_overlay(live, surface, request);
    }
    enum status status = take_view_draw(live->shared->take_view, request, &live->shared->image);
    if (status == OK && s->screen == LIVE_BESIDE)
        fill_person(live, pose_beside_actor(live));
    return status;
}

const struct live_page *viewer_live_page(const struct viewer_live *live) { return &live->page; }

struct viewer_live_view viewer_live_view_of(struct viewer_live *live)
{
    return (struct viewer_live_view){.page = &live->page,
                                     .attempt = &live->shown,
                                     .frame = live->frame,
                                     .sensor = live->sensor,
                                     .kept = live->kept,
                                     .no_points_told = live->no_points_told};
}

void viewer_live_print_stats(const struct viewer_live *live, FILE *out)
{
    if (!live->sensor)
        return;
    const struct live_sensor_state s = live_sensor_query(live->sensor);
    fprintf(out, "sensor    %lld frames tracked, %lld not; body points in %lld of their images%s%s\n",
            (long long)s.received, (long long)s.dropped, (long long)s.looked, *s.no_body_points ? ": " : "",
            s.no_body_points);
}
