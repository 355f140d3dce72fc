#include "app/live/live_occlusion.h"
#include "app/live/pose_figure.h"
#include "app/viewer/viewer.h"
#include "base/clamp.h"
#include "base/clock.h"
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

static enum status read_take(struct viewer *viewer, const char *name)
{
    struct viewer_live *l = &viewer->live;
    struct movement_source source;
    struct take *take = NULL;
    enum status status = movement_read(viewer->options.file, name, &l->reference, &source);
    if (status == OK)
        status = movement_mirror(&l->reference, &l->mirrored);
    if (status == OK)
        status = take_open(&take, viewer->recording, name);
    if (status != OK)
        return status;
    l->body = *take_body(take);
    const int64_t first = take_first_sample(take);
    if (first >= 0)
        l->offset_ns = take_entry(take, first)->time_ns - take_entry(take, 0)->time_ns;
    take_close(&take);
    return OK;
}

static void close_take(struct viewer_live *live)
{
    live_sensor_close(&live->sensor);
    live_keeper_close(&live->keeper);
    attempt_judge_close(&live->judge);
    live_attempt_free(&live->shown);
    movement_free(&live->reference);
    movement_free(&live->mirrored);
    live->frame = NULL;
    live->anchor = (struct live_anchor){0};
    live->offset_ns = live->uploaded = 0;
    live->kept = 0;
}

enum status viewer_live_open_take(struct viewer *v, const char *take)
{
    struct viewer_live *l = &v->live;
    close_take(l);
    enum status status = read_take(v, take);
    if (status != OK)
        return status;
    l->end = l->reference.count;
    const struct place *place = v->has_place ? &v->place : NULL;
    const struct live_keeper_options keep = {v->options.file, place};
    status = live_keeper_open(&l->keeper, &keep);
    const struct live_sensor_options how = {.sensor = v->options.sensor,
                                            .place = place,
                                            .reference = &l->reference,
                                            .mirrored = &l->mirrored,
                                            .keeper = l->keeper,
                                            .no_body_points = v->options.no_body_points,
                                            .every_frame = v->options.every_frame,
                                            .notify = v->options.wake,
                                            .notify_self = v->options.wake_self};
    return status == OK ? live_sensor_open(&l->sensor, &how) : status;
}

void viewer_live_close(struct viewer *viewer)
{
    struct viewer_live *l = &viewer->live;
    close_take(l);
    gpu_texture_close(&l->picture);
    gpu_texture_close(&l->front);
    free(l->rgba);
    free(l->scratch);
}

void viewer_live_suspend(struct viewer *viewer, bool suspend)
{
    if (viewer->live.sensor)
        live_sensor_suspend(viewer->live.sensor, suspend);
}

// ---------------------------------------------------------------- time

static void tell_sight(struct viewer *viewer, int64_t now_ns)
{
    struct viewer_live *l = &viewer->live;
    const struct live_sensor_state state = live_sensor_query(l->sensor);
    const struct live_frame *f = l->frame;
    struct live_sight sight = {.seeing =
                                   state.seeing && f &&
                                   (state.film || now_ns - state.received_ns < FROZEN_NS), // a film waits, or is late
                               .ended = state.ended && f && f->attempt == viewer->state.live.attempt,
                               .frame = f ? f->number : 0,
                               .trouble = state.trouble};
    if (f) {
        const struct live_look *look = &f->look;
        sight.person = look->person;
        sight.second_person = look->second_person;
        sight.in_place = look->in_place && take_view_is_located(viewer->take_view);
        sight.located = look->located && take_view_is_located(viewer->take_view);
        sight.judged = look->judged && f->attempt == viewer->state.live.attempt;
        sight.reference_ns = take_time_of(l, look->reference);
        sight.away_rad = look->away_rad;
    }
    live_state_on_sight(&viewer->state.live, &sight, now_ns);
    if (*state.no_body_points && !l->no_points_told) { // once; what is tracked from depth alone is less sure
        char notice[200];
        snprintf(notice, sizeof notice, "Tracked from depth alone: %.150s", state.no_body_points);
        view_state_notify(&viewer->state, notice, now_ns);
        l->no_points_told = true;
    }
}

