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

bool room_state_type(struct room_state *state, const char *text)
{
    return (*state->filter || *text != ' ') && text_append(state->filter, sizeof state->filter, text);
}

void room_state_want(struct room_state *state, int thing)
{
    state->wanted = state->wanted == thing ? ROOM_NOTHING : thing;
}

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
                               .own_count = take_count,
                               .take_wanted = take_count == 1,
                               .playback = playback_start(0, 1),
                               .orbiting = true,
                               .avatar_progress = 1,
                               .detail = DETAIL_AUTO,
                               .error_px = 1,
                               .text_size = 1,
                               .tag_moved_notified = -1,
                               .room = room_state_start(),
                               .dark = dark,
                               .last_input_ns = now_ns,
                               .now_ns = now_ns,
                               .changed = true};
}

void view_state_open_take(struct view_state *state, int64_t length_ns, int64_t frames, const struct orbit *orbit,
                          int64_t now_ns)
{
    double speed = state->playback.speed;
    bool loop = state->playback.loop;
    state->playback = playback_start(length_ns, frames);
    state->playback.speed = speed;
    state->playback.loop = loop;
    playback_play(&state->playback, now_ns, true);
    state->orbit = state->orbit_start = *orbit;
    state->facing_rad = orbit->angle_rad; // until the actor is known
    state->placement = (struct placement){0};
    state->avatar_shown = false;
    state->crossfade = 0;
    state->page = PAGE_WATCH;
    state->sheet = SHEET_NONE;
    state->moving = state->scrubbing = state->take_wanted = false;
    state->trim.from_ns = 0;
    state->trim.to_ns = length_ns;
    if (state->live.present) {
        state->page = PAGE_LIVE;
        playback_play(&state->playback, now_ns, false);
        live_state_open_take(&state->live, length_ns, orbit, now_ns);
    }
    view_state_on_input(state, now_ns);
}

void view_state_fail(struct view_state *state, const char *sentence)
{
    state->page = PAGE_TROUBLE;
    state->trouble = sentence;
    state->take_wanted = false;
    state->changed = true;
}

void view_state_on_input(struct view_state *state, int64_t now_ns)
{
    state->last_input_ns = now_ns;
    state->changed = true;
}

// What is said again and again is drawn once.
static void set_notice(struct view_state *state, const char *notice, bool warns, int64_t until_ns)
{
    char text[sizeof state->notice];
    snprintf(text, sizeof text, "%s", notice);
    state->changed |= strcmp(text, state->notice) || state->notice_warns != warns;
    memcpy(state->notice, text, sizeof text);
    state->notice_warns = warns;
    state->notice_until_ns = until_ns;
}

void view_state_notify(struct view_state *state, const char *notice, int64_t now_ns)
{
    set_notice(state, notice, false, now_ns + NOTICE_NS);
}

void view_state_warn(struct view_state *state, const char *notice, int64_t now_ns)
{
    set_notice(state, notice, true, now_ns + WARNING_NS);
}

// ---------------------------------------------------------------- actions

static void change_speed(struct view_state *state, int by, int64_t now_ns)
{
    int nearest = 0, last = VIEW_SPEEDS - 1;
    for (int i = 1; i <= last; i++)
        if (fabs(view_speeds[i] - state->playback.speed) < fabs(view_speeds[nearest] - state->playback.speed))
            nearest = i;
    const int next = clamp_int(nearest + by, 0, last);
    playback_set_speed(&state->playback, now_ns, view_speeds[next]);
}

bool view_state_lists_other(const struct view_state *state)
{
    return state->compare.asked == CHOICE_ATTEMPT && state->compare.attempt_count > 0;
}

// Which one is chosen next, of which recording.
static void ask_choice(struct view_state *state, enum take_choice_asked asked)
{
    const bool before = view_state_lists_other(state);
    state->compare.asked = asked;
    const bool other = view_state_lists_other(state);
    state->take_count = other ? state->compare.attempt_count : state->own_count;
    if (other != before)
        state->take = other ? 0 : state->compare.reference;
}

