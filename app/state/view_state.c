#include "app/state/view_state.h"

#include "base/clamp.h"
#include "base/text.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- room state

// Chosen by hand: at that distance, and at that standard deviation, a label has half its opacity.
static const double HALF_DISTANCE_M = 8, HALF_SIGMA_M = 0.25, GONE_SHARE = 0.5;

struct room_state room_state_start(void)
{
    return (struct room_state){.names = true,
                               .filmed = true,
                               .card = ROOM_NOTHING,
                               .wanted = ROOM_NOTHING,
                               .map_orbit = {{0, 0, 0.5}, 0.6, 0.75, 7}};
}

bool room_state_type(struct room_state *s, const char *text)
{
    return (*s->filter || *text != ' ') && text_append(s->filter, sizeof s->filter, text);
}

void room_state_want(struct room_state *s, int thing) { s->wanted = s->wanted == thing ? ROOM_NOTHING : thing; }

double room_label_opacity(double distance_m, double sigma_m, bool gone)
{
    const double far = distance_m / HALF_DISTANCE_M, doubt = sigma_m / HALF_SIGMA_M;
    const double share = 1 / (1 + far * far) / (1 + doubt * doubt);
    if (!isfinite(share))
        return 0;
    return gone ? share * GONE_SHARE : share;
}

// ---------------------------------------------------------------- view state

static const double PI = 3.14159265358979323846;
// Durations, chosen by hand.
static const int64_t NOTICE_NS = 3000000000, WARNING_NS = 8000000000, CONTROLS_NS = 4000000000, FROZEN_NS = 1500000000;
static const int64_t MOVED_NS = 2000000000; // a tag must be reported as moved for this long before a notice
static const int64_t LIVE_PAUSE_NS = 200000000, LIVE_POLL_NS = 15000000;
static const int64_t DOUBLE_TAP_NS = 350000000;
static const double APPEAR_S = 0.2, FADE_S = 0.7, CROSSFADE_S = 0.5;

const double view_speeds[VIEW_SPEEDS] = {0.1, 0.25, 0.5, 0.75, 1, 1.25, 1.5, 2};

const double view_text_sizes[VIEW_TEXT_SIZES] = {1, 1.25, 1.5};

struct view_state view_state_start(int take_count, bool dark, int64_t now_ns)
{
    return (struct view_state){.page = take_count == 1 ? PAGE_WATCH : PAGE_TAKES,
                               .take_count = take_count,
                               .take_wanted = take_count == 1,
                               .playback = playback_start(0, 1),
                               .orbiting = true,
                               .avatar_progress = 1,
                               .error_px = 1,
                               .text_size = 1,
                               .tag_moved_notified = -1,
                               .room = room_state_start(),
                               .dark = dark,
                               .last_input_ns = now_ns,
                               .now_ns = now_ns,
                               .changed = true};
}

void view_state_open_take(struct view_state *s, int64_t length_ns, int64_t frames, const struct orbit *orbit,
                          int64_t now_ns)
{
    double speed = s->playback.speed;
    bool loop = s->playback.loop;
    s->playback = playback_start(length_ns, frames);
    s->playback.speed = speed;
    s->playback.loop = loop;
    playback_play(&s->playback, now_ns, true);
    s->orbit = s->orbit_start = *orbit;
    s->facing_rad = orbit->angle_rad; // until the actor is known
    s->placement = (struct placement){0};
    s->avatar_shown = false;
    s->crossfade = 0;
    s->page = PAGE_WATCH;
    s->sheet = SHEET_NONE;
    s->moving = s->scrubbing = s->take_wanted = false;
    s->trim.from_ns = 0;
    s->trim.to_ns = length_ns;
    if (s->live.present) {
        s->page = PAGE_LIVE;
        playback_play(&s->playback, now_ns, false);
        live_state_open_take(&s->live, length_ns, orbit, now_ns);
    }
    view_state_on_input(s, now_ns);
}

void view_state_fail(struct view_state *s, const char *sentence)
{
    s->page = PAGE_TROUBLE;
    s->trouble = sentence;
    s->take_wanted = false;
    s->changed = true;
}