static void adopt_result(struct viewer *viewer, int64_t now_ns)
{
    struct viewer_live *l = &viewer->live;
    struct live_attempt attempt;
    if (!l->judge || !attempt_judge_finished(l->judge, &attempt))
        return;
    attempt_judge_close(&l->judge);
    live_attempt_free(&l->shown);
    l->shown = attempt;
    const struct joint_samples *s = &attempt.samples;
    const int64_t length_ns = s->count ? s->at[s->count - 1].time_ns : 0;
    const struct comparison *c = &attempt.comparison;
    const struct live_result result = {.worst_ns = c->finding_count ? finding_moment_ns(c, &c->findings[0]) : 0,
                                       .score = c->score,
                                       .length_s = (double)length_ns * 1e-9,
                                       .findings = attempt.comparison.finding_count,
                                       .compared = attempt.compared};
    live_state_on_result(&viewer->state.live, &result, length_ns, now_ns);
    viewer->state.changed = true;
}

static void tell_kept(struct viewer *viewer, int64_t now_ns)
{
    struct viewer_live *l = &viewer->live;
    const struct live_keeper_state state = live_keeper_query(l->keeper);
    if (state.kept == l->kept)
        return;
    l->kept = state.kept;
    if (state.failed)
        view_state_warn(&viewer->state, state.sentence, now_ns);
    else
        view_state_notify(&viewer->state, state.sentence, now_ns);
}

void viewer_live_update(struct viewer *viewer, int64_t now_ns)
{
    struct viewer_live *l = &viewer->live;
    if (!l->sensor)
        return;
    const int64_t before = l->frame ? l->frame->number : 0;
    l->frame = live_sensor_latest(l->sensor);
    viewer->state.changed |= l->frame && l->frame->number != before && viewer->state.page == PAGE_LIVE;
    tell_sight(viewer, now_ns);
    adopt_result(viewer, now_ns);
    tell_kept(viewer, now_ns);
}

// An attempt has ended: judged on a thread of its own.
static void judge_attempt(struct viewer *viewer, int64_t now_ns)
{
    struct viewer_live *l = &viewer->live;
    struct joint_samples samples;
    if (l->judge) { // a loop that is shorter than judging it takes: the former is not shown
        attempt_judge_close(&l->judge);
    }
    if (live_sensor_take_samples(l->sensor, viewer->state.live.finished, &samples) < 0)
        view_state_warn(&viewer->state, status_message(), now_ns);
    const bool mirrored = viewer->state.live.attempt_mirrored;
    const struct attempt_task task = {.reference = reference_of(l, mirrored),
                                      .mirrored = mirrored,
                                      .first = l->first,
                                      .end = l->end,
                                      .number = viewer->state.live.finished,
                                      .notify = viewer->options.wake,
                                      .notify_self = viewer->options.wake_self};
    if (attempt_judge_start(&l->judge, &task, &samples) != OK) {
        const struct live_result none = {0};
        live_attempt_free(&l->shown);
        l->shown.number = viewer->state.live.finished;
        snprintf(l->shown.why, sizeof l->shown.why, "%.199s", status_message());
        live_state_on_result(&viewer->state.live, &none, 0, now_ns);
    }
}

void viewer_live_after_tick(struct viewer *viewer, int64_t now_ns)
{
    struct viewer_live *l = &viewer->live;
    struct live_state *s = &viewer->state.live;
    if (!l->sensor)
        return;
    if (s->finished != l->finished) {
        l->finished = s->finished;
        judge_attempt(viewer, now_ns);
    }
    const int32_t at = frame_at(l, s->at_ns);
    l->first = frame_at(l, s->marked_from_ns);
    l->end = frame_at(l, s->marked_to_ns) + 1;
    const int32_t behind = at - (int32_t)(BEHIND_S * MOVEMENT_RATE_HZ),
                  ahead = at + (int32_t)(AHEAD_S * MOVEMENT_RATE_HZ);
    const struct live_wish wish = {.attempt = s->attempt,
                                   .run = s->phase == LIVE_DOING,
                                   .shown = {.frame = at,
                                             .first = behind > l->first ? behind : l->first,
                                             .end = ahead < l->end ? ahead : l->end,
                                             .mirrored = s->mirrored}};
    live_sensor_wish(l->sensor, &wish);
    if (s->keep_wanted) {
        s->keep_wanted = false;
        live_keeper_keep(l->keeper);
    }
}

// ---------------------------------------------------------------- the two worlds

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