static void leave_comparison(struct view_state *state)
{
    state->compare.wanted = false;
    live_state_to_ready(&state->live, state->now_ns);
    state->page = PAGE_TAKES;
}

static void go_back(struct view_state *state)
{
    if (state->sheet != SHEET_NONE)
        state->sheet = SHEET_NONE;
    else if (state->page == PAGE_WATCH && state->moving)
        state->moving = false;
    else if (state->page == PAGE_TAKES && state->compare.asked)
        ask_choice(state, CHOICE_NONE);
    else if (state->page == PAGE_LIVE && state->live.of_takes)
        leave_comparison(state);
    else if (state->page == PAGE_LIVE && state->live.phase != LIVE_READY)
        live_state_to_ready(&state->live, state->now_ns);
    else if (state->page != PAGE_TAKES && state->take_count > 1)
        state->page = PAGE_TAKES;
    else
        state->quit = true;
}

static void toggle_sheet(struct view_state *state, enum view_sheet sheet)
{
    state->sheet = state->sheet == sheet ? SHEET_NONE : sheet;
}

static void next_text_size(struct view_state *state)
{
    int i = 0;
    while (i < VIEW_TEXT_SIZES && view_text_sizes[i] <= state->text_size + 0.01)
        i++;
    state->text_size = view_text_sizes[i % VIEW_TEXT_SIZES];
}

// Up and down in a list that is open.
static bool steps_in_list(struct view_state *state, enum view_action action)
{
    const bool list = state->sheet != SHEET_NONE || (state->page == PAGE_LIVE && state->live.phase == LIVE_SUMMARY);
    if (!list || state->page == PAGE_TAKES || (action != DO_PREVIOUS && action != DO_NEXT))
        return false;
    state->list_steps += action == DO_NEXT ? 1 : -1;
    return true;
}

// Actions that mean the same on every page.
static bool do_anywhere(struct view_state *state, enum view_action action)
{
    if (action >= DO_DETAIL && action <= DO_DETAIL_LAST) {
        state->detail = (enum detail)(action - DO_DETAIL);
        return true;
    }
    switch (action) {
    case DO_BACK: go_back(state); return true;
    case DO_THEME: state->dark = !state->dark; return true;
    case DO_TEXT_SIZE: next_text_size(state); return true;
    case DO_FULLSCREEN: state->fullscreen = !state->fullscreen; return true;
    case DO_QUIT: state->quit = true; return true;
    case DO_TAKES:
        if (state->live.of_takes)
            leave_comparison(state);
        ask_choice(state, CHOICE_NONE);
        state->page = state->take_count > 0 ? PAGE_TAKES : state->page;
        state->sheet = SHEET_NONE;
        return true;
    default: return false;
    }
}

// A row up or down stays within the page; one take on from the last is the first.
static void select_take(struct view_state *state, int by)
{
    const int to = state->take + by;
    if (to >= 0 && to < state->take_count)
        state->take = to;
    else if (abs(by) == 1)
        state->take = (to + state->take_count) % state->take_count;
}

static void do_on_takes(struct view_state *state, enum view_action action)
{
    const int columns = state->take_columns > 1 ? state->take_columns : 1;
    if (state->take_count < 1)
        return;
    if (action == DO_STEP_BACK || action == DO_STEP_ON)
        select_take(state, action == DO_STEP_ON ? 1 : -1);
    else if (action == DO_PREVIOUS || action == DO_NEXT)
        select_take(state, action == DO_NEXT ? columns : -columns);
    else if (action == DO_TO_START || action == DO_TO_END)
        state->take = action == DO_TO_END ? state->take_count - 1 : 0;
    else if (action == DO_CHOOSE || action == DO_PLAY_PAUSE)
        view_state_choose_take(state, state->take);
    else if ((action == DO_COMPARE || action == DO_MAP || action == DO_SCREENSHOT) &&
             (state->take_count > 1 || state->compare.attempt_count))
        ask_choice(state, state->compare.asked ? CHOICE_NONE : CHOICE_REFERENCE);
}