void view_state_on_input(struct view_state *s, int64_t now_ns)
{
    s->last_input_ns = now_ns;
    s->changed = true;
}

// What is said again and again is drawn once.
static void say(struct view_state *s, const char *notice, bool warns, int64_t until_ns)
{
    char text[sizeof s->notice];
    snprintf(text, sizeof text, "%s", notice);
    s->changed |= strcmp(text, s->notice) || s->notice_warns != warns;
    memcpy(s->notice, text, sizeof text);
    s->notice_warns = warns;
    s->notice_until_ns = until_ns;
}

void view_state_notify(struct view_state *s, const char *notice, int64_t now_ns)
{
    say(s, notice, false, now_ns + NOTICE_NS);
}

void view_state_warn(struct view_state *s, const char *notice, int64_t now_ns)
{
    say(s, notice, true, now_ns + WARNING_NS);
}

// ---------------------------------------------------------------- actions

static void change_speed(struct view_state *s, int by, int64_t now_ns)
{
    int nearest = 0, last = VIEW_SPEEDS - 1;
    for (int i = 1; i <= last; i++)
        if (fabs(view_speeds[i] - s->playback.speed) < fabs(view_speeds[nearest] - s->playback.speed))
            nearest = i;
    const int next = clamp_int(nearest + by, 0, last);
    playback_set_speed(&s->playback, now_ns, view_speeds[next]);
}

static void go_back(struct view_state *s)
{
    if (s->sheet != SHEET_NONE)
        s->sheet = SHEET_NONE;
    else if (s->page == PAGE_WATCH && s->moving)
        s->moving = false;
    else if (s->page == PAGE_LIVE && s->live.phase != LIVE_READY)
        live_state_to_ready(&s->live, s->now_ns);
    else if (s->page != PAGE_TAKES && s->take_count > 1)
        s->page = PAGE_TAKES;
    else
        s->quit = true;
}

static void toggle_sheet(struct view_state *s, enum view_sheet sheet)
{
    s->sheet = s->sheet == sheet ? SHEET_NONE : sheet;
}

static void next_text_size(struct view_state *s)
{
    int i = 0;
    while (i < VIEW_TEXT_SIZES && view_text_sizes[i] <= s->text_size + 0.01)
        i++;
    s->text_size = view_text_sizes[i % VIEW_TEXT_SIZES];
}

// Up and down in a list that is open.
static bool steps_in_list(struct view_state *s, enum view_action action)
{
    const bool list = s->sheet != SHEET_NONE || (s->page == PAGE_LIVE && s->live.phase == LIVE_SUMMARY);
    if (!list || s->page == PAGE_TAKES || (action != DO_PREVIOUS && action != DO_NEXT))
        return false;
    s->list_steps += action == DO_NEXT ? 1 : -1;
    return true;
}

// Actions that mean the same on every page.
static bool do_anywhere(struct view_state *s, enum view_action action)
{
    switch (action) {
    case DO_BACK: go_back(s); return true;
    case DO_THEME: s->dark = !s->dark; return true;
    case DO_TEXT_SIZE: next_text_size(s); return true;
    case DO_FULLSCREEN: s->fullscreen = !s->fullscreen; return true;
    case DO_QUIT: s->quit = true; return true;
    case DO_TAKES:
        s->page = s->take_count > 0 ? PAGE_TAKES : s->page;
        s->sheet = SHEET_NONE;
        return true;
    default: return false;
    }
}

// A row up or down stays within the page; one take on from the last is the first.
static void select_take(struct view_state *s, int by)
{
    const int to = s->take + by;
    if (to >= 0 && to < s->take_count)
        s->take = to;
    else if (abs(by) == 1)
        s->take = (to + s->take_count) % s->take_count;
}

