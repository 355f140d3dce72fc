// The page for doing the move beside the actor: mirror, beside, room; controls and legend.
#include "app/ui/screen_live.h"

#include "compare/findings.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static const double LEGEND_MIN = 420, LEGEND_W = 236, COUNT_DP = 92;
static const double DEGREE = 180 / 3.14159265358979323846;

// ---------------------------------------------------------------- pictures

// The whole image inside the box.
static struct cover contain_image(const struct lens *lens, struct ui_box box)
{
    const double scale = fmin(box.w / lens->width, box.h / lens->height);
    return (struct cover){scale, box.x + (box.w - scale * lens->width) / 2, box.y + (box.h - scale * lens->height) / 2};
}

static void draw_mirror(const struct brush *brush, const struct view_state *state, const struct live_page *page,
                        struct ui_box all)
{
    const struct take_view_image *image = page->image;
    const struct ui_uv_rect upright = {0, 0, 1, 1}, over = {1, 0, 0, 1};
    ui_fill(brush->ui, all, 0, brush->theme->ground);
    if (!(image->lens.width > 0))
        return;
    const struct cover cover = contain_image(&image->lens, layout_live_free(all.w, all.h));
    const struct ui_box box = {cover.x, cover.y, cover.scale * image->lens.width, cover.scale * image->lens.height};
    const struct figure_view view = {image->lens, image->world_from_camera, cover, true};
    const struct figure person = {FIGURE_LIMBS, page->person, page->verdicts, false, 0},
                        ghost = {FIGURE_GHOST, page->ghost, NULL, false, 0};
    if (page->picture)
        ui_image(brush->ui, page->picture, box, over, ROUND, 0xffffffff);
    ui_clip(brush->ui, box);
    const uint32_t tint = faint(0xffffffff, state->live.over ? 0.55 : 1); // over the person, both must be seen
    if (image->shadow)
        ui_image(brush->ui, image->shadow, box, image->flip_x ? upright : over, 0, tint);
    if (image->actor)
        ui_image(brush->ui, image->actor, box, image->flip_x ? upright : over, 0, tint);
    if (page->front && image->actor)
        ui_image(brush->ui, page->front, box, over, 0, 0xffffffff);
    if (page->ghost)
        figure_draw(brush, &view, &ghost);
    if (page->person)
        figure_draw(brush, &view, &person);
    ui_unclip(brush->ui);
}

// The actor in the studio or in the camera's image, and the person.
static void draw_scene(const struct brush *brush, const struct view_state *state, const struct live_page *page,
                       struct ui_box all, bool room)
{
    const struct take_view_image *image = page->image;
    const struct figure_view view = {image->lens, image->world_from_camera, cover_of(&image->lens, all), false};
    const struct figure body = {FIGURE_BODY, page->person, NULL, false, 0},
                        limbs = {FIGURE_LIMBS, page->person, page->verdicts, false, 0},
                        ghost = {FIGURE_GHOST, page->ghost, NULL, false, 0};
    compositor_draw(brush, all, image, state);
    if (room) // the person is in image->overlay, hidden by what stands before it
        return;
    ui_clip(brush->ui, all);
    if (page->person)
        figure_draw(brush, &view, &body);
    if (page->ghost)
        figure_draw(brush, &view, &ghost);
    if (page->person && page->verdicts) // the verdicts' colours stay as they are
        figure_draw(brush, &view, &limbs);
    ui_unclip(brush->ui);
}

// ---------------------------------------------------------------- what is said

static void draw_count(const struct brush *brush, const struct live_state *state, struct ui_box free)
{
    char text[8];
    const int count = live_state_count(state);
    if (!count)
        return;
    snprintf(text, sizeof text, "%d", count);
    const struct ui_point m = middle(free);
    const double radius = fmin(COUNT_DP, free.h / 2), line = 1.2 * radius;
    ui_disc(brush->ui, m, radius, brush->theme->glass);
    ui_ring(brush->ui, m, radius, 6, brush->theme->accent);
    const struct ui_point size = ui_text_extent(brush->ui, FACE_COUNT_IN, line, text, 2 * radius);
    ui_text_sized(brush->ui, FACE_COUNT_IN, line,
                  (struct ui_box){m.x - size.x / 2, m.y - size.y / 2, size.x + 1, size.y}, brush->theme->text, text);
}