// True: the action concerned the playback.
static bool do_playback(struct view_state *state, enum view_action action, int64_t now_ns)
{
    struct playback_clock *p = &state->playback;
    switch (action) {
    case DO_PLAY_PAUSE:
    case DO_CHOOSE: playback_play(p, now_ns, !p->playing); return true;
    case DO_STEP_BACK: playback_step(p, now_ns, -1); return true;
    case DO_STEP_ON: playback_step(p, now_ns, 1); return true;
    case DO_TO_START: playback_seek(p, now_ns, 0); return true;
    case DO_TO_END: playback_seek(p, now_ns, p->length_ns); return true;
    case DO_SLOWER: change_speed(state, -1, now_ns); return true;
    case DO_FASTER: change_speed(state, 1, now_ns); return true;
    case DO_LOOP: playback_set_loop(p, now_ns, !p->loop); return true;
    default: return false;
    }
}

// True: the action concerned the ends of the take.
static bool do_trim(struct view_state *state, enum view_action action, int64_t now_ns)
{
    struct view_trim *t = &state->trim;
    const int64_t at = playback_at(&state->playback, now_ns), length = state->playback.length_ns;
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
static bool do_look(struct view_state *state, enum view_action action)
{
    if (action < DO_SEE_FRONT || action > DO_SEE_START)
        return false;
    if (state->orbiting)
        orbit_look(&state->orbit, (enum orbit_view)(action - DO_SEE_FRONT), state->facing_rad, &state->orbit_start);
    return true;
}

static void do_on_watch(struct view_state *state, enum view_action action, int64_t now_ns)
{
    if (do_playback(state, action, now_ns) || do_trim(state, action, now_ns) || do_look(state, action))
        return;
    switch (action) {
    case DO_MIRROR: state->placement.mirrored = !state->placement.mirrored; break;
    case DO_ORBIT:
        state->orbit_requested = !state->orbiting;
        state->orbiting = state->orbit_requested || !state->camera.seeing;
        if (state->orbiting && !state->orbit_requested)
            view_state_notify(state, "There is no camera image", now_ns);
        break;
    case DO_SKELETON: state->skeleton = !state->skeleton; break;
    case DO_SOURCES: state->sources = !state->sources; break;
    case DO_INSET: state->inset = !state->inset; break;
    case DO_FRAME_GRAPH: state->frame_graph = !state->frame_graph; break;
    case DO_MOVE:
        state->moving = !state->moving;
        state->sheet = SHEET_NONE;
        break;
    case DO_RESET_PLACEMENT: state->placement = (struct placement){.mirrored = state->placement.mirrored}; break;
    case DO_SCREENSHOT: state->screenshot_wanted = true; break;
    case DO_LAYERS: toggle_sheet(state, SHEET_LAYERS); break;
    case DO_SPEED: toggle_sheet(state, SHEET_SPEED); break;
    case DO_NAMES: state->room.names = !state->room.names; break;
    case DO_MAP: state->room.map = !state->room.map && state->room.has_place; break;
    case DO_FILMED: state->room.filmed = !state->room.filmed; break;
    case DO_THINGS:
        if (state->room.thing_count > 0)
            toggle_sheet(state, SHEET_THINGS);
        state->room.filter[0] = 0;
        break;
    default: break;
    }
}

bool live_action_of(enum view_action action, enum live_phase phase, enum live_action *out)
{
    const bool summary = phase == LIVE_SUMMARY;
    const enum live_action step_on = phase == LIVE_READY ? LIVE_DO_MIRROR : LIVE_DO_MARK_TO;
    static_assert(DO_COUNT_ALL - DO_COUNT == LIVE_DO_COUNT_ALL - LIVE_DO_COUNT, "in the same order");
    if (action >= DO_COUNT && action <= DO_COUNT_ALL) {
        *out = (enum live_action)(LIVE_DO_COUNT + (action - DO_COUNT));
        return true;
    }
    static_assert(DO_SEE_ABOVE - DO_SEE_FRONT == LIVE_GROUPS - 1, "the keys 1 to 4");
    if (action >= DO_SEE_FRONT && action <= DO_SEE_ABOVE) {
        *out = (enum live_action)(LIVE_DO_COUNT + (action - DO_SEE_FRONT));
        return true;
    }
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
    case DO_SEE_START: *out = LIVE_DO_COUNT_ALL; return true;
    case DO_MARK_FROM: *out = LIVE_DO_MARK_FROM; return true;
    case DO_MARK_TO: *out = LIVE_DO_MARK_TO; return true;
    case DO_KEEP: *out = LIVE_DO_KEEP; return true;
    case DO_SCREENSHOT: *out = summary ? LIVE_DO_KEEP : LIVE_DO_OVER; return true;
    default: return false;
    }
}