// While nothing moves: the actor is put beside the person, facing alike.
static void update_anchor(struct viewer *viewer)
{
    struct viewer_live *l = &viewer->live;
    const struct live_state *s = &viewer->state.live;
    struct vec3 person, left, actor, actor_left;
    if ((s->phase == LIVE_DOING && l->anchor.known) || s->phase == LIVE_SUMMARY || !l->frame ||
        !l->frame->look.person || !viewer->image.has_skeleton ||
        !find_stance(&l->frame->look.in_world, &person, &left) ||
        !find_stance(&viewer->image.skeleton, &actor, &actor_left))
        return;
    if (l->image_mirrored) // the joints are where the mirror shows them, under their own names
        actor_left = v3_scale(actor_left, -1);
    l->anchor = (struct live_anchor){.known = true,
                                     .yaw_rad = atan2(actor_left.y, actor_left.x) - atan2(left.y, left.x),
                                     .person = person,
                                     .left = left,
                                     .actor = actor};
}

// offset_m: how far to the person's left the actor stands.
static struct pose take_from_live(const struct viewer *viewer, double offset_m)
{
    const struct live_anchor *a = &viewer->live.anchor;
    if (!a->known)
        return POSE_IDENTITY;
    const struct quat turn = quat_from_rotation_vector(v3(0, 0, a->yaw_rad));
    const struct vec3 meets = v3_add(a->person, v3_scale(a->left, offset_m));
    return (struct pose){turn, v3_sub(a->actor, quat_rotate(turn, meets))};
}

// Horizontal, to the right of the picture: the figures stand so beside each other from whatever side they are seen.
static struct vec3 picture_right(const struct viewer *viewer)
{
    return quat_rotate(orbit_world_from_camera(&viewer->state.live.orbit).rotation, v3(1, 0, 0));
}

// ---------------------------------------------------------------- the page

static void fill_verdicts(struct viewer *viewer)
{
    struct viewer_live *l = &viewer->live;
    const struct live_look *look = &l->frame->look;
    if (viewer->state.live.phase != LIVE_DOING || !look->judged || l->frame->attempt != viewer->state.live.attempt)
        return;
    for (int p = 0; p < PART_COUNT; p++)
        l->verdicts[p] = look->parts[p].verdict;
    l->page.verdicts = l->verdicts;
    l->page.parts = look->parts;
    l->page.person_ns = take_time_of(l, look->reference);
}

// The pose that comes next, where the person stands.
static void fill_ghost(struct viewer *viewer)
{
    struct viewer_live *l = &viewer->live;
    const struct live_look *look = &l->frame->look;
    const struct live_state *s = &viewer->state.live;
    if (!s->ghost || (s->phase != LIVE_DOING && s->phase != LIVE_COUNT_IN) || !l->reference.count)
        return;
    const int32_t at = frame_at(l, s->at_ns), now = l->page.verdicts ? look->reference : at;
    int32_t next = now + (int32_t)(NEXT_S * MOVEMENT_RATE_HZ);
    next = next < l->end ? next : l->end - 1;
    if (s->phase == LIVE_COUNT_IN)
        next = at;
    const struct movement_frame *frames = reference_of(l, s->mirrored)->frames;
    if (pose_figure_make(&l->person, &frames[now], &frames[next], &l->ghost))
        l->page.ghost = &l->ghost;
}

static void fill_person(struct viewer *viewer, struct pose world_from_live)
{
    struct viewer_live *l = &viewer->live;
    if (!l->frame || !l->frame->look.person)
        return;
    l->person = skeleton_transform(world_from_live, &l->frame->look.in_world);
    l->page.person = &l->person;
    fill_verdicts(viewer);
    fill_ghost(viewer);
}

