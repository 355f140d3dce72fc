#include "app/state/view_state.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static const double PI = 3.14159265358979323846;
static const int64_t NOTICE_NS = 3000000000, WARNING_NS = 8000000000, CONTROLS_NS = 4000000000, FROZEN_NS = 1500000000;
static const int64_t MOVED_NS = 2000000000; // a tag is moved for so long before it is told of
static const double APPEAR_S = 0.2, FADE_S = 0.7, FRESHEN_S = 0.5;
static const double speeds[] = {0.1, 0.25, 0.5, 0.75, 1, 1.25, 1.5, 2};

struct show show_start(int take_count, bool dark, int64_t now_ns)
{
    return (struct show){.page = take_count == 1 ? PAGE_WATCH : PAGE_TAKES,
                         .take_count = take_count,
                         .take_wanted = take_count == 1,
                         .player = player_start(0, 1),
                         .orbiting = true,
                         .prepared = 1,
                         .error_px = 1,
                         .tag_moved_said = -1,
                         .dark = dark,
                         .stirred_ns = now_ns,
                         .now_ns = now_ns,
                         .changed = true};
}

void show_take(struct show *s, int64_t length_ns, int64_t frames, const struct orbit *orbit, int64_t now_ns)
{
    double speed = s->player.speed;
    bool loop = s->player.loop;
    s->player = player_start(length_ns, frames);
    s->player.speed = speed;
    s->player.loop = loop;
    player_play(&s->player, now_ns, true);
    s->orbit = *orbit;
    s->placement = (struct placement){0};
    s->model_shown = false;
    s->freshness = 0;
    s->page = PAGE_WATCH;
    s->sheet = SHEET_NONE;
    s->moving = s->scrubbing = s->take_wanted = false;
    show_stir(s, now_ns);
}

void show_fail(struct show *s, const char *sentence)
{
    s->page = PAGE_TROUBLE;
    s->trouble = sentence;
    s->take_wanted = false;
    s->changed = true;
}

void show_stir(struct show *s, int64_t now_ns)
{
    s->stirred_ns = now_ns;
    s->changed = true;
}

void show_say(struct show *s, const char *notice, int64_t now_ns)
{
    snprintf(s->notice, sizeof s->notice, "%s", notice);
    s->notice_until_ns = now_ns + NOTICE_NS;
    s->notice_warns = false;
    s->changed = true;
}

void show_warn(struct show *s, const char *notice, int64_t now_ns)
{
    show_say(s, notice, now_ns);
    s->notice_until_ns = now_ns + WARNING_NS;
    s->notice_warns = true;
}

// ---------------------------------------------------------------- actions

static void change_speed(struct show *s, int by, int64_t now_ns)
{
    int nearest = 0, last = (int)COUNT_OF(speeds) - 1;
    for (int i = 1; i <= last; i++)
        if (fabs(speeds[i] - s->player.speed) < fabs(speeds[nearest] - s->player.speed))
            nearest = i;
    int next = nearest + by < 0 ? 0 : nearest + by > last ? last : nearest + by;
    player_set_speed(&s->player, now_ns, speeds[next]);
}

static void go_back(struct show *s)
{
    if (s->sheet != SHEET_NONE)
        s->sheet = SHEET_NONE;
    else if (s->page == PAGE_WATCH && s->moving)
        s->moving = false;
    else if (s->page == PAGE_WATCH && s->take_count > 1)
        s->page = PAGE_TAKES;
    else if (s->page == PAGE_TROUBLE && s->take_count > 1)
        s->page = PAGE_TAKES;
    else
        s->quit = true;
}

static void toggle_sheet(struct show *s, enum show_sheet sheet) { s->sheet = s->sheet == sheet ? SHEET_NONE : sheet; }