void view_state_do(struct view_state *state, enum view_action action, int64_t now_ns)
{
    enum live_action live;
    if (action == DO_NOTHING)
        return;
    view_state_on_input(state, now_ns);
    if (do_anywhere(state, action) || steps_in_list(state, action))
        return;
    if (state->page == PAGE_LIVE && action == DO_LAYERS)
        toggle_sheet(state, SHEET_LIVE);
    else if (state->page == PAGE_TAKES)
        do_on_takes(state, action);
    else if (state->page == PAGE_WATCH)
        do_on_watch(state, action, now_ns);
    else if (state->page == PAGE_LIVE && live_action_of(action, state->live.phase, &live))
        live_state_do(&state->live, live, now_ns);
}

void view_state_choose_take(struct view_state *state, int take)
{
    struct take_choice *c = &state->compare;
    state->take = take;
    state->changed = true;
    if (c->asked == CHOICE_NONE) {
        state->take_wanted = true;
    } else if (c->asked == CHOICE_REFERENCE) {
        c->reference = take;
        ask_choice(state, CHOICE_ATTEMPT);
    } else if (take != c->reference || c->attempt_count) {
        c->attempt = take;
        ask_choice(state, CHOICE_NONE);
        c->wanted = true;
        state->page = PAGE_LIVE;
        state->sheet = SHEET_NONE;
        live_state_compare_takes(&state->live, state->now_ns);
    }
}

void view_state_compare(struct view_state *state, int attempt_count)
{
    state->compare = (struct take_choice){.attempt_count = attempt_count};
    state->page = PAGE_TAKES;
    state->take_wanted = false;
    ask_choice(state, CHOICE_REFERENCE);
    if (state->own_count == 1)
        view_state_choose_take(state, 0);
    if (state->compare.asked == CHOICE_ATTEMPT && attempt_count == 1)
        view_state_choose_take(state, 0);
}

void view_state_scrub(struct view_state *state, bool held, double share, int64_t now_ns)
{
    if (held && !state->scrubbing)
        state->was_playing = state->playback.playing;
    if (held) {
        playback_play(&state->playback, now_ns, false);
        playback_seek(&state->playback, now_ns, llround(fmin(fmax(share, 0), 1) * (double)state->playback.length_ns));
        view_state_on_input(state, now_ns);
    } else if (state->scrubbing) {
        playback_play(&state->playback, now_ns, state->was_playing);
        state->changed = true;
    }
    state->scrubbing = held;
}

void view_state_set_speed(struct view_state *state, double speed, int64_t now_ns)
{
    playback_set_speed(&state->playback, now_ns, speed);
    view_state_on_input(state, now_ns);
}

void view_state_set_text_size(struct view_state *state, double size, int64_t now_ns)
{
    state->text_size = size;
    view_state_on_input(state, now_ns);
}

void view_state_set_error(struct view_state *state, double error_px)
{
    state->changed |= error_px != state->error_px;
    state->error_px = error_px;
}

void view_state_set_yaw(struct view_state *state, double yaw_rad)
{
    state->placement.yaw_rad = remainder(yaw_rad, 2 * PI);
    state->changed = true;
}

// ---------------------------------------------------------------- things

void view_state_open_card(struct view_state *state, int thing, int64_t now_ns)
{
    const bool same = state->sheet == SHEET_CARD && state->room.card == thing;
    state->sheet = same ? SHEET_NONE : SHEET_CARD;
    state->room.card = same ? ROOM_NOTHING : thing;
    state->moving = false;
    view_state_on_input(state, now_ns);
}

