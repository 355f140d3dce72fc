#include "app/studio/studio_screen.h"

#include "app/studio/coverage_figure.h"
#include "app/studio/room_screen.h"
#include "app/studio/studio_picture.h"
#include "app/studio/studio_verdict.h"
#include "platform/files/installed.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static const double SIDE = 380, ROW = 64, BESIDE = 480, LOW = 420, HINT_AND_COUNT = 300, BUTTONS_W = 520;

// ---------------------------------------------------------------- pieces

// Without colour images the depth image takes the large picture's place.
static const struct lens *large_lens(const struct studio_snapshot *shown)
{
    return studio_snapshot_sees_color(shown) ? &shown->calibration.color : &shown->calibration.depth;
}

static void draw_skeleton(const struct brush *brush, const struct studio_snapshot *shown, struct ui_box at)
{
    static const struct part_ends across[] = {{JOINT_LEFT_SHOULDER, JOINT_NECK},
                                              {JOINT_RIGHT_SHOULDER, JOINT_NECK},
                                              {JOINT_LEFT_HIP, JOINT_WAIST},
                                              {JOINT_RIGHT_HIP, JOINT_WAIST}};
    const struct lens *lens = large_lens(shown);
    const struct pose lens_from_color =
        studio_snapshot_sees_color(shown) ? POSE_IDENTITY : pose_inverse(shown->calibration.color_from_depth);
    struct ui_point points[JOINT_COUNT];
    bool there[JOINT_COUNT];
    for (int j = 0; j < JOINT_COUNT; j++) {
        there[j] = shown->skeleton.confidence[j] > 0 && shown->skeleton.joint[j].z > 0.1;
        if (!there[j])
            continue;
        const struct pixel px = lens_project(lens, pose_apply(lens_from_color, shown->skeleton.joint[j]));
        points[j] = (struct ui_point){at.x + at.w * (1 - px.x / lens->width), at.y + at.h * px.y / lens->height};
    }
    ui_clip(brush->ui, at);
    for (int pass = 0; pass < 2; pass++) {
        const uint32_t color = pass ? brush->theme->accent : 0x000000a0;
        for (size_t i = 0; i < PART_COUNT + COUNT_OF(across); i++) {
            const struct part_ends e = i < PART_COUNT ? part_ends[i] : across[i - PART_COUNT];
            if (there[e.from] && there[e.to])
                ui_line(brush->ui, points[e.from], points[e.to], pass ? 3 : 6, color);
        }
        for (int j = 0; j < JOINT_COUNT; j++)
            if (there[j])
                ui_disc(brush->ui, points[j], pass ? 5 : 7,
                        pass && shown->skeleton.confidence[j] < 1 ? brush->theme->warn : color);
    }
    ui_unclip(brush->ui);
}

enum { LINE_BYTES = 200 };

static void counters_text(const struct studio_snapshot *shown, char text[LINE_BYTES])
{
    const size_t size = LINE_BYTES;
    const struct studio_counters *c = &shown->counters;
    int used = c->frames_per_s >= 0.5 ? snprintf(text, size, "%.0f pictures/s", c->frames_per_s)
                                      : snprintf(text, size, "measuring");
    used += snprintf(text + used, size - (size_t)used, " · %lld dropped", (long long)c->dropped);
    if (c->mb_per_s >= 0.05)
        used += snprintf(text + used, size - (size_t)used, " · %.1f MB/s", c->mb_per_s);
    if (c->mb_per_s >= 0.05 && c->minutes_left >= 0) {
        const bool hours = c->minutes_left >= 180;
        used += snprintf(text + used, size - (size_t)used, hours ? " · %.0f h left" : " · %.0f min left",
                         hours ? c->minutes_left / 60 : c->minutes_left);
    }
    if (shown->distance_m > 0)
        snprintf(text + used, size - (size_t)used, " · %.1f m away", shown->distance_m);
}