// Actions that mean the same on every page.
static bool do_anywhere(struct show *s, enum show_action action)
{
    switch (action) {
    case DO_BACK: go_back(s); return true;
    case DO_THEME: s->dark = !s->dark; return true;
    case DO_FULLSCREEN: s->fullscreen = !s->fullscreen; return true;
    case DO_QUIT: s->quit = true; return true;
    case DO_TAKES:
        s->page = s->take_count > 0 ? PAGE_TAKES : s->page;
        s->sheet = SHEET_NONE;
        return true;
    default: return false;
    }
}

static void do_on_takes(struct show *s, enum show_action action)
{
    if (s->take_count < 1)
        return;
    if (action == DO_PREVIOUS || action == DO_STEP_BACK)
        s->take = (s->take + s->take_count - 1) % s->take_count;
    else if (action == DO_NEXT || action == DO_STEP_ON)
        s->take = (s->take + 1) % s->take_count;
    else if (action == DO_CHOOSE || action == DO_PLAY_PAUSE)
        show_choose(s, s->take);
}

// True: it was about time.
static bool do_with_time(struct show *s, enum show_action action, int64_t now_ns)
{
    struct player *p = &s->player;
    switch (action) {
    case DO_PLAY_PAUSE:
    case DO_CHOOSE: player_play(p, now_ns, !p->playing); return true;
    case DO_STEP_BACK: player_step(p, now_ns, -1); return true;
    case DO_STEP_ON: player_step(p, now_ns, 1); return true;
    case DO_TO_START: player_seek(p, now_ns, 0); return true;
    case DO_TO_END: player_seek(p, now_ns, p->length_ns); return true;
    case DO_SLOWER: change_speed(s, -1, now_ns); return true;
    case DO_FASTER: change_speed(s, 1, now_ns); return true;
    case DO_LOOP: player_set_loop(p, now_ns, !p->loop); return true;
    default: return false;
    }
}

static void do_on_watch(struct show *s, enum show_action action, int64_t now_ns)
{
    if (do_with_time(s, action, now_ns))
        return;
    switch (action) {
    case DO_MIRROR: s->placement.mirrored = !s->placement.mirrored; break;
    case DO_ORBIT:
        s->orbit_wished = !s->orbiting;
        s->orbiting = s->orbit_wished || !s->camera.seeing;
        if (s->orbiting && !s->orbit_wished)
            show_say(s, "There is no camera to look through", now_ns);
        break;
    case DO_SKELETON: s->skeleton = !s->skeleton; break;
    case DO_SOURCES: s->sources = !s->sources; break;
    case DO_INSET: s->inset = !s->inset; break;
    case DO_STRIP: s->strip = !s->strip; break;
    case DO_MOVE:
        s->moving = !s->moving;
        s->sheet = SHEET_NONE;
        break;
    case DO_PUT_BACK: s->placement = (struct placement){.mirrored = s->placement.mirrored}; break;
    case DO_PHOTOGRAPH: s->photo_wanted = true; break;
    case DO_LAYERS: toggle_sheet(s, SHEET_LAYERS); break;
    case DO_SPEED: toggle_sheet(s, SHEET_SPEED); break;
    default: break;
    }
}

void show_do(struct show *s, enum show_action action, int64_t now_ns)
{
    if (action == DO_NOTHING)
        return;
    show_stir(s, now_ns);
    if (do_anywhere(s, action))
        return;
    if (s->page == PAGE_TAKES)
        do_on_takes(s, action);
    else if (s->page == PAGE_WATCH)
        do_on_watch(s, action, now_ns);
}

void show_choose(struct show *s, int take)
{
    s->take = take;
    s->take_wanted = true;
    s->changed = true;
}

void show_scrub(struct show *s, bool held, double share, int64_t now_ns)
{
    if (held && !s->scrubbing)
        s->was_playing = s->player.playing;
    if (held) {
        player_play(&s->player, now_ns, false);
        player_seek(&s->player, now_ns, llround(fmin(fmax(share, 0), 1) * (double)s->player.length_ns));
        show_stir(s, now_ns);
    } else if (s->scrubbing) {
        player_play(&s->player, now_ns, s->was_playing);
        s->changed = true;
    }
    s->scrubbing = held;
}