static void do_on_takes(struct view_state *s, enum view_action action)
{
    const int columns = s->take_columns > 1 ? s->take_columns : 1;
    if (s->take_count < 1)
        return;
    if (action == DO_STEP_BACK || action == DO_STEP_ON)
        select_take(s, action == DO_STEP_ON ? 1 : -1);
    else if (action == DO_PREVIOUS || action == DO_NEXT)
        select_take(s, action == DO_NEXT ? columns : -columns);
    else if (action == DO_TO_START || action == DO_TO_END)
        s->take = action == DO_TO_END ? s->take_count - 1 : 0;
    else if (action == DO_CHOOSE || action == DO_PLAY_PAUSE)
        view_state_choose_take(s, s->take);
}

// True: the action concerned the playback.
static bool do_playback(struct view_state *s, enum view_action action, int64_t now_ns)
{
    struct playback_clock *p = &s->playback;
    switch (action) {
    case DO_PLAY_PAUSE:
    case DO_CHOOSE: playback_play(p, now_ns, !p->playing); return true;
    case DO_STEP_BACK: playback_step(p, now_ns, -1); return true;
    case DO_STEP_ON: playback_step(p, now_ns, 1); return true;
    case DO_TO_START: playback_seek(p, now_ns, 0); return true;
    case DO_TO_END: playback_seek(p, now_ns, p->length_ns); return true;
    case DO_SLOWER: change_speed(s, -1, now_ns); return true;
    case DO_FASTER: change_speed(s, 1, now_ns); return true;
    case DO_LOOP: playback_set_loop(p, now_ns, !p->loop); return true;
    default: return false;
    }
}

// True: the action concerned the ends of the take.
static bool do_trim(struct view_state *s, enum view_action action, int64_t now_ns)
{
    struct view_trim *t = &s->trim;
    const int64_t at = playback_at(&s->playback, now_ns), length = s->playback.length_ns;
    if (!t->offered)
        return false;
    switch (action) {
    case DO_MARK_FROM:
        t->from_ns = at;
        t->to_ns = t->to_ns > at ? t->to_ns : length;
        return true;
    case DO_MARK_TO:
        t->to_ns = at;
        t->from_ns = t->from_ns < at ? t->from_ns : 0;
        return true;
    case DO_KEEP: t->wanted = t->from_ns > 0 || t->to_ns < length; return true;
    default: return false;
    }
}

// True: the action concerned the side from which the actor is seen.
static bool do_look(struct view_state *s, enum view_action action)
{
    if (action < DO_SEE_FRONT || action > DO_SEE_START)
        return false;
    if (s->orbiting)
        orbit_look(&s->orbit, (enum orbit_view)(action - DO_SEE_FRONT), s->facing_rad, &s->orbit_start);
    return true;
}

static void do_on_watch(struct view_state *s, enum view_action action, int64_t now_ns)
{
    if (do_playback(s, action, now_ns) || do_trim(s, action, now_ns) || do_look(s, action))
        return;
    switch (action) {
    case DO_MIRROR: s->placement.mirrored = !s->placement.mirrored; break;
    case DO_ORBIT:
        s->orbit_requested = !s->orbiting;
        s->orbiting = s->orbit_requested || !s->camera.seeing;
        if (s->orbiting && !s->orbit_requested)
            view_state_notify(s, "There is no camera image", now_ns);
        break;
    case DO_SKELETON: s->skeleton = !s->skeleton; break;
    case DO_SOURCES: s->sources = !s->sources; break;
    case DO_INSET: s->inset = !s->inset; break;
    case DO_FRAME_GRAPH: s->frame_graph = !s->frame_graph; break;
    case DO_MOVE:
        s->moving = !s->moving;
        s->sheet = SHEET_NONE;
        break;
    case DO_RESET_PLACEMENT: s->placement = (struct placement){.mirrored = s->placement.mirrored}; break;
    case DO_SCREENSHOT: s->screenshot_wanted = true; break;
    case DO_LAYERS: toggle_sheet(s, SHEET_LAYERS); break;
    case DO_SPEED: toggle_sheet(s, SHEET_SPEED); break;
    case DO_NAMES: s->room.names = !s->room.names; break;
    case DO_MAP: s->room.map = !s->room.map && s->room.has_place; break;
    case DO_FILMED: s->room.filmed = !s->room.filmed; break;
    case DO_THINGS:
        if (s->room.thing_count > 0)
            toggle_sheet(s, SHEET_THINGS);
        s->room.filter[0] = 0;
        break;
    default: break;
    }
}