// Whether the place is known, to how many millimetres, by which tags.
static void place_text(const struct studio_snapshot *shown, char text[LINE_BYTES])
{
    const size_t size = LINE_BYTES;
    const struct sensor_sight *sight = &shown->sight;
    int used = 0;
    if (!studio_snapshot_sees_color(shown)) {
        snprintf(text, size, "Without colour the sensor cannot tell where it stands");
        return;
    }
    if (!shown->has_place) {
        snprintf(text, size, "No place in the file: map the room first, or film without");
        return;
    }
    if (sight->mirrored) {
        snprintf(text, size, "The pictures are mirrored: switch the sensor's mirror off");
        return;
    }
    if (shown->located)
        used = snprintf(text, size, "Place known to %.0f mm", fmax(sight->position_sigma_m * 1e3, 1));
    else
        used = snprintf(text, size, "The place is not recognised yet");
    for (int i = 0; i < sight->tag_count && used < LINE_BYTES - 24; i++)
        used += snprintf(text + used, size - (size_t)used, "%s%d", i ? ", " : " · tags ", (int)sight->tags[i]);
    if (!sight->tag_count)
        used += snprintf(text + used, size - (size_t)used, " · no tag in sight");
    if (sight->points)
        snprintf(text + used, size - (size_t)used, " · %d landmarks", (int)sight->points);
}

static void draw_hint(const struct brush *brush, const struct studio_snapshot *shown, struct ui_box picture)
{
    enum icon icon = shown->advice == ADVICE_ENOUGH && shown->share > 0 ? ICON_CHECK : ICON_BONES;
    if (shown->fault)
        icon = ICON_WARNING;
    studio_hint_draw(brush, icon, shown->fault, shown->text, picture);
}

// ---------------------------------------------------------------- live, countdown, recording

// What has been seen of the person: the dial, and the figure where there is room for both.
static void draw_seen(const struct brush *brush, double share, enum pose_advice advice, const struct coverage *coverage,
                      struct ui_box in)
{
    static const double MIN_DIAL = 96, MIN_FIGURE = 70;
    const bool flat = in.h < 0.65 * in.w;
    const double side = flat ? fmin(in.h, in.w * 0.4) : fmin(160, in.h * 0.45);
    if (side >= MIN_DIAL)
        coverage_dial_draw(brush, share, advice, flat ? cut_left(&in, side) : cut_top(&in, side));
    if (in.h >= MIN_FIGURE && in.w >= 2 * MIN_FIGURE)
        coverage_figure_draw(brush, coverage, in);
}

static void draw_side(const struct brush *brush, const struct studio_view *view, struct ui_box box, bool upright)
{
    if (studio_snapshot_sees_color(view->shown) && (upright ? box.w > 500 : box.h > 300)) {
        struct ui_box depth = upright ? cut_left(&box, box.w * 0.5) : cut_top(&box, fmin(box.w * 0.75, box.h * 0.45));
        studio_picture_draw(brush, view->depth, &view->shown->calibration.depth, depth, true);
    }
    panel(brush, box, false);
    draw_seen(brush, view->shown->share, view->shown->advice, &view->shown->coverage, inner(box, 12));
}

static void draw_countdown(const struct brush *brush, const struct studio_state *state, struct ui_box picture)
{
    char text[8];
    snprintf(text, sizeof text, "%d", state->left_s);
    const struct ui_point m = middle(picture);
    ui_disc(brush->ui, m, 74, brush->theme->glass);
    ui_ring(brush->ui, m, 74, 6, brush->theme->accent);
    label_centred(brush, FACE_TITLE, (struct ui_box){m.x - 60, m.y - 30, 120, 60}, brush->theme->text, text);
}

static void draw_recording_mark(const struct brush *brush, const struct studio_snapshot *shown, struct ui_box picture)
{
    const struct ui_box box = {picture.x + 16, picture.y + 16, 132, 40};
    ui_fill(brush->ui, box, 20, brush->theme->glass);
    ui_disc(brush->ui, (struct ui_point){box.x + 22, box.y + 20}, 9, 0xef4444ff);
    label_time(brush, (struct ui_point){box.x + 42, box.y + 9}, brush->theme->text,
               (int64_t)(shown->counters.take_s * 1e9));
}