void show_set_speed(struct show *s, double speed, int64_t now_ns)
{
    player_set_speed(&s->player, now_ns, speed);
    show_stir(s, now_ns);
}

void show_set_error(struct show *s, double error_px)
{
    s->changed |= error_px != s->error_px;
    s->error_px = error_px;
}

void show_set_turn(struct show *s, double turn_rad)
{
    s->placement.turn_rad = remainder(turn_rad, 2 * PI);
    s->changed = true;
}

// ---------------------------------------------------------------- fingers

void show_gesture(struct show *s, const struct gesture *g, const struct floor_drag *at, int64_t now_ns)
{
    bool still =
        g->drag_x == 0 && g->drag_y == 0 && g->push_x == 0 && g->push_y == 0 && g->spread == 1 && g->twist == 0;
    if (s->page != PAGE_WATCH || (still && !g->tapped))
        return;
    if (g->tapped && s->sheet != SHEET_NONE) {
        s->sheet = SHEET_NONE;
        show_stir(s, now_ns);
    } else if (g->tapped && show_controls(s) && s->player.playing && !s->moving) {
        s->stirred_ns = now_ns - CONTROLS_NS; // a tap on the picture sends the controls away, another brings them back
        s->changed = true;
    } else {
        show_stir(s, now_ns);
    }
    if (s->moving) {
        if (at) {
            s->placement.x_m += at->to_x - at->from_x;
            s->placement.y_m += at->to_y - at->from_y;
        }
        show_set_turn(s, s->placement.turn_rad - g->twist);
    } else if (s->orbiting) {
        orbit_move(&s->orbit, g->drag_x + g->push_x, g->drag_y + g->push_y, log(g->spread) / log(1 / 0.9));
    }
}

void show_wheel(struct show *s, double notches, int64_t now_ns)
{
    if (s->page != PAGE_WATCH)
        return;
    if (s->moving)
        show_set_turn(s, s->placement.turn_rad + notches * PI / 36);
    else if (s->orbiting)
        orbit_move(&s->orbit, 0, 0, notches);
    show_stir(s, now_ns);
}

// ---------------------------------------------------------------- the camera, and time

// Once for each tag, and only of one that stays so: a single picture may show it half hidden.
static void hear_of_moved_tags(struct show *s, int64_t now_ns)
{
    const struct show_camera *camera = &s->camera;
    if (!camera->moved_tags)
        s->tag_moved_ns = 0;
    else if (!s->tag_moved_ns)
        s->tag_moved_ns = now_ns;
    if (!camera->moved_tags || camera->first_moved == s->tag_moved_said || now_ns - s->tag_moved_ns < MOVED_NS)
        return;
    s->tag_moved_said = camera->first_moved;
    const bool more = camera->moved_tags > 1;
    char notice[sizeof s->notice];
    snprintf(notice, sizeof notice,
             "Tag %d%s not where the place has %s, and left out of account. Put %s back, or sweep again",
             (int)camera->first_moved, more ? " and others are" : " is", more ? "them" : "it", more ? "them" : "it");
    show_warn(s, notice, now_ns);
}

void show_hear(struct show *s, const struct show_camera *camera, int64_t now_ns)
{
    const bool sight_is_new = camera->sight != s->camera.sight;
    if (sight_is_new || camera->seeing != s->camera.seeing || strcmp(camera->trouble, s->camera_trouble))
        s->changed = true;
    s->camera = *camera;
    s->camera.trouble = NULL;
    snprintf(s->camera_trouble, sizeof s->camera_trouble, "%s", camera->trouble);
    if (camera->placed && sight_is_new) {
        s->placed_ns = now_ns;
        s->ever_placed = true;
    }
    hear_of_moved_tags(s, now_ns);
    // Without a camera's picture, or a place to find it in, one walks round with a finger.
    s->orbiting = s->orbit_wished || !camera->there || !camera->knows_place || (!camera->seeing && !camera->sight);
}

void show_ail(struct show *s, const char *sentence)
{
    s->changed |= sentence != s->ailing;
    s->ailing = sentence;
}