bool live_action_of(enum view_action action, enum live_phase phase, enum live_action *out)
{
    const bool summary = phase == LIVE_SUMMARY;
    const enum live_action step_on = phase == LIVE_READY ? LIVE_DO_MIRROR : LIVE_DO_MARK_TO;
    switch (action) {
    case DO_PLAY_PAUSE:
    case DO_CHOOSE: *out = LIVE_DO_START; return true;
    case DO_STEP_BACK: *out = summary ? LIVE_DO_BACK_STEP : LIVE_DO_MARK_FROM; return true;
    case DO_STEP_ON: *out = summary ? LIVE_DO_ON_STEP : step_on; return true;
    case DO_SLOWER: *out = LIVE_DO_SLOWER; return true;
    case DO_FASTER: *out = LIVE_DO_FASTER; return true;
    case DO_LOOP: *out = LIVE_DO_LOOP; return true;
    case DO_MIRROR: *out = LIVE_DO_MIRROR; return true;
    case DO_SCREEN:
    case DO_ORBIT: *out = LIVE_DO_SCREEN; return true;
    case DO_PACE:
    case DO_MOVE: *out = LIVE_DO_PACE; return true;
    case DO_OVER: *out = LIVE_DO_OVER; return true;
    case DO_GHOST:
    case DO_SKELETON: *out = LIVE_DO_GHOST; return true;
    case DO_HANDS_FREE: *out = LIVE_DO_HANDS_FREE; return true;
    case DO_MARK_FROM: *out = LIVE_DO_MARK_FROM; return true;
    case DO_MARK_TO: *out = LIVE_DO_MARK_TO; return true;
    case DO_KEEP: *out = LIVE_DO_KEEP; return true;
    case DO_SCREENSHOT: *out = summary ? LIVE_DO_KEEP : LIVE_DO_OVER; return true;
    default: return false;
    }
}

void view_state_do(struct view_state *s, enum view_action action, int64_t now_ns)
{
    enum live_action live;
    if (action == DO_NOTHING)
        return;
    view_state_on_input(s, now_ns);
    if (do_anywhere(s, action) || steps_in_list(s, action))
        return;
    if (s->page == PAGE_LIVE && action == DO_LAYERS)
        toggle_sheet(s, SHEET_LIVE);
    else if (s->page == PAGE_TAKES)
        do_on_takes(s, action);
    else if (s->page == PAGE_WATCH)
        do_on_watch(s, action, now_ns);
    else if (s->page == PAGE_LIVE && live_action_of(action, s->live.phase, &live))
        live_state_do(&s->live, live, now_ns);
}

void view_state_choose_take(struct view_state *s, int take)
{
    s->take = take;
    s->take_wanted = true;
    s->changed = true;
}

void view_state_scrub(struct view_state *s, bool held, double share, int64_t now_ns)
{
    if (held && !s->scrubbing)
        s->was_playing = s->playback.playing;
    if (held) {
        playback_play(&s->playback, now_ns, false);
        playback_seek(&s->playback, now_ns, llround(fmin(fmax(share, 0), 1) * (double)s->playback.length_ns));
        view_state_on_input(s, now_ns);
    } else if (s->scrubbing) {
        playback_play(&s->playback, now_ns, s->was_playing);
        s->changed = true;
    }
    s->scrubbing = held;
}

void view_state_set_speed(struct view_state *s, double speed, int64_t now_ns)
{
    playback_set_speed(&s->playback, now_ns, speed);
    view_state_on_input(s, now_ns);
}

void view_state_set_text_size(struct view_state *s, double size, int64_t now_ns)
{
    s->text_size = size;
    view_state_on_input(s, now_ns);
}

void view_state_set_error(struct view_state *s, double error_px)
{
    s->changed |= error_px != s->error_px;
    s->error_px = error_px;
}

void view_state_set_yaw(struct view_state *s, double yaw_rad)
{
    s->placement.yaw_rad = remainder(yaw_rad, 2 * PI);
    s->changed = true;
}