static void draw_paused(const struct brush *brush, struct ui_box picture)
{
    const struct ui_point m = middle(picture);
    ui_disc(brush->ui, m, 74, brush->theme->glass);
    ui_fill(brush->ui, (struct ui_box){m.x - 26, m.y - 32, 18, 64}, 4, brush->theme->warn);
    ui_fill(brush->ui, (struct ui_box){m.x + 8, m.y - 32, 18, 64}, 4, brush->theme->warn);
}

static const char *main_button(const struct studio_state *state)
{
    switch (state->page) {
    case STUDIO_COUNTDOWN: return "Wait";
    case STUDIO_RECORDING: return "Stop";
    case STUDIO_FINISHING: return "One moment ...";
    case STUDIO_OPENING: return "Starting ...";
    default: return "Film";
    }
}

enum { FOOT_LINES = 3 };
struct live_foot {
    char line[FOOT_LINES][LINE_BYTES];
    uint32_t color[FOOT_LINES];
    struct control controls[4];
    int control_count;
    int first;   // line; a low screen leaves out the counters
    bool beside; // the texts are beside the buttons, else over them
    double text_w, buttons_w, text_h, buttons_h;
};

static void fill_foot(struct live_foot *foot, const struct brush *brush, const struct studio_state *state,
                      const struct studio_view *view)
{
    const struct theme *t = brush->theme;
    const bool place = view->shown->has_place && studio_snapshot_sees_color(view->shown);
    const bool waits = state->page == STUDIO_FINISHING || state->page == STUDIO_OPENING;
    counters_text(view->shown, foot->line[0]);
    place_text(view->shown, foot->line[1]);
    const char *gesture = "Raise a hand above your head to start";
    if (state->page == STUDIO_RECORDING)
        gesture = "Raise a hand above your head to stop";
    else if (state->in_a_row)
        gesture = "Raise a hand above your head to start; takes are kept one after the other";
    snprintf(foot->line[2], LINE_BYTES, "%s", gesture);
    foot->color[0] = view->shown->counters.dropped ? t->warn : t->quiet;
    foot->color[1] = view->shown->located ? t->text : t->warn;
    if (!place)
        foot->color[1] = t->quiet;
    foot->color[2] = t->quiet;
    if (state->page == STUDIO_RECORDING)
        foot->controls[foot->control_count++] = (struct control){
            "studio-pause", state->paused ? "Go on" : "Pause", state->paused ? BUTTON_ON : BUTTON_RAISED, STUDIO_PAUSE};
    if (state->page == STUDIO_LIVE)
        foot->controls[foot->control_count++] =
            (struct control){"studio-row", "In a row", state->in_a_row ? BUTTON_ON : BUTTON_RAISED, STUDIO_IN_A_ROW};
    static const char *const purposes[STUDIO_PURPOSES] = {"For both", "To compare", "To watch"};
    if (state->page == STUDIO_LIVE)
        foot->controls[foot->control_count++] =
            (struct control){"studio-purpose", purposes[state->purpose], BUTTON_RAISED, STUDIO_PURPOSE};
    if (state->page == STUDIO_LIVE && studio_snapshot_sees_color(view->shown))
        foot->controls[foot->control_count++] = (struct control){"studio-room", "Room", BUTTON_RAISED, STUDIO_MAP_ROOM};
    foot->controls[foot->control_count++] =
        (struct control){"studio-main", main_button(state), waits ? BUTTON_ON : BUTTON_MAIN, STUDIO_START};
}

