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

static void draw_skeleton(const struct brush *b, const struct studio_snapshot *shown, struct ui_box at)
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
    ui_clip(b->ui, at);
    for (int pass = 0; pass < 2; pass++) {
        const uint32_t color = pass ? b->theme->accent : 0x000000a0;
        for (size_t i = 0; i < PART_COUNT + COUNT_OF(across); i++) {
            const struct part_ends e = i < PART_COUNT ? part_ends[i] : across[i - PART_COUNT];
            if (there[e.from] && there[e.to])
                ui_line(b->ui, points[e.from], points[e.to], pass ? 3 : 6, color);
        }
        for (int j = 0; j < JOINT_COUNT; j++)
            if (there[j])
                ui_disc(b->ui, points[j], pass ? 5 : 7,
                        pass && shown->skeleton.confidence[j] < 1 ? b->theme->warn : color);
    }
    ui_unclip(b->ui);
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

static void draw_hint(const struct brush *b, const struct studio_snapshot *shown, struct ui_box picture)
{
    const enum icon icon = shown->fault                                         ? ICON_WARNING
                           : shown->advice == ADVICE_ENOUGH && shown->share > 0 ? ICON_CHECK
                                                                                : ICON_BONES;
    studio_hint_draw(b, icon, shown->fault, shown->text, picture);
}

// ---------------------------------------------------------------- live, countdown, recording

// What has been seen of the person: the dial, and the figure where there is room for both.
static void draw_seen(const struct brush *b, double share, enum pose_advice advice, const struct coverage *coverage,
                      struct ui_box in)
{
    static const double LEAST_DIAL = 96, LEAST_FIGURE = 70;
    const bool flat = in.h < 0.65 * in.w;
    const double side = flat ? fmin(in.h, in.w * 0.4) : fmin(160, in.h * 0.45);
    if (side >= LEAST_DIAL)
        coverage_dial_draw(b, share, advice, flat ? cut_left(&in, side) : cut_top(&in, side));
    if (in.h >= LEAST_FIGURE && in.w >= 2 * LEAST_FIGURE)
        coverage_figure_draw(b, coverage, in);
}

static void draw_side(const struct brush *b, const struct studio_view *v, struct ui_box box, bool upright)
{
    if (studio_snapshot_sees_color(v->shown) && (upright ? box.w > 500 : box.h > 300)) {
        struct ui_box depth = upright ? cut_left(&box, box.w * 0.5) : cut_top(&box, fmin(box.w * 0.75, box.h * 0.45));
        studio_picture_draw(b, v->depth, &v->shown->calibration.depth, depth, true);
    }
    panel(b, box, false);
    draw_seen(b, v->shown->share, v->shown->advice, &v->shown->coverage, inner(box, 12));
}

static void draw_countdown(const struct brush *b, const struct studio_state *s, struct ui_box picture)
{
    char text[8];
    snprintf(text, sizeof text, "%d", s->left_s);
    const struct ui_point m = middle(picture);
    ui_disc(b->ui, m, 74, b->theme->glass);
    ui_ring(b->ui, m, 74, 6, b->theme->accent);
    label_centred(b, FACE_TITLE, (struct ui_box){m.x - 60, m.y - 30, 120, 60}, b->theme->text, text);
}

static void draw_recording_mark(const struct brush *b, const struct studio_snapshot *shown, struct ui_box picture)
{
    const struct ui_box box = {picture.x + 16, picture.y + 16, 132, 40};
    ui_fill(b->ui, box, 20, b->theme->glass);
    ui_disc(b->ui, (struct ui_point){box.x + 22, box.y + 20}, 9, 0xef4444ff);
    label_time(b, (struct ui_point){box.x + 42, box.y + 9}, b->theme->text, (int64_t)(shown->counters.take_s * 1e9));
}

static void draw_paused(const struct brush *b, struct ui_box picture)
{
    const struct ui_point m = middle(picture);
    ui_disc(b->ui, m, 74, b->theme->glass);
    ui_fill(b->ui, (struct ui_box){m.x - 26, m.y - 32, 18, 64}, 4, b->theme->warn);
    ui_fill(b->ui, (struct ui_box){m.x + 8, m.y - 32, 18, 64}, 4, b->theme->warn);
}