// said: what the legend stands above where it would be covered.
static void draw_legend(const struct brush *brush, struct ui_box under, struct ui_box said)
{
    static const struct {
        enum verdict verdict;
        const char *text;
    } rows[] = {{VERDICT_SAME, "as the actor"}, {VERDICT_DIFFERENT, "different"}, {VERDICT_UNKNOWN, "cannot tell"}};
    const double h = 3 * 30 + 24, bottom = said.w > 0 && said.x < under.x + LEGEND_W + GAP
                                               ? fmin(said.y, under.y + under.h)
                                               : under.y + under.h;
    const struct ui_box box = {under.x, bottom - GAP - h, LEGEND_W, h};
    ui_fill(brush->ui, box, ROUND, brush->theme->glass);
    for (int i = 0; i < 3; i++) {
        const double y = box.y + 12 + 30 * i + 15;
        verdict_line(brush, (struct ui_point){box.x + 20, y}, (struct ui_point){box.x + 62, y}, 9, rows[i].verdict);
        label(brush, FACE_SMALL, (struct ui_box){box.x + 80, y - 15, box.w - 90, 30}, brush->theme->text, rows[i].text);
    }
}

// ---------------------------------------------------------------- the cue

// One cue at a time, for who stands three metres away: as large as the screen allows, up to capitals of 9 mm, which are
// 10 minutes of arc there; half of normal sight (20/40) reads these. A sign and words say it, the colour only as well.
static const double CUE_LINE = 94, CUE_MIN = 40, CUE_SIGN = 1.1; // dp, of a line; the sign's width, in lines
static const int64_t CUE_NS = 1500000000;                        // how long a cue stays, so that it can be read

// Which part is spoken of: 1 more than its number, 0: all is right.
static int cue_part(const struct live_page *page)
{
    int worst = 0;
    for (int p = 0; p < PART_COUNT; p++)
        if (page->verdicts[p] == VERDICT_DIFFERENT &&
            (!worst || page->parts[p].angle_rad > page->parts[worst - 1].angle_rad))
            worst = p + 1;
    return worst;
}

static void choose_cue(struct screens *screens, const struct live_page *page, int64_t now_ns)
{
    const int part = cue_part(page), old = screens->cue;
    const bool settled = old > 0 && page->verdicts[old - 1] != VERDICT_DIFFERENT && part == 0;
    if (part == old || (!settled && screens->cue_ns && now_ns - screens->cue_ns < CUE_NS))
        return;
    screens->cue = part;
    screens->cue_ns = now_ns;
}

static void cue_text(const struct screens *screens, const struct live_page *page, char *text, size_t capacity)
{
    const int part = screens->cue - 1;
    if (part < 0) {
        snprintf(text, capacity, "Like the actor");
        return;
    }
    snprintf(text, capacity, "%s %.0f°", part_name((enum part)part), page->parts[part].angle_rad * DEGREE);
    for (char *c = text; *c; c++)
        *c = *c == '_' ? ' ' : *c;
    if (text[0] >= 'a' && text[0] <= 'z')
        text[0] = (char)(text[0] - 'a' + 'A');
}

// The largest line that lets the text stand in the box, in two lines at most.
static double cue_line(const struct brush *brush, const char *text, struct ui_box box)
{
    double line = CUE_LINE;
    for (; line > CUE_MIN; line -= 2) {
        const struct ui_point size = ui_text_extent(brush->ui, FACE_CUE, line, text, box.w - (CUE_SIGN + 0.5) * line);
        if (size.x <= box.w - (CUE_SIGN + 0.5) * line && size.y < 2.5 * line && size.y <= box.h)
            break;
    }
    return line;
}

// said: where both have no room there is no cue.
static void draw_cue(const struct brush *brush, struct screens *screens, const struct live_page *page,
                     struct ui_box free, struct ui_box said, int64_t now_ns)
{
    char text[60];
    if (!page->verdicts || !page->parts) {
        screens->cue_ns = 0;
        return;
    }
    choose_cue(screens, page, now_ns);
    cue_text(screens, page, text, sizeof text);
    const bool right = screens->cue == 0;
    const uint32_t color = right ? brush->theme->right : brush->theme->wrong;
    const double line = cue_line(brush, text, (struct ui_box){0, 0, free.w, 0.5 * free.h});
    const struct ui_point size = ui_text_extent(brush->ui, FACE_CUE, line, text, free.w - (CUE_SIGN + 0.5) * line);
    const double w = size.x + (CUE_SIGN + 0.5) * line;
    const struct ui_box box = {free.x + (free.w - w) / 2, free.y, w, size.y};
    if (said.w > 0 && said.y < box.y + box.h)
        return;
    ui_fill(brush->ui, box, ROUND, brush->theme->surface);
    ui_border(brush->ui, box, ROUND, right ? 2 : 6, color);
    icon_draw(brush->ui, right ? ICON_CHECK : ICON_WARNING, (struct ui_point){box.x + 0.75 * line, box.y + box.h / 2},
              0.8 * line, color);
    ui_text_sized(brush->ui, FACE_CUE, line,
                  (struct ui_box){box.x + (CUE_SIGN + 0.2) * line, box.y, size.x + 1, size.y}, brush->theme->text,
                  text);
}