// Texts and buttons, as high as they are at that width.
static struct live_foot measure_foot(const struct brush *brush, const struct studio_state *state,
                                     const struct studio_view *view, double width)
{
    struct live_foot f = {.beside = width >= BESIDE, .first = ui_height(brush->ui) < LOW};
    fill_foot(&f, brush, state, view);
    f.buttons_w = f.beside ? fmin(BUTTONS_W, 0.6 * width) : width;
    f.text_w = f.beside ? width - f.buttons_w - 2 * GAP : width;
    f.buttons_h = controls_height(brush, f.controls, f.control_count, f.buttons_w);
    for (int i = f.first; i < FOOT_LINES; i++)
        f.text_h += ui_text_height(brush->ui, FACE_SMALL, f.line[i], f.text_w) + 4;
    return f;
}

static double foot_height(const struct live_foot *foot)
{
    return foot->beside ? fmax(foot->text_h, foot->buttons_h) : foot->text_h + GAP + foot->buttons_h;
}

static void draw_live_foot(const struct brush *brush, struct studio_state *state, const struct live_foot *live_foot,
                           struct ui_box foot, int64_t now_ns)
{
    struct ui_box row =
        live_foot->beside ? cut_right(&foot, live_foot->buttons_w) : cut_bottom(&foot, live_foot->buttons_h);
    row = (struct ui_box){row.x, row.y + (row.h - live_foot->buttons_h) / 2, row.w, live_foot->buttons_h};
    const int done = controls_draw(brush, live_foot->controls, live_foot->control_count, row);
    if (done >= 0)
        studio_do(state, (enum studio_action)done, now_ns);
    double y = foot.y;
    for (int i = live_foot->first; i < FOOT_LINES; i++) {
        ui_text_lines(brush->ui, FACE_SMALL, (struct ui_point){foot.x, y}, live_foot->text_w, live_foot->color[i],
                      live_foot->line[i]);
        y += ui_text_height(brush->ui, FACE_SMALL, live_foot->line[i], live_foot->text_w) + 4;
    }
}

// What the picture leaves, in its own shape, and at least a third.
static struct ui_box cut_side(const struct studio_view *view, struct ui_box *in, bool upright)
{
    const struct lens *lens = large_lens(view->shown);
    const double aspect = lens->width > 0 ? (double)lens->width / lens->height : 4.0 / 3;
    if (upright)
        return cut_bottom(in, fmax(in->h - in->w / aspect - GAP, in->h * 0.36));
    return cut_right(in, fmax(in->w - in->h * aspect - GAP, fmin(SIDE, in->w * 0.32)));
}

static void draw_live(const struct brush *brush, struct studio_state *state, const struct studio_view *view,
                      struct ui_box in, int64_t now_ns)
{
    const bool upright = in.h > in.w;
    const struct live_foot measured = measure_foot(brush, state, view, in.w);
    struct ui_box foot = cut_bottom(&in, foot_height(&measured));
    struct ui_box side = cut_side(view, &in, upright);
    const struct gpu_texture *picture = studio_snapshot_sees_color(view->shown) ? view->color : view->depth;
    const struct ui_box at = studio_picture_draw(brush, picture, large_lens(view->shown), in, true);
    if (view->shown->has_skeleton && picture)
        draw_skeleton(brush, view->shown, at);
    if (state->page == STUDIO_RECORDING)
        draw_recording_mark(brush, view->shown, in);
    if (view->shown->number && (state->page != STUDIO_COUNTDOWN || in.h >= HINT_AND_COUNT))
        draw_hint(brush, view->shown, in);
    if (state->page == STUDIO_COUNTDOWN)
        draw_countdown(brush, state, in);
    draw_side(brush, view, side, upright);
    if (state->page == STUDIO_RECORDING && state->paused)
        draw_paused(brush, in);
    draw_live_foot(brush, state, &measured, foot, now_ns);
}

// ---------------------------------------------------------------- sensors, review, trouble