void view_state_find_thing(struct view_state *state, int thing, int64_t now_ns)
{
    room_state_want(&state->room, thing);
    state->sheet = SHEET_NONE;
    view_state_on_input(state, now_ns);
}

void view_state_map_gesture(struct view_state *state, const struct gesture *gesture, double notches, int64_t now_ns)
{
    orbit_move(&state->room.map_orbit, gesture->drag_x + gesture->push_x, gesture->drag_y + gesture->push_y,
               log(gesture->spread) / log(1 / 0.9) + notches);
    view_state_on_input(state, now_ns);
}

// ---------------------------------------------------------------- fingers

void view_state_gesture(struct view_state *state, const struct gesture *gesture, const struct floor_drag *at,
                        int64_t now_ns)
{
    bool still = gesture->drag_x == 0 && gesture->drag_y == 0 && gesture->push_x == 0 && gesture->push_y == 0 &&
                 gesture->spread == 1 && gesture->twist == 0;
    if (state->page == PAGE_LIVE && !still) {
        orbit_move(&state->live.orbit, gesture->drag_x + gesture->push_x, gesture->drag_y + gesture->push_y,
                   log(gesture->spread) / log(1 / 0.9));
        view_state_on_input(state, now_ns);
    }
    if (state->page != PAGE_WATCH || (still && !gesture->tapped))
        return;
    const bool twice = gesture->tapped && state->tapped_ns && now_ns - state->tapped_ns < DOUBLE_TAP_NS;
    state->tapped_ns = gesture->tapped && !twice ? now_ns : 0;
    if (twice && !state->moving)
        do_look(state, DO_SEE_START);
    if (gesture->tapped && state->sheet != SHEET_NONE) {
        state->sheet = SHEET_NONE;
        view_state_on_input(state, now_ns);
    } else if (gesture->tapped && view_state_controls_shown(state) && state->playback.playing && !state->moving) {
        state->last_input_ns = now_ns - CONTROLS_NS; // a tap on the image hides the controls, another shows them
        state->changed = true;
    } else {
        view_state_on_input(state, now_ns);
    }
    if (state->moving) {
        if (at) {
            state->placement.x_m += at->to_x - at->from_x;
            state->placement.y_m += at->to_y - at->from_y;
        }
        view_state_set_yaw(state, state->placement.yaw_rad - gesture->twist);
    } else if (state->orbiting) {
        orbit_move(&state->orbit, gesture->drag_x + gesture->push_x, gesture->drag_y + gesture->push_y,
                   log(gesture->spread) / log(1 / 0.9));
    }
}

bool view_state_types(const struct view_state *state)
{
    return state->page == PAGE_WATCH && state->sheet == SHEET_THINGS;
}

void view_state_wheel(struct view_state *state, double notches, int64_t now_ns)
{
    if (state->page == PAGE_LIVE)
        orbit_move(&state->live.orbit, 0, 0, notches);
    if (state->page != PAGE_WATCH && state->page != PAGE_LIVE)
        return;
    if (state->moving)
        view_state_set_yaw(state, state->placement.yaw_rad + notches * PI / 36);
    else if (state->page == PAGE_WATCH && state->orbiting)
        orbit_move(&state->orbit, 0, 0, notches);
    view_state_on_input(state, now_ns);
}

// ---------------------------------------------------------------- camera and time

// Once for each tag, and only for one that stays moved: in a single image it may be half occluded.
static void on_moved_tags(struct view_state *state, int64_t now_ns)
{
    const struct view_camera *camera = &state->camera;
    if (!camera->moved_tags)
        state->tag_moved_ns = 0;
    else if (!state->tag_moved_ns)
        state->tag_moved_ns = now_ns;
    if (!camera->moved_tags || camera->first_moved == state->tag_moved_notified ||
        now_ns - state->tag_moved_ns < MOVED_NS)
        return;
    state->tag_moved_notified = camera->first_moved;
    const bool more = camera->moved_tags > 1;
    char notice[sizeof state->notice];
    snprintf(notice, sizeof notice, "Tag %d%s not where the place has %s, and ignored. Put %s back, or sweep again",
             (int)camera->first_moved, more ? " and others are" : " is", more ? "them" : "it", more ? "them" : "it");
    view_state_warn(state, notice, now_ns);
}