// ---------------------------------------------------------------- controls

// Where the actor is in the take, the person, and the marked part.
static void time_line(const struct brush *brush, const struct live_state *state, const struct live_page *page,
                      struct ui_box row)
{
    const struct theme *t = brush->theme;
    const double length = (double)(state->length_ns > 0 ? state->length_ns : 1), y = row.y + row.h / 2;
    const double width = label_time_width(brush, state->length_ns);
    struct ui_box before = cut_left(&row, width + 8), behind = cut_right(&row, width);
    row.w -= 8;
    label_time(brush, (struct ui_point){before.x, y - 9}, t->text, state->at_ns);
    label_time(brush, (struct ui_point){behind.x, y - 9}, t->quiet, state->length_ns);
    const double from = row.x + row.w * (double)state->marked_from_ns / length,
                 to = row.x + row.w * (double)state->marked_to_ns / length,
                 at = row.x + row.w * (double)state->at_ns / length;
    ui_fill(brush->ui, (struct ui_box){row.x, y - 3, row.w, 6}, 3, faint(t->text, 0.14));
    ui_fill(brush->ui, (struct ui_box){from, y - 5, fmax(6, to - from), 10}, 5, faint(t->accent, 0.35));
    ui_fill(brush->ui, (struct ui_box){from, y - 5, fmax(0, at - from), 10}, 5, t->accent);
    ui_disc(brush->ui, (struct ui_point){at, y}, 11, t->accent);
    if (page->person_ns >= 0 && page->verdicts) {
        const double person = row.x + row.w * fmin(1, (double)page->person_ns / length);
        ui_disc(brush->ui, (struct ui_point){person, y}, 8, t->text);
        ui_disc(brush->ui, (struct ui_point){person, y}, 5, t->surface);
    }
}

static const char *start_text(const struct live_state *state)
{
    if (state->phase == LIVE_READY)
        return "Start";
    return state->phase == LIVE_DOING ? "Stop" : "Wait";
}

// What every screen has room for, and all else where there is.
static void draw_controls(const struct brush *brush, struct view_state *state, const struct live_page *page,
                          struct ui_box box, int64_t now_ns)
{
    const struct live_state *l = &state->live;
    char tempo[16];
    snprintf(tempo, sizeof tempo, "%g×", l->tempo);
    struct control marks[2];
    const int mark_count = live_mark_controls(l, marks);
    const enum button_kind sheet = state->sheet == SHEET_LIVE ? BUTTON_ON : BUTTON_RAISED;
    const struct control always[] = {
        {"live-start", start_text(l), BUTTON_MAIN, DO_PLAY_PAUSE},
        {"live-slower", "−", BUTTON_RAISED, DO_SLOWER},
        {"live-tempo", tempo, BUTTON_PLAIN, DO_NOTHING},
        {"live-faster", "+", BUTTON_RAISED, DO_FASTER},
        {"live-sheet", "Options", sheet, DO_LAYERS},
    };
    const struct control in_sheet[] = {
        // what the sheet has, too
        {"live-row-loop", "Repeat", l->loop ? BUTTON_ON : BUTTON_RAISED, DO_LOOP},
        {"live-row-pace", l->pace == LIVE_FOLLOW ? "Actor waits" : "Actor goes on", BUTTON_RAISED, DO_PACE},
        {"live-row-mirrored", "Mirrored", l->mirrored ? BUTTON_ON : BUTTON_RAISED, DO_MIRROR},
    };
    enum { ALWAYS = COUNT_OF(always) };
    struct control shown[ALWAYS + COUNT_OF(marks) + COUNT_OF(in_sheet)];
    const double width = ui_width(brush->ui), height = ui_height(brush->ui);
    const enum live_marks place = layout_live_marks(width, height);
    struct ui_box in = inner(box, 12);
    int count = 0;
    panel(brush, box, true);
    time_line(brush, l, page, cut_top(&in, LIVE_ROW));
    for (int i = 0; i < ALWAYS - 1; i++)
        shown[count++] = always[i];
    for (int i = 0; i < mark_count && place == MARKS_AMONG_BUTTONS; i++)
        shown[count++] = marks[i];
    shown[count++] = always[ALWAYS - 1];
    for (int i = 0; i < (int)COUNT_OF(in_sheet) && layout_live_one_row(width, height); i++)
        shown[count++] = in_sheet[i];
    const int mark = place == MARKS_IN_A_ROW ? controls_draw(brush, marks, mark_count, cut_bottom(&in, LIVE_ROW)) : -1,
              done = controls_draw(brush, shown, count, in);
    if (done > DO_NOTHING || mark >= 0)
        view_state_do(state, (enum view_action)(mark >= 0 ? mark : done), now_ns);
    (void)ui_area(brush->ui, "live-panel", box);
}