static const char *main_button(const struct studio_state *s)
{
    switch (s->page) {
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

static void fill_foot(struct live_foot *f, const struct brush *b, const struct studio_state *s,
                      const struct studio_view *v)
{
    const struct theme *t = b->theme;
    const bool place = v->shown->has_place && studio_snapshot_sees_color(v->shown);
    const bool waits = s->page == STUDIO_FINISHING || s->page == STUDIO_OPENING;
    counters_text(v->shown, f->line[0]);
    place_text(v->shown, f->line[1]);
    snprintf(f->line[2], LINE_BYTES, "%s",
             s->page == STUDIO_RECORDING ? "Raise a hand above your head to stop"
             : s->in_a_row               ? "Raise a hand above your head to start; takes are kept one after the other"
                                         : "Raise a hand above your head to start");
    f->color[0] = v->shown->counters.dropped ? t->warn : t->quiet;
    f->color[1] = !place ? t->quiet : v->shown->located ? t->text : t->warn;
    f->color[2] = t->quiet;
    if (s->page == STUDIO_RECORDING)
        f->controls[f->control_count++] = (struct control){"studio-pause", s->paused ? "Go on" : "Pause",
                                                           s->paused ? BUTTON_ON : BUTTON_RAISED, STUDIO_PAUSE};
    if (s->page == STUDIO_LIVE)
        f->controls[f->control_count++] =
            (struct control){"studio-row", "In a row", s->in_a_row ? BUTTON_ON : BUTTON_RAISED, STUDIO_IN_A_ROW};
    static const char *const purposes[STUDIO_PURPOSES] = {"For both", "To compare", "To watch"};
    if (s->page == STUDIO_LIVE)
        f->controls[f->control_count++] =
            (struct control){"studio-purpose", purposes[s->purpose], BUTTON_RAISED, STUDIO_PURPOSE};
    if (s->page == STUDIO_LIVE && studio_snapshot_sees_color(v->shown))
        f->controls[f->control_count++] = (struct control){"studio-room", "Room", BUTTON_RAISED, STUDIO_MAP_ROOM};
    f->controls[f->control_count++] =
        (struct control){"studio-main", main_button(s), waits ? BUTTON_ON : BUTTON_MAIN, STUDIO_START};
}

// Texts and buttons, as high as they are at that width.
static struct live_foot measure_foot(const struct brush *b, const struct studio_state *s, const struct studio_view *v,
                                     double width)
{
    struct live_foot f = {.beside = width >= BESIDE, .first = ui_height(b->ui) < LOW};
    fill_foot(&f, b, s, v);
    f.buttons_w = f.beside ? fmin(BUTTONS_W, 0.6 * width) : width;
    f.text_w = f.beside ? width - f.buttons_w - 2 * GAP : width;
    f.buttons_h = controls_height(b, f.controls, f.control_count, f.buttons_w);
    for (int i = f.first; i < FOOT_LINES; i++)
        f.text_h += ui_text_height(b->ui, FACE_SMALL, f.line[i], f.text_w) + 4;
    return f;
}

static double foot_height(const struct live_foot *f)
{
    return f->beside ? fmax(f->text_h, f->buttons_h) : f->text_h + GAP + f->buttons_h;
}

static void draw_live_foot(const struct brush *b, struct studio_state *s, const struct live_foot *f, struct ui_box foot,
                           int64_t now_ns)
{
    struct ui_box row = f->beside ? cut_right(&foot, f->buttons_w) : cut_bottom(&foot, f->buttons_h);
    row = (struct ui_box){row.x, row.y + (row.h - f->buttons_h) / 2, row.w, f->buttons_h};
    const int done = controls_draw(b, f->controls, f->control_count, row);
    if (done >= 0)
        studio_do(s, (enum studio_action)done, now_ns);
    double y = foot.y;
    for (int i = f->first; i < FOOT_LINES; i++) {
        ui_text_lines(b->ui, FACE_SMALL, (struct ui_point){foot.x, y}, f->text_w, f->color[i], f->line[i]);
        y += ui_text_height(b->ui, FACE_SMALL, f->line[i], f->text_w) + 4;
    }
}

// What the picture leaves, in its own shape, and at least a third.
static struct ui_box cut_side(const struct studio_view *v, struct ui_box *in, bool upright)
{
    const struct lens *lens = large_lens(v->shown);
    const double aspect = lens->width > 0 ? (double)lens->width / lens->height : 4.0 / 3;
    if (upright)
        return cut_bottom(in, fmax(in->h - in->w / aspect - GAP, in->h * 0.36));
    return cut_right(in, fmax(in->w - in->h * aspect - GAP, fmin(SIDE, in->w * 0.32)));
}

static void draw_live(const struct brush *b, struct studio_state *s, const struct studio_view *v, struct ui_box in,
                      int64_t now_ns)
{
    const bool upright = in.h > in.w;
    const struct live_foot measured = measure_foot(b, s, v, in.w);
    struct ui_box foot = cut_bottom(&in, foot_height(&measured));
    struct ui_box side = cut_side(v, &in, upright);
    const struct gpu_texture *picture = studio_snapshot_sees_color(v->shown) ? v->color : v->depth;
    const struct ui_box at = studio_picture_draw(b, picture, large_lens(v->shown), in, true);
    if (v->shown->has_skeleton && picture)
        draw_skeleton(b, v->shown, at);
    if (s->page == STUDIO_RECORDING)
        draw_recording_mark(b, v->shown, in);
    if (v->shown->number && (s->page != STUDIO_COUNTDOWN || in.h >= HINT_AND_COUNT))
        draw_hint(b, v->shown, in);
    if (s->page == STUDIO_COUNTDOWN)
        draw_countdown(b, s, in);
    draw_side(b, v, side, upright);
    if (s->page == STUDIO_RECORDING && s->paused)
        draw_paused(b, in);
    draw_live_foot(b, s, &measured, foot, now_ns);
}

// ---------------------------------------------------------------- sensors, review, trouble

static void draw_no_sensor(const struct brush *b, struct ui_box in)
{
    char path[INSTALLED_PATH_BYTES], text[INSTALLED_PATH_BYTES + 300];
    snprintf(text, sizeof text,
             "No depth sensor was found. Plug one in (a Kinect also needs its own power supply), then look again. "
             "A sensor that is plugged in and not found may need a udev rule; %s says which.",
             installed_text("sensors.md", path));
    paragraph(b, FACE_BODY, in, b->theme->text, text);
}

static void draw_sensors(const struct brush *b, struct studio_state *s, const struct studio_view *v, struct ui_box in,
                         int64_t now_ns)
{
    char name[32];
    int more = 0;
    const struct ui_box again = cut_bottom(&in, TARGET);
    if (text_button(b, "studio-again", "Look again", BUTTON_RAISED,
                    (struct ui_box){again.x, again.y, fmin(240, again.w), again.h}))
        studio_do(s, STUDIO_SENSORS_AGAIN, now_ns);
    if (!v->device_count) {
        draw_no_sensor(b, in);
        return;
    }
    in.w = fmin(in.w, 640);
    const struct brush inside = scroll_begin(b, v->scroll, &in, v->device_count * (ROW + GAP));
    for (int i = 0; i < v->device_count; i++) {
        struct ui_box row = {in.x, in.y + i * (ROW + GAP) - v->scroll->at, in.w - 8, ROW};
        more += row.y + row.h > in.y + in.h + 1;
        snprintf(name, sizeof name, "sensor-%d", i);
        if (text_button(&inside, name, "", BUTTON_RAISED, row))
            studio_choose_sensor(s, i, now_ns);
        row = (struct ui_box){row.x + 28, row.y, row.w - 56, row.h};
        const bool named = strcmp(v->devices[i].name, v->devices[i].uri) != 0;
        if (named)
            label(b, FACE_SMALL, cut_bottom(&row, 26), b->theme->quiet, v->devices[i].uri);
        label(b, FACE_STRONG, row, b->theme->text, v->devices[i].name);
    }
    scroll_end(b, v->scroll, more);
}

static void draw_name(const struct brush *b, const struct studio_state *s, struct ui_box box)
{
    char text[STUDIO_NAME + 40];
    if (s->page == STUDIO_RENAME) {
        ui_border(b->ui, box, 12, 2, b->theme->accent);
        snprintf(text, sizeof text, "%s|", s->name);
        label(b, FACE_HEAD, inner(box, 12), b->theme->text, text);
    } else {
        label(b, FACE_HEAD, box, b->theme->text, s->take);
    }
}

static const char rename_help[] = "Type a name, Enter when done, Escape to leave it";

static void draw_rename_buttons(const struct brush *b, struct studio_state *s, struct ui_box buttons, int64_t now_ns)
{
    static const struct control choices[] = {{"rename-done", "Done", BUTTON_MAIN, 0},
                                             {"rename-leave", "Leave it", BUTTON_RAISED, 1}};
    struct ui_box row = cut_bottom(&buttons, TARGET), words = row;
    if (row.w > 640)
        words = (struct ui_box){row.x + 320, row.y + 18, row.w - 320, row.h};
    else
        words = (struct ui_box){buttons.x, buttons.y, buttons.w, buttons.h};
    const int done = controls_draw(b, choices, 2, (struct ui_box){row.x, row.y, fmin(row.w, 300), row.h});
    if (done == 0)
        studio_type_done(s, now_ns);
    else if (done == 1)
        studio_do(s, STUDIO_BACK, now_ns);
    paragraph(b, FACE_SMALL, words, b->theme->quiet, rename_help);
}

static void draw_leaving_buttons(const struct brush *b, struct studio_state *s, struct ui_box buttons, int64_t now_ns)
{
    static const struct control choices[] = {{"leaving-keep", "Keep", BUTTON_MAIN, STUDIO_KEEP},
                                             {"leaving-discard", "Discard", BUTTON_RAISED, STUDIO_DISCARD},
                                             {"leaving-stay", "Stay", BUTTON_RAISED, STUDIO_BACK}};
    struct ui_box row = cut_bottom(&buttons, TARGET), words = buttons;
    if (row.w > 640)
        words = (struct ui_box){row.x + 420, row.y + 18, row.w - 420, row.h};
    const int done = controls_draw(b, choices, 3, (struct ui_box){row.x, row.y, fmin(row.w, 400), row.h});
    if (done >= 0)
        studio_do(s, (enum studio_action)done, now_ns);
    paragraph(b, FACE_SMALL, words, b->theme->quiet, "Leaving again keeps it");
}

static void draw_review(const struct brush *b, struct studio_state *s, const struct studio_view *v, struct ui_box in,
                        int64_t now_ns)
{
    const bool keep = v->shown->judgement.verdict.seen; // the bright one
    const struct control choices[] = {{"Keep", "Keep", keep ? BUTTON_MAIN : BUTTON_RAISED, STUDIO_KEEP},
                                      {"Play", "Play", BUTTON_RAISED, STUDIO_PLAY},
                                      {"Once more", "Once more", keep ? BUTTON_RAISED : BUTTON_MAIN, STUDIO_RETAKE},
                                      {"Discard", "Discard", BUTTON_RAISED, STUDIO_DISCARD},
                                      {"Rename", "Rename", BUTTON_RAISED, STUDIO_EDIT_NAME}};
    const int choice_count = (int)COUNT_OF(choices);
    const bool upright = in.h > in.w, renames = s->page == STUDIO_RENAME;
    const double choices_h = controls_height(b, choices, choice_count, in.w);
    char text[120];
    struct ui_box name = cut_top(&in, 52),
                  buttons = cut_bottom(&in, (renames || s->page == STUDIO_LEAVING) && in.w <= 640
                                                ? fmax(choices_h, TARGET + 48)
                                                : choices_h);
    draw_name(b, s, (struct ui_box){name.x, name.y, fmin(name.w, 520), name.h});
    struct ui_box figure = upright ? cut_bottom(&in, fmin(in.h * 0.45, 380)) : cut_right(&in, in.w * 0.45);
    studio_verdict_draw(b, &v->shown->judgement.verdict, v->shown->failure, v->scroll, in);
    panel(b, figure, false);
    figure = inner(figure, 14);
    snprintf(text, sizeof text, "%lld pictures", (long long)v->shown->judgement.frames);
    label(b, FACE_SMALL, cut_bottom(&figure, 24), b->theme->quiet, text);
    draw_seen(b, coverage_share(&v->shown->judgement.seen), ADVICE_ENOUGH, &v->shown->judgement.seen, figure);
    if (renames) {
        draw_rename_buttons(b, s, buttons, now_ns);
        return;
    }
    if (s->page == STUDIO_LEAVING) {
        draw_leaving_buttons(b, s, buttons, now_ns);
        return;
    }
    const int done = controls_draw(b, choices, choice_count, buttons);
    if (done >= 0)
        studio_do(s, (enum studio_action)done, now_ns);
}

static void draw_trouble(const struct brush *b, struct studio_state *s, struct ui_box in, int64_t now_ns)
{
    const struct ui_box button = cut_bottom(&in, TARGET), later = cut_bottom(&in, 24);
    icon_draw(b->ui, ICON_WARNING, (struct ui_point){in.x + 24, in.y + 24}, 40, b->theme->warn);
    struct ui_box words = in;
    cut_top(&words, 50);
    paragraph(b, FACE_BODY, words, b->theme->text, s->trouble);
    label(b, FACE_SMALL, later, b->theme->quiet, "It is used again when it is back");
    if (text_button(b, "studio-retry", "Choose a sensor", BUTTON_MAIN,
                    (struct ui_box){button.x, button.y, fmin(280, button.w), button.h}))
        studio_do(s, STUDIO_SENSORS_AGAIN, now_ns);
}

static const char *title(const struct studio_state *s)
{
    switch (s->page) {
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
static void draw_undo(const struct brush *b, struct studio_state *s, struct ui_box *head, char text[300],
                      int64_t now_ns)
{
    char button[24];
    const struct studio_erasure *e = &s->waiting;
    const double length_s = (double)(e->to_ns - e->from_ns) * 1e-9;
    snprintf(button, sizeof button, "Undo %d", studio_undo_left_s(s, now_ns));
    if (e->kind == ERASES_TAKE)
        snprintf(text, 300, "%.60s is discarded", e->take);
    else
        snprintf(text, 300, "%.60s is cut to %.1f s", e->take, length_s);
    if (text_button(b, "studio-undo", button, BUTTON_MAIN, cut_right(head, 110)))
        studio_do(s, STUDIO_UNDO, now_ns);
    if (ui_text_width(b->ui, FACE_SMALL, text) <= head->w)
        return;
    if (e->kind == ERASES_TAKE)
        snprintf(text, 300, "discarded");
    else
        snprintf(text, 300, "cut to %.1f s", length_s);
}

void studio_screen_draw(const struct brush *b, struct studio_state *s, const struct studio_view *v, int64_t now_ns)
{
    char text[300];
    struct ui_box all = {0, 0, ui_width(b->ui), ui_height(b->ui)}, in = inner(all, 20);
    ui_fill(b->ui, all, 0, b->theme->ground);
    struct ui_box head = cut_top(&in, TARGET);
    if (icon_button(b, "studio-close", (struct icon_words){ICON_CLOSE, "Close"}, BUTTON_RAISED,
                    cut_right(&head, TARGET)))
        studio_do(s, STUDIO_QUIT, now_ns);
    if (icon_button(b, "studio-theme", theme_words(s->dark), BUTTON_RAISED, cut_right(&head, TARGET)))
        studio_do(s, STUDIO_THEME, now_ns);
    const bool waits = s->waiting.kind != ERASES_NOTHING;
    if (waits)
        draw_undo(b, s, &head, text, now_ns);
    label(b, FACE_HEAD, (struct ui_box){head.x, head.y, head.w, 30}, b->theme->text, title(s));
    if (!waits && *s->notice)
        snprintf(text, sizeof text, "%s", s->notice);
    else if (!waits && s->kept < 2)
        snprintf(text, sizeof text, "%.250s · %s", v->file, s->kept ? "one take kept" : "no take kept yet");
    else if (!waits)
        snprintf(text, sizeof text, "%.250s · %d takes kept", v->file, s->kept);
    label(b, FACE_SMALL, (struct ui_box){head.x, head.y + 32, head.w, 24},
          waits || *s->notice ? b->theme->accent : b->theme->quiet, text);
    switch (s->page) {
    case STUDIO_SENSORS: draw_sensors(b, s, v, in, now_ns); break;
    case STUDIO_REVIEW:
    case STUDIO_RENAME:
    case STUDIO_LEAVING:
    case STUDIO_PLAYBACK: draw_review(b, s, v, in, now_ns); break;
    case STUDIO_ROOM:
    case STUDIO_ROOM_FINISHING:
    case STUDIO_ROOM_REVIEW: room_screen_draw(b, s, v, in, now_ns); break;
    case STUDIO_TROUBLE: draw_trouble(b, s, in, now_ns); break;
    default: draw_live(b, s, v, in, now_ns); break;
    }
}