void view_state_on_camera(struct view_state *state, const struct view_camera *camera, int64_t now_ns)
{
    const bool frame_is_new = camera->frame != state->camera.frame;
    if (frame_is_new || camera->seeing != state->camera.seeing || strcmp(camera->trouble, state->camera_trouble))
        state->changed = true;
    state->camera = *camera;
    state->camera.trouble = NULL;
    snprintf(state->camera_trouble, sizeof state->camera_trouble, "%s", camera->trouble);
    if (camera->placed && frame_is_new) {
        state->placed_ns = now_ns;
        state->ever_placed = true;
    }
    on_moved_tags(state, now_ns);
    // Without a camera image, a place to localise it in, or a position of the actor there, the view is the orbit's.
    state->orbiting = state->orbit_requested || !camera->requested || !camera->has_place || !camera->take_located ||
                      (!camera->seeing && !camera->frame);
}

void view_state_set_problem(struct view_state *state, const char *sentence)
{
    state->changed |= sentence != state->problem;
    state->problem = sentence;
}

void view_state_set_facing(struct view_state *state, double facing_rad) { state->facing_rad = facing_rad; }

void view_state_set_progress(struct view_state *state, double share)
{
    state->changed |= share != state->avatar_progress;
    state->avatar_progress = share;
}

void view_state_set_avatar_shown(struct view_state *state, bool shown)
{
    state->changed |= shown != state->avatar_shown;
    state->avatar_shown = shown;
}

static double move_toward(double from, double to, double by)
{
    return from < to ? fmin(to, from + by) : fmax(to, from - by);
}

// While the sensor's frames come, they alone are drawn, and the actor moves with them: a drawing in between would delay
// the next frame's.
static int64_t tick_live(struct view_state *state, int64_t now_ns)
{
    struct live_state *l = &state->live;
    const enum live_phase phase = l->phase;
    const int count = live_state_count(l);
    const char *hint = live_state_hint(l);
    int64_t next = live_state_tick(l, now_ns);
    playback_seek(&state->playback, now_ns, l->at_ns);
    const bool moves = next <= now_ns && (l->phase == LIVE_DOING || l->reviewing);
    const bool frames_come = l->phase == LIVE_DOING && l->sight.seeing && now_ns - l->frame_ns < LIVE_PAUSE_NS;
    if (moves && !frames_come)
        state->changed = true;
    if (phase != l->phase || count != live_state_count(l) || hint != live_state_hint(l))
        state->changed = true;
    return next <= now_ns ? now_ns + LIVE_POLL_NS : next;
}

