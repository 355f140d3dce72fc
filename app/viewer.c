#include "app/viewer.h"

#include "app/ui/screenshot.h"
#include "base/clock.h"
#include "platform/file.h"
#include "reenact/render/shaders.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const int64_t CHECK_NS = 1000000000;
static const int64_t AWAITED_NS = 4000000;                    // what will be there in a moment is looked for so often
static const double ROOM_S = 0.07, LONGEST_STEP_S = 1 / 30.0; // of making room: its pace; a picture's time, at most

double tablet_px_per_dp(double dpi) { return fmax(dpi / 160, 0.85); } // a desk's screen is looked at from farther away

// ---------------------------------------------------------------- opening

static enum status open_recording(struct tablet *t)
{
    enum status status = recording_open(&t->recording, t->options.file);
    if (status == OK)
        status = library_open(&t->library, t->gpu, t->recording, t->options.file);
    if (status == OK && t->library.count == 0)
        status = fail(ERR_MISSING, "%s holds no take. Film one with reenact-capture record.", t->options.file);
    if (status != OK)
        return status;
    status = recording_read_place(t->recording, &t->place);
    t->has_place = status == OK && t->place.tag_count + t->place.point_count > 0;
    return status < 0 ? status : OK;
}

static void choose_at_first(struct tablet *t, int64_t now_ns)
{
    t->show = show_start(t->library.count, !t->options.light, now_ns);
    for (int i = 0; t->options.take && i < t->library.count; i++)
        if (!strcmp(t->library.cards[i].name, t->options.take))
            show_choose(&t->show, i);
    if (t->options.take && !t->show.take_wanted) {
        fail(ERR_MISSING, "%s has no take named '%s'", t->options.file, t->options.take);
        snprintf(t->trouble, sizeof t->trouble, "%s", status_sentence());
        show_fail(&t->show, t->trouble);
    }
}

enum status tablet_open(struct tablet *t, struct gpu *gpu, const struct tablet_options *options)
{
    *t = (struct tablet){.options = *options, .gpu = gpu};
    const struct gpu_flat_texts shaders = {shader_find("draw2d.vert"), shader_find("draw2d.frag")};
    t->governor = governor_start(1000 / options->refresh_hz);
    enum status status = ui_open(&t->ui, gpu, &shaders, theme_faces(), FACE_COUNT);
    if (status != OK)
        return status;
    int64_t now_ns = clock_now_ns();
    status = open_recording(t);
    if (status == ERR_DEVICE || status == ERR_MEMORY)
        return status;
    if (status != OK)
        snprintf(t->trouble, sizeof t->trouble, "%s", status_sentence());
    choose_at_first(t, now_ns);
    if (status != OK)
        show_fail(&t->show, t->trouble);
    if (!options->camera)
        return OK;
    status = viewfinder_open(&t->viewfinder, gpu);
    if (status != OK)
        return status;
    const struct eyes_options eyes = {options->camera, t->has_place ? &t->place : NULL, options->wake,
                                      options->wake_self, viewfinder_can_borrow(t->viewfinder)};
    return eyes_open(&t->eyes, &eyes);
}

void tablet_close(struct tablet *t)
{
    viewfinder_close(&t->viewfinder);
    eyes_close(&t->eyes);
    stage_close(&t->stage);
    library_close(&t->library);
    place_free(&t->place);
    recording_free(&t->recording);
    ui_close(&t->ui);
    *t = (struct tablet){0};
}

static void open_take(struct tablet *t, int64_t now_ns)
{
    const char *name = t->library.cards[t->show.take].name;
    stage_close(&t->stage);
    t->looked = false;
    const struct stage_options how = {t->options.file, name, t->options.wake, t->options.wake_self};
    enum status status = stage_open(&t->stage, t->gpu, &how);
    if (status != OK) {
        snprintf(t->trouble, sizeof t->trouble, "%s", status_sentence());
        show_fail(&t->show, t->trouble);
        return;
    }
    struct orbit orbit = stage_orbit(t->stage);
    show_take(&t->show, stage_length_ns(t->stage), stage_frames(t->stage), &orbit, now_ns);
}

// ---------------------------------------------------------------- time