void show_prepare(struct show *s, double share)
{
    s->changed |= share != s->prepared;
    s->prepared = share;
}

void show_model(struct show *s, bool shown)
{
    s->changed |= shown != s->model_shown;
    s->model_shown = shown;
}

static double toward(double from, double to, double by)
{
    return from < to ? fmin(to, from + by) : fmax(to, from - by);
}

int64_t show_tick(struct show *s, int64_t now_ns)
{
    double passed_s = fmin(fmax((double)(now_ns - s->now_ns) * 1e-9, 0), 0.1);
    bool controls = show_controls(s);
    s->now_ns = now_ns;
    int64_t next = INT64_MAX;
    double wanted = s->orbiting || (s->camera.placed && s->camera.seeing) ? 1 : 0;
    double presence = s->orbiting ? 1 : toward(s->presence, wanted, passed_s / (wanted > 0 ? APPEAR_S : FADE_S));
    s->changed |= presence != s->presence || player_tick(&s->player, now_ns) || controls != show_controls(s);
    s->presence = presence;
    double fresh = s->model_shown ? toward(s->freshness, 1, passed_s / FRESHEN_S) : 0;
    s->changed |= fresh != s->freshness;
    s->freshness = fresh;
    if (presence != wanted || (s->model_shown && fresh < 1))
        next = now_ns;
    bool frozen = s->camera.seeing && now_ns - s->camera.came_ns >= FROZEN_NS;
    s->changed |= frozen != s->frozen;
    s->frozen = frozen;
    if (s->notice[0] && now_ns >= s->notice_until_ns) {
        s->notice[0] = 0;
        s->changed = true;
    }
    if (s->notice[0] && s->notice_until_ns < next)
        next = s->notice_until_ns;
    if (s->page == PAGE_WATCH && s->player.playing && controls && s->stirred_ns + CONTROLS_NS < next)
        next = s->stirred_ns + CONTROLS_NS;
    if (s->camera.seeing && !frozen && s->camera.came_ns + FROZEN_NS < next)
        next = s->camera.came_ns + FROZEN_NS; // it may have frozen by then, which is to be said
    if (s->page == PAGE_WATCH && s->player.playing && s->orbiting) {
        s->changed = true;
        next = now_ns;
    }
    return next;
}

void show_slept(struct show *s, int64_t from_ns, int64_t to_ns)
{
    player_skip(&s->player, from_ns, to_ns);
    show_stir(s, to_ns);
    s->now_ns = to_ns;
}

const char *show_hint(const struct show *s)
{
    if (s->page != PAGE_WATCH)
        return NULL;
    if (s->ailing)
        return s->ailing;
    if (!s->camera.there || s->orbit_wished)
        return NULL;
    if (*s->camera_trouble)
        return s->camera_trouble;
    if (!s->camera.seeing)
        return "Waiting for the camera";
    if (s->frozen)
        return "The camera has stopped sending pictures";
    if (!s->camera.knows_place)
        return "This recording knows no place to stand in. Walk round with a finger";
    if (s->camera.sight && !s->camera.placed && s->presence <= 0) // not before he has faded: it may soon know again
        return s->camera.knows_tags ? "Point me at a tag" : "Point me at more of the room that was filmed";
    return NULL;
}

bool show_controls(const struct show *s)
{
    return s->page != PAGE_WATCH || !s->player.playing || s->moving || s->sheet != SHEET_NONE || s->scrubbing ||
           s->now_ns - s->stirred_ns < CONTROLS_NS;
}

struct pose placement_pose(const struct placement *p, struct vec3 anchor)
{
    struct pose pose = {quat_from_rotation_vector(v3(0, 0, p->turn_rad)), v3(0, 0, 0)};
    struct vec3 turned = quat_rotate(pose.rotation, v3(anchor.x, anchor.y, 0));
    pose.translation = v3(anchor.x + p->x_m - turned.x, anchor.y + p->y_m - turned.y, 0);
    return pose;
}