// The attempt at the reviewed instant, and the reference's pose on the same bones to its right.
static void fill_review(struct viewer *viewer)
{
    struct viewer_live *l = &viewer->live;
    const struct live_attempt *a = &l->shown;
    const struct live_state *s = &viewer->state.live;
    const bool judged = s->judged == s->finished && a->number == s->finished;
    l->page.comparison = judged && a->compared ? &a->comparison : NULL;
    l->page.mirrored = judged && a->mirrored;
    l->page.why_not = judged && !a->compared ? a->why : NULL;
    l->page.strip = a->strip;
    l->page.strip_cells = ATTEMPT_CELLS;
    if (!l->page.comparison || !live_attempt_skeleton(a, s->review_at_ns, &l->attempt_figure))
        return;
    struct vec3 at, left;
    struct skeleton *figure = &l->attempt_figure;
    const struct vec3 right = v3_scale(picture_right(viewer), 0.5 * BESIDE_M);
    if (find_stance(figure, &at, &left)) // it stands right of the origin
        *figure = skeleton_transform((struct pose){{0, 0, 0, 1}, v3_sub(right, at)}, figure);
    l->page.attempt = figure;
    const double frame = live_attempt_reference(a, s->review_at_ns);
    if (isnan(frame))
        return;
    const struct movement_frame pose = movement_at(reference_of(l, a->mirrored), frame);
    if (pose_figure_make(figure, &pose, &pose, &l->reference_figure)) {
        for (int j = 0; j < JOINT_COUNT; j++)
            l->reference_figure.joint[j] = v3_sub(l->reference_figure.joint[j], v3_scale(right, 2));
        l->page.reference = &l->reference_figure;
    }
    const int32_t f = (int32_t)lround((double)s->review_at_ns * 1e-9 * MOVEMENT_RATE_HZ);
    struct part_difference parts[PART_COUNT];
    part_differences(&a->comparison.a, &a->comparison.judged, &a->comparison.timeline,
                     f < a->comparison.b.count ? f : a->comparison.b.count - 1, parts);
    for (int p = 0; p < PART_COUNT; p++)
        l->review_verdicts[p] = parts[judged_part(&a->comparison, p)].verdict;
    l->page.review_verdicts = l->review_verdicts;
}

// ---------------------------------------------------------------- the figures' viewpoint

void viewer_live_request(struct viewer *viewer, const struct viewer_surface *surface, struct take_view_request *request)
{
    struct live_state *s = &viewer->state.live;
    struct orbit orbit = s->orbit;
    const bool summary = s->phase == LIVE_SUMMARY;
    const double width = surface->width / surface->px_per_dp, height = surface->height / surface->px_per_dp;
    const struct ui_box free = summary ? screen_summary_figures(width, height) : layout_live_free(width, height);
    const double px = surface->px_per_dp;
    const struct ui_box box = {free.x * px, free.y * px, free.w * px, free.h * px};
    const struct lens lens = take_view_orbit_lens(surface->width, surface->height, box);
    if (summary)
        orbit.centre = v3(0, 0, FIGURE_MIDDLE_M);
    else if (viewer->image.has_skeleton && viewer->image.skeleton.confidence[JOINT_WAIST] > 0 &&
             s->screen != LIVE_MIRROR)
        s->orbit.centre = orbit.centre = v3_mix(orbit.centre, viewer->image.skeleton.joint[JOINT_WAIST], 0.1);
    if (!summary)
        orbit.centre = v3_add(orbit.centre, v3_scale(picture_right(viewer), 0.5 * BESIDE_M));
    // The lens is made for one figure: for two the viewpoint goes back until both are inside.
    orbit.distance_m *= fmax(1, lens.fx / ORBIT_NEAREST_M / fmin(box.h / TALL_M, box.w / PAIR_WIDE_M));
    *request = (struct take_view_request){.lens = lens,
                                          .world_from_camera = orbit_world_from_camera(&orbit),
                                          .resolution_scale = request->resolution_scale,
                                          .error_px = viewer->state.error_px};
}

// ---------------------------------------------------------------- the mirror's picture