// ---------------------------------------------------------------- things

void view_state_open_card(struct view_state *s, int thing, int64_t now_ns)
{
    const bool same = s->sheet == SHEET_CARD && s->room.card == thing;
    s->sheet = same ? SHEET_NONE : SHEET_CARD;
    s->room.card = same ? ROOM_NOTHING : thing;
    s->moving = false;
    view_state_on_input(s, now_ns);
}

void view_state_find_thing(struct view_state *s, int thing, int64_t now_ns)
{
    room_state_want(&s->room, thing);
    s->sheet = SHEET_NONE;
    view_state_on_input(s, now_ns);
}

void view_state_map_gesture(struct view_state *s, const struct gesture *g, double notches, int64_t now_ns)
{
    orbit_move(&s->room.map_orbit, g->drag_x + g->push_x, g->drag_y + g->push_y,
               log(g->spread) / log(1 / 0.9) + notches);
    view_state_on_input(s, now_ns);
}

// ---------------------------------------------------------------- fingers

void view_state_gesture(struct view_state *s, const struct gesture *g, const struct floor_drag *at, int64_t now_ns)
{
    bool still =
        g->drag_x == 0 && g->drag_y == 0 && g->push_x == 0 && g->push_y == 0 && g->spread == 1 && g->twist == 0;
    if (s->page == PAGE_LIVE && !still) {
        orbit_move(&s->live.orbit, g->drag_x + g->push_x, g->drag_y + g->push_y, log(g->spread) / log(1 / 0.9));
        view_state_on_input(s, now_ns);
    }
    if (s->page != PAGE_WATCH || (still && !g->tapped))
        return;
    const bool twice = g->tapped && s->tapped_ns && now_ns - s->tapped_ns < DOUBLE_TAP_NS;
    s->tapped_ns = g->tapped && !twice ? now_ns : 0;
    if (twice && !s->moving)
        do_look(s, DO_SEE_START);
    if (g->tapped && s->sheet != SHEET_NONE) {
        s->sheet = SHEET_NONE;
        view_state_on_input(s, now_ns);
    } else if (g->tapped && view_state_controls_shown(s) && s->playback.playing && !s->moving) {
        s->last_input_ns = now_ns - CONTROLS_NS; // a tap on the image hides the controls, another shows them
        s->changed = true;
    } else {
        view_state_on_input(s, now_ns);
    }
    if (s->moving) {
        if (at) {
            s->placement.x_m += at->to_x - at->from_x;
            s->placement.y_m += at->to_y - at->from_y;
        }
        view_state_set_yaw(s, s->placement.yaw_rad - g->twist);
    } else if (s->orbiting) {
        orbit_move(&s->orbit, g->drag_x + g->push_x, g->drag_y + g->push_y, log(g->spread) / log(1 / 0.9));
    }
}

bool view_state_types(const struct view_state *s) { return s->page == PAGE_WATCH && s->sheet == SHEET_THINGS; }

void view_state_wheel(struct view_state *s, double notches, int64_t now_ns)
{
    if (s->page == PAGE_LIVE)
        orbit_move(&s->live.orbit, 0, 0, notches);
    if (s->page != PAGE_WATCH && s->page != PAGE_LIVE)
        return;
    if (s->moving)
        view_state_set_yaw(s, s->placement.yaw_rad + notches * PI / 36);
    else if (s->page == PAGE_WATCH && s->orbiting)
        orbit_move(&s->orbit, 0, 0, notches);
    view_state_on_input(s, now_ns);
}

// ---------------------------------------------------------------- camera and time