static void draw_no_sensor(const struct brush *brush, struct ui_box in)
{
    char path[INSTALLED_PATH_BYTES], text[INSTALLED_PATH_BYTES + 300];
    snprintf(text, sizeof text,
             "No depth sensor was found. Plug one in (a Kinect also needs its own power supply), then look again. "
             "A sensor that is plugged in and not found may need a udev rule; %s says which.",
             installed_text("sensors.md", path));
    paragraph(brush, FACE_BODY, in, brush->theme->text, text);
}

static void draw_sensors(const struct brush *brush, struct studio_state *state, const struct studio_view *view,
                         struct ui_box in, int64_t now_ns)
{
    char name[32];
    int more = 0;
    const struct ui_box again = cut_bottom(&in, TARGET);
    if (text_button(brush, "studio-again", "Look again", BUTTON_RAISED,
                    (struct ui_box){again.x, again.y, fmin(240, again.w), again.h}))
        studio_do(state, STUDIO_SENSORS_AGAIN, now_ns);
    if (!view->device_count) {
        draw_no_sensor(brush, in);
        return;
    }
    in.w = fmin(in.w, 640);
    const struct brush inside = scroll_begin(brush, view->scroll, &in, view->device_count * (ROW + GAP));
    for (int i = 0; i < view->device_count; i++) {
        struct ui_box row = {in.x, in.y + i * (ROW + GAP) - view->scroll->at, in.w - 8, ROW};
        more += row.y + row.h > in.y + in.h + 1;
        snprintf(name, sizeof name, "sensor-%d", i);
        if (text_button(&inside, name, "", BUTTON_RAISED, row))
            studio_choose_sensor(state, i, now_ns);
        row = (struct ui_box){row.x + 28, row.y, row.w - 56, row.h};
        const bool named = strcmp(view->devices[i].name, view->devices[i].uri) != 0;
        if (named)
            label(brush, FACE_SMALL, cut_bottom(&row, 26), brush->theme->quiet, view->devices[i].uri);
        label(brush, FACE_STRONG, row, brush->theme->text, view->devices[i].name);
    }
    scroll_end(brush, view->scroll, more);
}

static void draw_name(const struct brush *brush, const struct studio_state *state, struct ui_box box)
{
    char text[STUDIO_NAME + 40];
    if (state->page == STUDIO_RENAME) {
        ui_border(brush->ui, box, 12, 2, brush->theme->accent);
        snprintf(text, sizeof text, "%s|", state->name);
        label(brush, FACE_HEAD, inner(box, 12), brush->theme->text, text);
    } else {
        label(brush, FACE_HEAD, box, brush->theme->text, state->take);
    }
}

static const char rename_help[] = "Type a name, Enter when done, Escape to leave it";

static void draw_rename_buttons(const struct brush *brush, struct studio_state *state, struct ui_box buttons,
                                int64_t now_ns)
{
    static const struct control choices[] = {{"rename-done", "Done", BUTTON_MAIN, 0},
                                             {"rename-leave", "Leave it", BUTTON_RAISED, 1}};
    struct ui_box row = cut_bottom(&buttons, TARGET), words = row;
    if (row.w > 640)
        words = (struct ui_box){row.x + 320, row.y + 18, row.w - 320, row.h};
    else
        words = (struct ui_box){buttons.x, buttons.y, buttons.w, buttons.h};
    const int done = controls_draw(brush, choices, 2, (struct ui_box){row.x, row.y, fmin(row.w, 300), row.h});
    if (done == 0)
        studio_type_done(state, now_ns);
    else if (done == 1)
        studio_do(state, STUDIO_BACK, now_ns);
    paragraph(brush, FACE_SMALL, words, brush->theme->quiet, rename_help);
}