static const double ROOM_FOR_THEME = 420, MIN_NAME = 110; // dp

static void top_row(const struct brush *brush, struct view_state *state, const struct live_page *page,
                    struct ui_box row, int64_t now_ns)
{
    static const char *const names[LIVE_SCREENS] = {"Mirror", "Beside", "Room"};
    const struct theme *t = brush->theme;
    const bool back = state->take_count > 1 || state->live.phase != LIVE_READY;
    if (icon_button(brush, "live-back", (struct icon_words){back ? ICON_BACK : ICON_CLOSE, back ? "Back" : "Close"},
                    BUTTON_GLASS, cut_left(&row, TARGET)))
        view_state_do(state, DO_BACK, now_ns);
    if (row.w > ROOM_FOR_THEME &&
        icon_button(brush, "live-theme", theme_words(state->dark), BUTTON_GLASS, cut_right(&row, TARGET)))
        view_state_do(state, DO_THEME, now_ns);
    for (int i = state->live.has_camera ? LIVE_ROOM : LIVE_BESIDE; i >= 0; i--) {
        char name[24];
        snprintf(name, sizeof name, "live-screen-%d", i);
        const bool on = (int)state->live.screen == i;
        const double w = fmin(104, (row.w - 2 * GAP) / (i + 1));
        if (text_button(brush, name, names[i], on ? BUTTON_MAIN : BUTTON_GLASS, cut_right(&row, w)) && !on) {
            state->live.screen = (enum live_screen)i;
            view_state_on_input(state, now_ns);
        }
    }
    if (row.w < MIN_NAME)
        return;
    const double width =
        fmax(ui_text_width(brush->ui, FACE_STRONG, page->take), ui_text_width(brush->ui, FACE_SMALL, page->file));
    const struct ui_box name = {row.x, row.y, fmin(width + 44, row.w), row.h};
    ui_fill(brush->ui, name, TARGET / 2, t->glass);
    label(brush, FACE_STRONG, (struct ui_box){name.x + 22, name.y + 8, name.w - 40, 22}, t->text, page->take);
    label(brush, FACE_SMALL, (struct ui_box){name.x + 22, name.y + 31, name.w - 40, 20}, t->quiet, page->file);
}

void screen_live(const struct brush *brush, struct screens *screens, struct view_state *state,
                 const struct live_page *page, int64_t now_ns)
{
    const struct ui_box all = {0, 0, ui_width(brush->ui), ui_height(brush->ui)}, free = layout_live_free(all.w, all.h);
    if (state->live.screen == LIVE_MIRROR)
        draw_mirror(brush, state, page, all);
    else
        draw_scene(brush, state, page, all, state->live.screen == LIVE_ROOM);
    const struct ui_box panel_at = layout_live_panel(all.w, all.h);
    if (state->sheet == SHEET_LIVE) { // over all others: touched first
        ui_layer(brush->ui, 2);
        panels_draw(brush, screens, state, layout_live_sheet(all.w, all.h), now_ns);
        ui_layer(brush->ui, 0);
        screens->image_held = ui_area(brush->ui, "image", all).held;
        return;
    }
    ui_layer(brush->ui, 1);
    const double under_top = MARGIN + TARGET + GAP;
    const struct ui_box under = {free.x, under_top, free.w, panel_at.y - GAP - under_top};
    const bool legend = under.h > LEGEND_MIN && under.w > LEGEND_MIN;
    const struct ui_box said = screen_message_box(brush, state);
    draw_cue(brush, screens, page, under, said, now_ns);
    if (legend)
        draw_legend(brush, under, said);
    draw_count(brush, &state->live, under);
    top_row(brush, state, page, (struct ui_box){MARGIN, MARGIN, all.w - 2 * MARGIN, TARGET}, now_ns);
    draw_controls(brush, state, page, panel_at, now_ns);
    ui_layer(brush->ui, 0);
    screens->image_held = ui_area(brush->ui, "image", all).held;
}