static void hear_eyes(struct tablet *t, int64_t now_ns)
{
    struct show_camera camera = {
        .there = t->eyes, .knows_place = t->has_place, .knows_tags = t->place.tag_count > 0, .trouble = ""};
    if (t->eyes) {
        const struct sight *sight = t->sight = eyes_look(t->eyes);
        t->eyes_now = eyes_state(t->eyes);
        camera.seeing = t->eyes_now.seeing;
        camera.came_ns = t->eyes_now.came_ns;
        camera.sight = sight ? sight->number : 0;
        camera.placed = sight && sight->placed;
        camera.moved_tags = sight ? sight->moved_tags : 0;
        camera.first_moved = sight ? sight->first_moved : -1;
        camera.trouble = t->eyes_now.trouble;
    }
    show_hear(&t->show, &camera, now_ns);
}

static void apply_fingers(struct tablet *t, int64_t now_ns)
{
    struct gesture g = gesture_take(&t->hands.gesture);
    double wheel = t->hands.wheel;
    t->hands.wheel = 0;
    if (wheel != 0)
        show_wheel(&t->show, wheel, now_ns);
    if (!t->screens.picture_held || !t->looked)
        return;
    struct ui_box all = {0, 0, ui_width(t->ui), ui_height(t->ui)};
    struct cover cover = cover_of(&t->picture.lens, all);
    struct vec3 from, to;
    double x = t->hands.pointer_x, y = t->hands.pointer_y, by_x = g.drag_x + g.push_x, by_y = g.drag_y + g.push_y;
    struct floor_drag drag;
    bool floor = cover_floor(&t->picture, cover, (struct ui_point){x - by_x, y - by_y}, &from) &&
                 cover_floor(&t->picture, cover, (struct ui_point){x, y}, &to);
    if (floor)
        drag = (struct floor_drag){from.x, from.y, to.x, to.y};
    g.drag_x /= all.h, g.drag_y /= all.h, g.push_x /= all.h, g.push_y /= all.h;
    show_gesture(&t->show, &g, floor ? &drag : NULL, now_ns);
}

// What is being prepared: how far it is, and where it came to nothing, why.
static void hear_stage(struct tablet *t)
{
    if (!t->stage)
        return;
    if (stage_prepare(t->stage) != OK) {
        snprintf(t->ailing, sizeof t->ailing, "%s", status_sentence());
        show_ail(&t->show, t->ailing);
    }
    show_prepare(&t->show, stage_prepared(t->stage));
    t->show.changed |= !stage_settled(t->stage);
}

// A recording that somebody took away plays on, for it is open; but it is said.
static void check_file(struct tablet *t, int64_t now_ns)
{
    if (now_ns - t->checked_ns < CHECK_NS || !t->stage)
        return;
    t->checked_ns = now_ns;
    bool gone = !file_exists(t->options.file);
    if (gone)
        snprintf(t->ailing, sizeof t->ailing, "%.200s was taken away; it can be watched until it is closed",
                 t->library.file);
    if (gone || t->show.ailing == t->ailing)
        show_ail(&t->show, gone ? t->ailing : NULL);
}

void tablet_rest(struct tablet *t, bool rest, int64_t now_ns)
{
    if (rest == t->resting)
        return;
    t->resting = rest;
    if (t->eyes)
        eyes_rest(t->eyes, rest);
    if (rest)
        t->rested_ns = now_ns;
    else
        show_slept(&t->show, t->rested_ns, now_ns);
}

int64_t tablet_update(struct tablet *t, int64_t now_ns)
{
    struct show *s = &t->show;
    hear_eyes(t, now_ns);
    apply_fingers(t, now_ns);
    bool sticks = hands_pad(&t->hands, s, fmin((double)(now_ns - t->padded_ns) * 1e-9, 0.1), now_ns);
    t->padded_ns = now_ns;
    if (s->take_wanted)
        open_take(t, now_ns);
    check_file(t, now_ns);
    hear_stage(t);
    int64_t next_ns = show_tick(s, now_ns);
    int64_t check_ns = t->checked_ns + CHECK_NS;
    if (s->page == PAGE_WATCH && t->stage && check_ns < next_ns)
        next_ns = check_ns;
    if (s->page == PAGE_WATCH && t->stage && stage_awaits(t->stage) && now_ns + AWAITED_NS < next_ns)
        next_ns = now_ns + AWAITED_NS;
    if (s->page == PAGE_WATCH && t->stage && !stage_settled(t->stage))
        next_ns = now_ns;
    return sticks ? now_ns : next_ns;
}

// ---------------------------------------------------------------- drawing