// Once for each tag, and only for one that stays moved: in a single image it may be half occluded.
static void on_moved_tags(struct view_state *s, int64_t now_ns)
{
    const struct view_camera *camera = &s->camera;
    if (!camera->moved_tags)
        s->tag_moved_ns = 0;
    else if (!s->tag_moved_ns)
        s->tag_moved_ns = now_ns;
    if (!camera->moved_tags || camera->first_moved == s->tag_moved_notified || now_ns - s->tag_moved_ns < MOVED_NS)
        return;
    s->tag_moved_notified = camera->first_moved;
    const bool more = camera->moved_tags > 1;
    char notice[sizeof s->notice];
    snprintf(notice, sizeof notice, "Tag %d%s not where the place has %s, and ignored. Put %s back, or sweep again",
             (int)camera->first_moved, more ? " and others are" : " is", more ? "them" : "it", more ? "them" : "it");
    view_state_warn(s, notice, now_ns);
}

void view_state_on_camera(struct view_state *s, const struct view_camera *camera, int64_t now_ns)
{
    const bool frame_is_new = camera->frame != s->camera.frame;
    if (frame_is_new || camera->seeing != s->camera.seeing || strcmp(camera->trouble, s->camera_trouble))
        s->changed = true;
    s->camera = *camera;
    s->camera.trouble = NULL;
    snprintf(s->camera_trouble, sizeof s->camera_trouble, "%s", camera->trouble);
    if (camera->placed && frame_is_new) {
        s->placed_ns = now_ns;
        s->ever_placed = true;
    }
    on_moved_tags(s, now_ns);
    // Without a camera image, a place to localise it in, or a position of the actor there, the view is the orbit's.
    s->orbiting = s->orbit_requested || !camera->requested || !camera->has_place || !camera->take_located ||
                  (!camera->seeing && !camera->frame);
}

void view_state_set_problem(struct view_state *s, const char *sentence)
{
    s->changed |= sentence != s->problem;
    s->problem = sentence;
}

void view_state_set_facing(struct view_state *s, double facing_rad) { s->facing_rad = facing_rad; }

void view_state_set_progress(struct view_state *s, double share)
{
    s->changed |= share != s->avatar_progress;
    s->avatar_progress = share;
}

void view_state_set_avatar_shown(struct view_state *s, bool shown)
{
    s->changed |= shown != s->avatar_shown;
    s->avatar_shown = shown;
}

static double toward(double from, double to, double by)
{
    return from < to ? fmin(to, from + by) : fmax(to, from - by);
}

// While the sensor's frames come, they alone are drawn, and the actor moves with them: a drawing in between would delay
// the next frame's.
static int64_t tick_live(struct view_state *s, int64_t now_ns)
{
    struct live_state *l = &s->live;
    const enum live_phase phase = l->phase;
    const int count = live_state_count(l);
    const char *hint = live_state_hint(l);
    int64_t next = live_state_tick(l, now_ns);
    playback_seek(&s->playback, now_ns, l->at_ns);
    const bool moves = next <= now_ns && (l->phase == LIVE_DOING || l->reviewing);
    const bool frames_come = l->phase == LIVE_DOING && l->sight.seeing && now_ns - l->frame_ns < LIVE_PAUSE_NS;
    if (moves && !frames_come)
        s->changed = true;
    if (phase != l->phase || count != live_state_count(l) || hint != live_state_hint(l))
        s->changed = true;
    return next <= now_ns ? now_ns + LIVE_POLL_NS : next;
}