static void draw_leaving_buttons(const struct brush *brush, struct studio_state *state, struct ui_box buttons,
                                 int64_t now_ns)
{
    static const struct control choices[] = {{"leaving-keep", "Keep", BUTTON_MAIN, STUDIO_KEEP},
                                             {"leaving-discard", "Discard", BUTTON_RAISED, STUDIO_DISCARD},
                                             {"leaving-stay", "Stay", BUTTON_RAISED, STUDIO_BACK}};
    struct ui_box row = cut_bottom(&buttons, TARGET), words = buttons;
    if (row.w > 640)
        words = (struct ui_box){row.x + 420, row.y + 18, row.w - 420, row.h};
    const int done = controls_draw(brush, choices, 3, (struct ui_box){row.x, row.y, fmin(row.w, 400), row.h});
    if (done >= 0)
        studio_do(state, (enum studio_action)done, now_ns);
    paragraph(brush, FACE_SMALL, words, brush->theme->quiet, "Leaving again keeps it");
}

static void draw_review(const struct brush *brush, struct studio_state *state, const struct studio_view *view,
                        struct ui_box in, int64_t now_ns)
{
    const bool keep = view->shown->judgement.verdict.seen; // the bright one
    const struct control choices[] = {{"Keep", "Keep", keep ? BUTTON_MAIN : BUTTON_RAISED, STUDIO_KEEP},
                                      {"Play", "Play", BUTTON_RAISED, STUDIO_PLAY},
                                      {"Once more", "Once more", keep ? BUTTON_RAISED : BUTTON_MAIN, STUDIO_RETAKE},
                                      {"Discard", "Discard", BUTTON_RAISED, STUDIO_DISCARD},
                                      {"Rename", "Rename", BUTTON_RAISED, STUDIO_EDIT_NAME}};
    const int choice_count = (int)COUNT_OF(choices);
    const bool upright = in.h > in.w, renames = state->page == STUDIO_RENAME;
    const double choices_h = controls_height(brush, choices, choice_count, in.w);
    char text[120];
    struct ui_box name = cut_top(&in, 52),
                  buttons = cut_bottom(&in, (renames || state->page == STUDIO_LEAVING) && in.w <= 640
                                                ? fmax(choices_h, TARGET + 48)
                                                : choices_h);
    draw_name(brush, state, (struct ui_box){name.x, name.y, fmin(name.w, 520), name.h});
    struct ui_box figure = upright ? cut_bottom(&in, fmin(in.h * 0.45, 380)) : cut_right(&in, in.w * 0.45);
    studio_verdict_draw(brush, &view->shown->judgement.verdict, view->shown->failure, view->scroll, in);
    panel(brush, figure, false);
    figure = inner(figure, 14);
    snprintf(text, sizeof text, "%lld pictures", (long long)view->shown->judgement.frames);
    label(brush, FACE_SMALL, cut_bottom(&figure, 24), brush->theme->quiet, text);
    draw_seen(brush, coverage_share(&view->shown->judgement.seen), ADVICE_ENOUGH, &view->shown->judgement.seen, figure);
    if (renames) {
        draw_rename_buttons(brush, state, buttons, now_ns);
        return;
    }
    if (state->page == STUDIO_LEAVING) {
        draw_leaving_buttons(brush, state, buttons, now_ns);
        return;
    }
    const int done = controls_draw(brush, choices, choice_count, buttons);
    if (done >= 0)
        studio_do(state, (enum studio_action)done, now_ns);
}

static void draw_trouble(const struct brush *brush, struct studio_state *state, struct ui_box in, int64_t now_ns)
{
    const struct ui_box button = cut_bottom(&in, TARGET), later = cut_bottom(&in, 24);
    icon_draw(brush->ui, ICON_WARNING, (struct ui_point){in.x + 24, in.y + 24}, 40, brush->theme->warn);
    struct ui_box words = in;
    cut_top(&words, 50);
    paragraph(brush, FACE_BODY, words, brush->theme->text, state->trouble);
    label(brush, FACE_SMALL, later, brush->theme->quiet, "It is used again when it is back");
    if (text_button(brush, "studio-retry", "Choose a sensor", BUTTON_MAIN,
                    (struct ui_box){button.x, button.y, fmin(280, button.w), button.h}))
        studio_do(state, STUDIO_SENSORS_AGAIN, now_ns);
}