int64_t view_state_tick(struct view_state *state, int64_t now_ns)
{
    double passed_s = fmin(fmax((double)(now_ns - state->now_ns) * 1e-9, 0), 0.1);
    bool controls = view_state_controls_shown(state);
    state->now_ns = now_ns;
    int64_t next = INT64_MAX;
    double wanted = state->orbiting || (state->camera.placed && state->camera.seeing) ? 1 : 0;
    const double fade_s = wanted > 0 ? APPEAR_S : FADE_S;
    double presence = state->orbiting ? 1 : move_toward(state->presence, wanted, passed_s / fade_s);
    state->changed |= presence != state->presence || playback_tick(&state->playback, now_ns) ||
                      controls != view_state_controls_shown(state);
    state->presence = presence;
    if (state->trim.offered && state->playback.playing && state->playback.loop &&
        playback_at(&state->playback, now_ns) > state->trim.to_ns)
        playback_seek(&state->playback, now_ns, state->trim.from_ns);
    double crossfade = state->avatar_shown ? move_toward(state->crossfade, 1, passed_s / CROSSFADE_S) : 0;
    state->changed |= crossfade != state->crossfade;
    state->crossfade = crossfade;
    if (presence != wanted || (state->avatar_shown && crossfade < 1))
        next = now_ns;
    bool frozen = state->camera.seeing && now_ns - state->camera.received_ns >= FROZEN_NS;
    state->changed |= frozen != state->frozen;
    state->frozen = frozen;
    if (state->notice[0] && now_ns >= state->notice_until_ns) {
        state->notice[0] = 0;
        state->changed = true;
    }
    if (state->notice[0] && state->notice_until_ns < next)
        next = state->notice_until_ns;
    if (state->page == PAGE_WATCH && state->playback.playing && controls && state->last_input_ns + CONTROLS_NS < next)
        next = state->last_input_ns + CONTROLS_NS;
    if (state->camera.seeing && !frozen && state->camera.received_ns + FROZEN_NS < next)
        next = state->camera.received_ns + FROZEN_NS; // to report it frozen then
    if (state->page == PAGE_WATCH && state->playback.playing && state->orbiting) {
        state->changed = true;
        next = now_ns;
    }
    if (state->page == PAGE_LIVE) {
        const int64_t live_ns = tick_live(state, now_ns);
        next = live_ns < next ? live_ns : next;
    }
    return next;
}

void view_state_resume(struct view_state *state, int64_t from_ns, int64_t to_ns)
{
    playback_skip(&state->playback, from_ns, to_ns);
    view_state_on_input(state, to_ns);
    state->now_ns = to_ns;
}

// What is wrong with the camera, which the caller has asked for.
static const char *camera_hint(const struct view_state *state)
{
    if (*state->camera_trouble)
        return state->camera_trouble;
    if (!state->camera.seeing)
        return "Waiting for the camera";
    if (state->frozen)
        return "The camera has stopped sending images";
    if (!state->camera.has_place)
        return "This recording has no map of a place. Drag with a finger to move round the actor";
    if (!state->camera.take_located)
        return "The sensor recognised nothing of the place when this was filmed. Drag to move round the actor";
    if (state->camera.frame && !state->camera.placed &&
        state->presence <= 0) // only once the actor has faded: the pose may be found again soon
        return state->camera.has_tags ? "Point the camera at a tag"
                                      : "Point the camera at more of the room that was filmed";
    return NULL;
}

// The camera counts only where it shows the room.
static bool live_needs_camera(const struct view_state *state)
{
    return state->live.screen == LIVE_ROOM && state->live.phase != LIVE_SUMMARY && state->camera.requested;
}

bool view_state_hint_warns(const struct view_state *state)
{
    return state->page != PAGE_LIVE || state->problem || live_state_hint_warns(&state->live) ||
           (live_needs_camera(state) && camera_hint(state));
}

const char *view_state_hint(const struct view_state *state)
{
    if (state->page != PAGE_WATCH && state->page != PAGE_LIVE)
        return NULL;
    if (state->problem)
        return state->problem;
    if (state->page == PAGE_LIVE) {
        const char *camera =
            live_needs_camera(state) && !live_state_hint_warns(&state->live) ? camera_hint(state) : NULL;
        return camera ? camera : live_state_hint(&state->live);
    }
    return state->camera.requested && !state->orbit_requested ? camera_hint(state) : NULL;
}

bool view_state_controls_shown(const struct view_state *state)
{
    return state->page != PAGE_WATCH || !state->playback.playing || state->moving || state->sheet != SHEET_NONE ||
           state->scrubbing || state->now_ns - state->last_input_ns < CONTROLS_NS;
}

struct pose placement_pose(const struct placement *placement, struct vec3 pivot)
{
    struct pose pose = {quat_from_rotation_vector(v3(0, 0, placement->yaw_rad)), v3(0, 0, 0)};
    struct vec3 rotated = quat_rotate(pose.rotation, v3(pivot.x, pivot.y, 0));
    pose.translation = v3(pivot.x + placement->x_m - rotated.x, pivot.y + placement->y_m - rotated.y, 0);
    return pose;
}