int64_t view_state_tick(struct view_state *s, int64_t now_ns)
{
    double passed_s = fmin(fmax((double)(now_ns - s->now_ns) * 1e-9, 0), 0.1);
    bool controls = view_state_controls_shown(s);
    s->now_ns = now_ns;
    int64_t next = INT64_MAX;
    double wanted = s->orbiting || (s->camera.placed && s->camera.seeing) ? 1 : 0;
    const double fade_s = wanted > 0 ? APPEAR_S : FADE_S;
    double presence = s->orbiting ? 1 : toward(s->presence, wanted, passed_s / fade_s);
    s->changed |=
        presence != s->presence || playback_tick(&s->playback, now_ns) || controls != view_state_controls_shown(s);
    s->presence = presence;
    if (s->trim.offered && s->playback.playing && s->playback.loop && playback_at(&s->playback, now_ns) > s->trim.to_ns)
        playback_seek(&s->playback, now_ns, s->trim.from_ns);
    double crossfade = s->avatar_shown ? toward(s->crossfade, 1, passed_s / CROSSFADE_S) : 0;
    s->changed |= crossfade != s->crossfade;
    s->crossfade = crossfade;
    if (presence != wanted || (s->avatar_shown && crossfade < 1))
        next = now_ns;
    bool frozen = s->camera.seeing && now_ns - s->camera.received_ns >= FROZEN_NS;
    s->changed |= frozen != s->frozen;
    s->frozen = frozen;
    if (s->notice[0] && now_ns >= s->notice_until_ns) {
        s->notice[0] = 0;
        s->changed = true;
    }
    if (s->notice[0] && s->notice_until_ns < next)
        next = s->notice_until_ns;
    if (s->page == PAGE_WATCH && s->playback.playing && controls && s->last_input_ns + CONTROLS_NS < next)
        next = s->last_input_ns + CONTROLS_NS;
    if (s->camera.seeing && !frozen && s->camera.received_ns + FROZEN_NS < next)
        next = s->camera.received_ns + FROZEN_NS; // to report it frozen then
    if (s->page == PAGE_WATCH && s->playback.playing && s->orbiting) {
        s->changed = true;
        next = now_ns;
    }
    if (s->page == PAGE_LIVE) {
        const int64_t live_ns = tick_live(s, now_ns);
        next = live_ns < next ? live_ns : next;
    }
    return next;
}

void view_state_resume(struct view_state *s, int64_t from_ns, int64_t to_ns)
{
    playback_skip(&s->playback, from_ns, to_ns);
    view_state_on_input(s, to_ns);
    s->now_ns = to_ns;
}

// What is wrong with the camera, which the caller has asked for.
static const char *camera_hint(const struct view_state *s)
{
    if (*s->camera_trouble)
        return s->camera_trouble;
    if (!s->camera.seeing)
        return "Waiting for the camera";
    if (s->frozen)
        return "The camera has stopped sending images";
    if (!s->camera.has_place)
        return "This recording has no map of a place. Drag with a finger to move round the actor";
    if (!s->camera.take_located)
        return "The sensor recognised nothing of the place when this was filmed. Drag to move round the actor";
    if (s->camera.frame && !s->camera.placed &&
        s->presence <= 0) // only once the actor has faded: the pose may be found again soon
        return s->camera.has_tags ? "Point the camera at a tag"
                                  : "Point the camera at more of the room that was filmed";
    return NULL;
}

// The camera counts only where it shows the room.
static bool live_needs_camera(const struct view_state *s)
{
    return s->live.screen == LIVE_ROOM && s->live.phase != LIVE_SUMMARY && s->camera.requested;
}

bool view_state_hint_warns(const struct view_state *s)
{
    return s->page != PAGE_LIVE || s->problem || live_state_hint_warns(&s->live) ||
           (live_needs_camera(s) && camera_hint(s));
}

const char *view_state_hint(const struct view_state *s)
{
    if (s->page != PAGE_WATCH && s->page != PAGE_LIVE)
        return NULL;
    if (s->problem)
        return s->problem;
    if (s->page == PAGE_LIVE) {
        const char *camera = live_needs_camera(s) && !live_state_hint_warns(&s->live) ? camera_hint(s) : NULL;
        return camera ? camera : live_state_hint(&s->live);
    }
    return s->camera.requested && !s->orbit_requested ? camera_hint(s) : NULL;
}

bool view_state_controls_shown(const struct view_state *s)
{
    return s->page != PAGE_WATCH || !s->playback.playing || s->moving || s->sheet != SHEET_NONE || s->scrubbing ||
           s->now_ns - s->last_input_ns < CONTROLS_NS;
}

struct pose placement_pose(const struct placement *p, struct vec3 pivot)
{
    struct pose pose = {quat_from_rotation_vector(v3(0, 0, p->yaw_rad)), v3(0, 0, 0)};
    struct vec3 rotated = quat_rotate(pose.rotation, v3(pivot.x, pivot.y, 0));
    pose.translation = v3(pivot.x + p->x_m - rotated.x, pivot.y + p->y_m - rotated.y, 0);
    return pose;
}