// What the controls leave of the screen.
static struct ui_box free_now(const struct tablet *t, const struct tablet_glass *glass)
{
    return layout_of(glass->width / glass->px_per_dp, glass->height / glass->px_per_dp, &t->show, &t->picture).free;
}

static double distance_between(struct ui_box a, struct ui_box b)
{
    return fmax(fmax(fabs(a.x - b.x), fabs(a.y - b.y)), fmax(fabs(a.w - b.w), fabs(a.h - b.h)));
}

// The orbit's picture makes room for what was opened, and takes it back.
static void make_room(struct tablet *t, const struct tablet_glass *glass, int64_t now_ns)
{
    const struct ui_box to = free_now(t, glass), from = t->free;
    const double passed_s = fmin((double)(now_ns - t->freed_ns) * 1e-9, LONGEST_STEP_S);
    const double share = 1 - exp(-fmax(passed_s, 0) / ROOM_S);
    t->freed_ns = now_ns;
    t->free = (struct ui_box){from.x + share * (to.x - from.x), from.y + share * (to.y - from.y),
                              from.w + share * (to.w - from.w), from.h + share * (to.h - from.h)};
    if (!t->looked || distance_between(t->free, to) < 0.5)
        t->free = to;
}

static struct stage_look look_now(struct tablet *t, const struct tablet_glass *glass, int64_t now_ns)
{
    struct show *s = &t->show;
    const struct sight *sight = s->orbiting ? NULL : t->sight;
    struct stage_look look;
    memset(&look, 0, sizeof look); // it is compared byte by byte
    look.playing = s->player.playing;
    look.loop = s->player.loop;
    look.placement = s->placement;
    look.fineness = t->options.fixed_fineness ? 1 : governor_scale(&t->governor);
    look.error_px = s->error_px;
    look.sources = s->sources;
    look.inset = s->inset;
    look.former = s->freshness < 1;
    if (sight) {
        look.lens = sight->lens;
        look.camera = viewfinder_texture(t->viewfinder);
        look.camera_number = sight->number;
        look.time_ns = player_at(&s->player, sight->came_ns); // the instant of this very picture
        // While it does not know, the actor fades where he was last; he does not jump.
        if (sight->placed)
            t->last_placed = sight->world_from_camera;
        look.world_from_camera = t->last_placed;
        look.nobody = !s->ever_placed || s->presence <= 0;
        return look;
    }
    const double px = glass->px_per_dp;
    const struct ui_box free = {t->free.x * px, t->free.y * px, t->free.w * px, t->free.h * px};
    look.lens = stage_orbit_lens(glass->width, glass->height, free);
    look.time_ns = player_at(&s->player, now_ns);
    look.world_from_camera = orbit_world_from_camera(&s->orbit);
    return look;
}

// The orbit goes along with whoever walks.
static void follow(struct tablet *t)
{
    struct show *s = &t->show;
    if (!s->orbiting || s->moving || !t->picture.has_skeleton || !(t->picture.skeleton.confidence[JOINT_WAIST] > 0))
        return;
    const struct vec3 waist = t->picture.skeleton.joint[JOINT_WAIST];
    if (v3_distance(s->orbit.centre, waist) < 0.002)
        return;
    s->orbit.centre = v3_mix(s->orbit.centre, waist, s->player.playing ? 0.05 : 0.25);
    s->changed = true;
}

// The sight's picture goes to the graphics chip, once.
static enum status find_sight(struct tablet *t)
{
    if (!t->sight || t->sight->number == t->found)
        return OK;
    struct loan *loan = eyes_take_loan(t->eyes);
    enum status status = viewfinder_show(t->viewfinder, t->sight, &loan);
    t->found = status == OK ? t->sight->number : 0;
    return status;
}

static enum status draw_picture(struct tablet *t, const struct tablet_glass *glass, int64_t now_ns)
{
    enum status status = t->show.orbiting ? OK : find_sight(t);
    if (status != OK)
        return status;
    make_room(t, glass, now_ns);
    struct stage_look look = look_now(t, glass, now_ns);
    if (t->looked && !memcmp(&look, &t->look, sizeof look) && stage_settled(t->stage))
        return OK; // the same again
    bool steady = t->looked;
    t->look = look;
    t->looked = true;
    status = stage_draw(t->stage, &look, &t->picture);
    show_model(&t->show, t->picture.prepared);
    t->show.changed |= look.camera == NULL && distance_between(t->free, free_now(t, glass)) > 0;
    if (steady)
        follow(t);
    if (status == ERR_CORRUPT || status == ERR_IO || status == ERR_INPUT) { // this frame cannot be read; others may be
        snprintf(t->ailing, sizeof t->ailing, "%s", status_sentence());
        show_ail(&t->show, t->ailing);
        return OK;
    }
    return status;
}