static enum status upload_picture(struct viewer *viewer)
{
    struct viewer_live *l = &viewer->live;
    const struct live_frame *f = l->frame;
    const struct lens *color = &f->calibration.color;
    if (l->picture && f->number == l->uploaded)
        return OK;
    l->uploaded = f->number;
    const struct gpu_texture_layout layout = {GPU_RGB8, color->width, color->height, GPU_LINEAR};
    return gpu_texture_put(&l->picture, viewer->gpu, &layout, f->rgb);
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
static enum status upload_front(struct viewer *viewer)
{
    struct viewer_live *l = &viewer->live;
    const struct live_frame *f = l->frame;
    const struct lens *color = &f->calibration.color;
    const struct gpu_texture_layout layout = {GPU_RGBA8, color->width, color->height, GPU_LINEAR};
    const struct skeleton actor =
        skeleton_transform(pose_inverse(viewer->image.world_from_camera), &viewer->image.skeleton);
    enum status status = make_scratch(l, lens_pixels(color));
    if (status != OK)
        return status;
    const struct live_occlusion how = {&f->calibration, f->rgb, f->depth, &actor, &l->body, l->scratch};
    l->has_front = live_occlusion_make(&how, l->rgba);
    return l->has_front ? gpu_texture_put(&l->front, viewer->gpu, &layout, l->rgba) : OK;
}

static enum status draw_mirror(struct viewer *viewer, struct take_view_request *request)
{
    struct viewer_live *l = &viewer->live;
    const struct live_frame *f = l->frame;
    if (!f || (!f->rgb && !l->uploaded))
        return OK;
    enum status status = f->rgb ? upload_picture(viewer) : OK; // an image that was lost: the one before it stays
    if (status != OK)
        return status;
    const struct pose world_from_live = take_from_live(viewer, viewer->state.live.over ? 0 : MIRROR_M);
    request->lens = f->calibration.color;
    request->world_from_camera = pose_multiply(world_from_live, f->look.world_from_camera);
    request->camera = NULL; // the place's surface is not asked for: the live depth hides the actor
    request->camera_lost = !l->anchor.known && viewer->image.has_skeleton;
    status = take_view_draw(viewer->take_view, request, &viewer->image);
    if (status != OK)
        return status;
    l->page.picture = l->picture;
    if (viewer->image.has_skeleton && !viewer->state.live.over) {
        if (f->rgb)
            status = upload_front(viewer);
        l->page.front = l->has_front ? l->front : NULL;
    }
    fill_person(viewer, world_from_live);
    return status;
}

// Beside the actor in the picture, to the right.
static struct pose pose_beside_actor(const struct viewer *viewer)
{
    struct pose p = take_from_live(viewer, 0);
    p.translation = v3_add(p.translation, v3_scale(picture_right(viewer), BESIDE_M));
    return p;
}

// Person and ghost where they stand in the room, drawn with the actor: hidden by it and by furniture, and not hidden by
// either where they are before it.
static void fill_overlay(struct viewer *viewer, const struct viewer_surface *surface, struct take_view_request *request)
{
    struct viewer_live *l = &viewer->live;
    const struct theme *t = theme_of(viewer->state.dark);
    const double px = surface->px_per_dp;
    const struct ui_box all = {0, 0, surface->width / px, surface->height / px};
    const struct figure_view view = {request->lens, request->world_from_camera, cover_of(&request->lens, all), false};
    const struct figure limbs = {FIGURE_LIMBS, l->page.person, l->page.verdicts, false, 0},
                        ghost = {FIGURE_GHOST, l->page.ghost, NULL, false, 0};
    int count = 0;
    if (l->page.ghost)
        count += figure_strokes(t, &view, &ghost, l->strokes);
    if (l->page.person)
        count += figure_strokes(t, &view, &limbs, l->strokes + count);
    l->overlay = (struct overlay){.strokes = l->strokes, .stroke_count = count};
    request->overlay = count ? &l->overlay : NULL;
}

enum status viewer_live_draw(struct viewer *v, const struct viewer_surface *surface, struct take_view_request *request)
{
    struct viewer_live *l = &v->live;
    const struct live_state *s = &v->state.live;
    l->page = (struct live_page){
        .file = v->takes.file, .take = v->takes.cards[v->state.take].name, .image = &v->image, .person_ns = -1};
    update_anchor(v);
    request->placement = (struct placement){.mirrored = s->mirrored};
    request->time_ns = s->at_ns;
    request->playing = s->phase == LIVE_DOING && !s->waits;
    request->loop = s->loop;
    l->image_mirrored = s->mirrored;
    if (s->phase == LIVE_SUMMARY) {
        v->image = (struct take_view_image){.lens = request->lens, .world_from_camera = request->world_from_camera};
        fill_review(v);
        return OK;
    }
    if (s->screen == LIVE_MIRROR)
        return draw_mirror(v, request);
    const bool same_world = take_view_is_located(v->take_view) && l->frame && l->frame->look.in_place;
    if (s->screen == LIVE_ROOM && same_world) {
        fill_person(v, POSE_IDENTITY);
        fill_overlay(v, surface, request);
    }
    enum status status = take_view_draw(v->take_view, request, &v->image);
    if (status == OK && s->screen == LIVE_BESIDE)
        fill_person(v, pose_beside_actor(v));
    return status;
}

void viewer_live_presented(struct viewer *viewer, int64_t now_ns)
{
    struct viewer_live *l = &viewer->live;
    if (!l->frame || l->frame->number == l->drawn_frame || viewer->state.page != PAGE_LIVE)
        return;
    l->drawn_frame = l->frame->number;
    const double ms = (double)(now_ns - l->frame->received_ns) * 1e-6;
    l->latency_ms += ms;
    l->latency_max_ms = fmax(l->latency_max_ms, ms);
    l->presented++;
}