static const char *title(const struct studio_state *state)
{
    switch (state->page) {
    case STUDIO_SENSORS: return "Which sensor?";
    case STUDIO_REVIEW:
    case STUDIO_RENAME: return "How it went";
    case STUDIO_LEAVING: return "Keep this take?";
    case STUDIO_ROOM:
    case STUDIO_ROOM_FINISHING: return "The room";
    case STUDIO_ROOM_REVIEW: return "How well the room is known";
    case STUDIO_TROUBLE: return "The sensor does not work";
    default: return "Studio";
    }
}

// What waits to be carried out, and the button that takes it back.
static void draw_undo(const struct brush *brush, struct studio_state *state, struct ui_box *head, char text[300],
                      int64_t now_ns)
{
    char button[24];
    const struct studio_erasure *e = &state->waiting;
    const double length_s = (double)(e->to_ns - e->from_ns) * 1e-9;
    snprintf(button, sizeof button, "Undo %d", studio_undo_left_s(state, now_ns));
    if (e->kind == ERASES_TAKE)
        snprintf(text, 300, "%.60s is discarded", e->take);
    else
        snprintf(text, 300, "%.60s is cut to %.1f s", e->take, length_s);
    if (text_button(brush, "studio-undo", button, BUTTON_MAIN, cut_right(head, 110)))
        studio_do(state, STUDIO_UNDO, now_ns);
    if (ui_text_width(brush->ui, FACE_SMALL, text) <= head->w)
        return;
    if (e->kind == ERASES_TAKE)
        snprintf(text, 300, "discarded");
    else
        snprintf(text, 300, "cut to %.1f s", length_s);
}

void studio_screen_draw(const struct brush *brush, struct studio_state *state, const struct studio_view *view,
                        int64_t now_ns)
{
    char text[300];
    struct ui_box all = {0, 0, ui_width(brush->ui), ui_height(brush->ui)}, in = inner(all, 20);
    ui_fill(brush->ui, all, 0, brush->theme->ground);
    struct ui_box head = cut_top(&in, TARGET);
    if (icon_button(brush, "studio-close", (struct icon_words){ICON_CLOSE, "Close"}, BUTTON_RAISED,
                    cut_right(&head, TARGET)))
        studio_do(state, STUDIO_QUIT, now_ns);
    if (icon_button(brush, "studio-theme", theme_words(state->dark), BUTTON_RAISED, cut_right(&head, TARGET)))
        studio_do(state, STUDIO_THEME, now_ns);
    const bool waits = state->waiting.kind != ERASES_NOTHING;
    if (waits)
        draw_undo(brush, state, &head, text, now_ns);
    label(brush, FACE_HEAD, (struct ui_box){head.x, head.y, head.w, 30}, brush->theme->text, title(state));
    if (!waits && *state->notice)
        snprintf(text, sizeof text, "%s", state->notice);
    else if (!waits && state->kept < 2)
        snprintf(text, sizeof text, "%.250s · %s", view->file, state->kept ? "one take kept" : "no take kept yet");
    else if (!waits)
        snprintf(text, sizeof text, "%.250s · %d takes kept", view->file, state->kept);
    label(brush, FACE_SMALL, (struct ui_box){head.x, head.y + 32, head.w, 24},
          waits || *state->notice ? brush->theme->accent : brush->theme->quiet, text);
    switch (state->page) {
    case STUDIO_SENSORS: draw_sensors(brush, state, view, in, now_ns); break;
    case STUDIO_REVIEW:
    case STUDIO_RENAME:
    case STUDIO_LEAVING:
    case STUDIO_PLAYBACK: draw_review(brush, state, view, in, now_ns); break;
    case STUDIO_ROOM:
    case STUDIO_ROOM_FINISHING:
    case STUDIO_ROOM_REVIEW: room_screen_draw(brush, state, view, in, now_ns); break;
    case STUDIO_TROUBLE: draw_trouble(brush, state, in, now_ns); break;
    default: draw_live(brush, state, view, in, now_ns); break;
    }
}