static enum status draw_screen(struct tablet *t, int64_t now_ns)
{
    const struct brush brush = {t->ui, theme_of(t->show.dark)};
    if (t->show.page == PAGE_TAKES) {
        const struct takes_page page = {t->library.file, t->library.cards, t->library.count};
        screen_takes(&brush, &t->screens, &t->show, &page, now_ns);
    } else if (t->show.page == PAGE_TROUBLE || !t->stage) {
        screen_trouble(&brush, &t->show, now_ns);
    } else {
        const struct watch_page page = {t->library.file, t->library.cards[t->show.take].name, &t->picture, &t->times,
                                        t->governor.budget_ms};
        screen_watch(&brush, &t->screens, &t->show, &page, now_ns);
    }
    screen_words(&brush, &t->show);
    return OK;
}

static enum status photograph(struct tablet *t, int64_t now_ns)
{
    const struct brush brush = {t->ui, theme_of(t->show.dark)};
    char path[600], notice[160];
    t->show.photo_wanted = false;
    enum status status = photograph_path(t->options.photos, path, sizeof path);
    if (status == OK)
        status = photograph_take(&brush, t->gpu, &t->picture, &t->show, path);
    if (status == ERR_DEVICE)
        return status;
    const char *name = strrchr(path, '/');
    snprintf(notice, sizeof notice, "%s%.120s", status == OK ? "Photographed: " : "",
             status == OK ? name + 1 : status_sentence());
    if (status == OK)
        show_say(&t->show, notice, now_ns);
    else
        show_warn(&t->show, notice, now_ns);
    return OK;
}

enum status tablet_draw(struct tablet *t, const struct tablet_glass *glass, int64_t now_ns)
{
    struct show *s = &t->show;
    enum status status = OK;
    t->drawing_ns = clock_now_ns();
    s->changed = false;
    if (s->page == PAGE_WATCH && t->stage)
        status = draw_picture(t, glass, now_ns);
    if (status == OK && s->photo_wanted && t->stage)
        status = photograph(t, now_ns);
    if (status != OK)
        return status;
    t->drawn_ns = clock_now_ns();
    const struct ui_input input = {
        glass->width,       glass->height,      glass->px_per_dp,      now_ns,
        t->hands.pointer_x, t->hands.pointer_y, t->hands.pointer_down, t->hands.pointer_there};
    status = ui_begin(t->ui, &input);
    if (status != OK)
        return status;
    status = draw_screen(t, now_ns);
    ui_end(t->ui);
    if (status == OK)
        status = ui_draw(t->ui, glass->target, glass->quarter_turns);
    s->changed |= t->hands.leaving;
    hands_drawn(&t->hands);
    t->controls_ns = clock_now_ns();
    double took_ms = (double)(t->controls_ns - t->drawing_ns) * 1e-6;
    if (s->page == PAGE_WATCH && s->player.playing && governor_drawn(&t->governor, took_ms))
        s->changed = true;
    return status;
}

void tablet_shown(struct tablet *t, int64_t now_ns)
{
    const struct sight *sight = t->show.orbiting ? NULL : t->sight;
    double ms[FRAME_STAGES] = {0};
    if (t->stage)
        stage_shown(t->stage);
    if (t->eyes)
        eyes_shown(t->eyes);
    if (t->show.page != PAGE_WATCH || (sight && sight->number == t->timed_sight))
        return;
    if (sight) {
        t->timed_sight = sight->number;
        t->placed += sight->placed && t->picture.parts > 0;
        ms[FRAME_LOCATE] = (double)(sight->located_ns - sight->locating_ns) * 1e-6;
        ms[FRAME_WAIT] = (double)(sight->locating_ns - sight->came_ns + t->drawing_ns - sight->located_ns) * 1e-6;
    }
    ms[FRAME_ACTOR] = (double)(t->drawn_ns - t->drawing_ns) * 1e-6;
    ms[FRAME_CONTROLS] = (double)(t->controls_ns - t->drawn_ns) * 1e-6;
    ms[FRAME_SHOW] = (double)(now_ns - t->controls_ns) * 1e-6;
    frame_times_add(&t->times, ms);
}
