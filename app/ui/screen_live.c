// The page for doing the move beside the actor: mirror, beside, room; controls and legend.
#include "app/ui/screen_live.h"

#include "compare/findings.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static const double PANEL_W = 1180, ROWS_W = 1100, ROW = 58, LEGEND_W = 236, COUNT_DP = 92;
static const double DEGREE = 180 / 3.14159265358979323846;

static bool is_wide(double width, double height) { return width >= height; }

// Both rows of buttons beside each other.
static bool is_one_row(double width, double height) { return is_wide(width, height) && width >= ROWS_W + 2 * MARGIN; }

static struct ui_box panel_box(double width, double height)
{
    const double w = fmin(width - 2 * MARGIN, PANEL_W), h = (is_one_row(width, height) ? 2 : 3) * (ROW + GAP) + 32;
    return (struct ui_box){(width - w) / 2, height - MARGIN - h, w, h};
}

struct ui_box screen_live_free(double width, double height)
{
    // On a wide screen the top row's buttons are in the corners, beside what is shown.
    const double top = is_wide(width, height) ? MARGIN : MARGIN + TARGET + GAP,
                 bottom = panel_box(width, height).y - GAP;
    return (struct ui_box){MARGIN, top, width - 2 * MARGIN, fmax(bottom - top, 60)};
}

// ---------------------------------------------------------------- pictures

// The whole image inside the box.
static struct cover contain(const struct lens *lens, struct ui_box box)
{
    const double scale = fmin(box.w / lens->width, box.h / lens->height);
    return (struct cover){scale, box.x + (box.w - scale * lens->width) / 2, box.y + (box.h - scale * lens->height) / 2};
}

static void draw_mirror(const struct brush *b, const struct view_state *s, const struct live_page *page,
                        struct ui_box all)
{
    const struct take_view_image *p = page->image;
    const struct ui_uv_rect upright = {0, 0, 1, 1}, over = {1, 0, 0, 1};
    ui_fill(b->ui, all, 0, b->theme->ground);
    if (!(p->lens.width > 0))
        return;
    const struct cover cover = contain(&p->lens, screen_live_free(all.w, all.h));
    const struct ui_box box = {cover.x, cover.y, cover.scale * p->lens.width, cover.scale * p->lens.height};
    const struct figure_view view = {p->lens, p->world_from_camera, cover, true};
    const struct figure person = {FIGURE_LIMBS, page->person, page->verdicts, false},
                        ghost = {FIGURE_GHOST, page->ghost, NULL, false};
    if (page->picture)
        ui_image(b->ui, page->picture, box, over, ROUND, 0xffffffff);
    ui_clip(b->ui, box);
    const uint32_t tint = faint(0xffffffff, s->live.over ? 0.55 : 1); // over the person, both must be seen
    if (p->shadow)
        ui_image(b->ui, p->shadow, box, p->flip_x ? upright : over, 0, tint);
    if (p->actor)
        ui_image(b->ui, p->actor, box, p->flip_x ? upright : over, 0, tint);
    if (page->front && p->actor)
        ui_image(b->ui, page->front, box, over, 0, 0xffffffff);
    if (page->ghost)
        figure_draw(b, &view, &ghost);
    if (page->person)
        figure_draw(b, &view, &person);
    ui_unclip(b->ui);
}

// The actor in the studio or in the camera's image, and the person.
static void draw_scene(const struct brush *b, const struct view_state *s, const struct live_page *page,
                       struct ui_box all, bool room)
{
    const struct take_view_image *p = page->image;
    const struct figure_view view = {p->lens, p->world_from_camera, cover_of(&p->lens, all), false};
    const struct figure body = {FIGURE_BODY, page->person, NULL, false},
                        limbs = {FIGURE_LIMBS, page->person, page->verdicts, false},
                        ghost = {FIGURE_GHOST, page->ghost, NULL, false};
    compositor_draw(b, all, p, s);
    if (room) // the person is in p->overlay, hidden by what stands before it
        return;
    ui_clip(b->ui, all);
    if (page->person)
        figure_draw(b, &view, &body);
    if (page->ghost)
        figure_draw(b, &view, &ghost);
    if (page->person && page->verdicts) // the verdicts' colours stay as they are
        figure_draw(b, &view, &limbs);
    ui_unclip(b->ui);
}

// ---------------------------------------------------------------- what is said

static void draw_count(const struct brush *b, const struct live_state *l, struct ui_box free)
{
    char text[8];
    const int count = live_state_count(l);
    if (!count)
        return;
    snprintf(text, sizeof text, "%d", count);
    const struct ui_point m = middle(free);
    ui_disc(b->ui, m, COUNT_DP, b->theme->glass);
    ui_ring(b->ui, m, COUNT_DP, 6, b->theme->accent);
    label_centred(b, FACE_COUNT_IN, (struct ui_box){m.x - COUNT_DP, m.y - COUNT_DP, 2 * COUNT_DP, 2 * COUNT_DP},
                  b->theme->text, text);
}

// The part that differs most, and by how much.
static void worst_part(const struct live_page *page, char *text, size_t capacity)
{
    int worst = -1;
    for (int p = 0; page->verdicts && p < PART_COUNT; p++)
        if (page->verdicts[p] == VERDICT_DIFFERENT &&
            (worst < 0 || page->parts[p].angle_rad > page->parts[worst].angle_rad))
            worst = p;
    text[0] = 0;
    if (worst < 0)
        return;
    snprintf(text, capacity, "%s %.0f°", part_name((enum part)worst), page->parts[worst].angle_rad * DEGREE);
    for (char *c = text; *c; c++)
        *c = *c == '_' ? ' ' : *c;
    if (text[0] >= 'a' && text[0] <= 'z')
        text[0] = (char)(text[0] - 'a' + 'A');
}

static void draw_legend(const struct brush *b, const struct live_page *page, struct ui_box free)
{
    static const struct {
        enum verdict verdict;
        const char *text;
    } rows[] = {{VERDICT_SAME, "as the actor"}, {VERDICT_DIFFERENT, "different"}, {VERDICT_UNKNOWN, "cannot tell"}};
    char worst[60];
    worst_part(page, worst, sizeof worst);
    struct ui_box box = {free.x, free.y + GAP, LEGEND_W, 3 * 30 + 24};
    ui_fill(b->ui, box, ROUND, b->theme->glass);
    for (int i = 0; i < 3; i++) {
        const double y = box.y + 12 + 30 * i + 15;
        verdict_line(b, (struct ui_point){box.x + 20, y}, (struct ui_point){box.x + 62, y}, 9, rows[i].verdict);
        label(b, FACE_SMALL, (struct ui_box){box.x + 80, y - 15, box.w - 90, 30}, b->theme->text, rows[i].text);
    }
    if (!*worst)
        return;
    struct ui_box chip = {free.x, box.y + box.h + GAP, LEGEND_W, 44};
    ui_fill(b->ui, chip, 22, b->theme->glass);
    ui_ring(b->ui, (struct ui_point){chip.x + 22, chip.y + 22}, 7, 4, b->theme->wrong);
    label(b, FACE_STRONG, (struct ui_box){chip.x + 42, chip.y, chip.w - 50, 44}, b->theme->text, worst);
}

// ---------------------------------------------------------------- controls

// Where the actor is in the take, the person, and the marked part.
static void time_line(const struct brush *b, const struct live_state *l, const struct live_page *page,
                      struct ui_box row)
{
    const struct theme *t = b->theme;
    const double length = (double)(l->length_ns > 0 ? l->length_ns : 1), y = row.y + row.h / 2;
    const double width = label_time_width(b, l->length_ns);
    struct ui_box before = cut_left(&row, width + 8), behind = cut_right(&row, width);
    row.w -= 8;
    label_time(b, (struct ui_point){before.x, y - 9}, t->text, l->at_ns);
    label_time(b, (struct ui_point){behind.x, y - 9}, t->quiet, l->length_ns);
    const double from = row.x + row.w * (double)l->marked_from_ns / length,
                 to = row.x + row.w * (double)l->marked_to_ns / length, at = row.x + row.w * (double)l->at_ns / length;
    ui_fill(b->ui, (struct ui_box){row.x, y - 3, row.w, 6}, 3, faint(t->text, 0.14));
    ui_fill(b->ui, (struct ui_box){from, y - 5, fmax(6, to - from), 10}, 5, faint(t->accent, 0.35));
    ui_fill(b->ui, (struct ui_box){from, y - 5, fmax(0, at - from), 10}, 5, t->accent);
    ui_disc(b->ui, (struct ui_point){at, y}, 11, t->accent);
    if (page->person_ns >= 0 && page->verdicts) {
        const double person = row.x + row.w * fmin(1, (double)page->person_ns / length);
        ui_disc(b->ui, (struct ui_point){person, y}, 8, t->text);
        ui_disc(b->ui, (struct ui_point){person, y}, 5, t->surface);
    }
}

struct control {
    const char *name, *text;
    enum button_kind kind;
    enum view_action action;
    double width; // share of the row
};

static void control_row(const struct brush *b, struct view_state *s, const struct control *controls, int count,
                        struct ui_box row, int64_t now_ns)
{
    double sum = 0;
    for (int i = 0; i < count; i++)
        sum += controls[i].width;
    const double unit = (row.w - (count - 1) * GAP) / sum;
    for (int i = 0; i < count; i++) {
        const struct control *c = &controls[i];
        if (text_button(b, c->name, c->text, c->kind, cut_left(&row, unit * c->width)))
            view_state_do(s, c->action, now_ns);
    }
}

static void controls(const struct brush *b, struct view_state *s, const struct live_page *page, struct ui_box box,
                     int64_t now_ns)
{
    struct live_state *l = &s->live;
    char tempo[16];
    snprintf(tempo, sizeof tempo, "%g×", l->tempo);
    const bool marked = l->marked_from_ns > 0 || l->marked_to_ns < l->length_ns;
    const struct control first[] = {
        {"live-start",
         l->phase == LIVE_READY   ? "Start"
         : l->phase == LIVE_DOING ? "Stop"
                                  : "Wait",
         BUTTON_MAIN, DO_PLAY_PAUSE, 1.5},
        {"live-pace", l->pace == LIVE_FOLLOW ? "Follow me" : "Keep up", BUTTON_RAISED, DO_PACE, 1.6},
        {"live-slower", "−", BUTTON_RAISED, DO_SLOWER, 0.6},
        {"live-tempo", tempo, BUTTON_PLAIN, DO_NOTHING, 0.8},
        {"live-faster", "+", BUTTON_RAISED, DO_FASTER, 0.6},
        {"live-hands-free", "By itself", l->hands_free ? BUTTON_ON : BUTTON_RAISED, DO_HANDS_FREE, 1.2},
    };
    const struct control second[] = {
        {"live-mark-from", l->phase == LIVE_DOING || !marked ? "From here" : "All of it", BUTTON_RAISED, DO_MARK_FROM,
         1.3},
        {"live-mark-to", "To here", BUTTON_RAISED, DO_MARK_TO, 1.1},
        {"live-loop", "Loop", l->loop ? BUTTON_ON : BUTTON_RAISED, DO_LOOP, 0.9},
        {"live-ghost", "Next pose", l->ghost ? BUTTON_ON : BUTTON_RAISED, DO_GHOST, 1.3},
        {"live-mirrored", "Mirrored", l->mirrored ? BUTTON_ON : BUTTON_RAISED, DO_MIRROR, 1.3},
        {"live-over", l->over ? "Over me" : "Beside me", BUTTON_RAISED, DO_OVER, 1.3},
    };
    struct ui_box in = inner(box, 16);
    const bool one_row = is_one_row(ui_width(b->ui), ui_height(b->ui));
    panel(b, box, true);
    struct ui_box line = cut_top(&in, ROW);
    const int rest = l->screen == LIVE_MIRROR ? 6 : 5;
    if (one_row) {
        control_row(b, s, first, 6, (struct ui_box){in.x, in.y, in.w * 0.5 - GAP, ROW}, now_ns);
        control_row(b, s, second, rest, (struct ui_box){in.x + in.w * 0.5, in.y, in.w * 0.5, ROW}, now_ns);
    } else {
        control_row(b, s, first, 6, cut_top(&in, ROW), now_ns);
        control_row(b, s, second, rest, cut_top(&in, ROW), now_ns);
    }
    time_line(b, l, page, line);
    (void)ui_area(b->ui, "live-panel", box);
}

static void top_row(const struct brush *b, struct view_state *s, const struct live_page *page, struct ui_box row,
                    int64_t now_ns)
{
    static const char *const names[LIVE_SCREENS] = {"Mirror", "Beside", "Room"};
    const struct theme *t = b->theme;
    if (icon_button(b, "live-back", s->take_count > 1 || s->live.phase != LIVE_READY ? ICON_BACK : ICON_CLOSE,
                    BUTTON_GLASS, cut_left(&row, TARGET)))
        view_state_do(s, DO_BACK, now_ns);
    if (icon_button(b, "live-theme", s->dark ? ICON_SUN : ICON_MOON, BUTTON_GLASS, cut_right(&row, TARGET)))
        view_state_do(s, DO_THEME, now_ns);
    for (int i = s->live.has_camera ? LIVE_ROOM : LIVE_BESIDE; i >= 0; i--) {
        char name[24];
        snprintf(name, sizeof name, "live-screen-%d", i);
        const bool on = (int)s->live.screen == i;
        if (text_button(b, name, names[i], on ? BUTTON_MAIN : BUTTON_GLASS, cut_right(&row, 104)) && !on) {
            s->live.screen = (enum live_screen)i;
            view_state_on_input(s, now_ns);
        }
    }
    const double width =
        fmax(ui_text_width(b->ui, FACE_STRONG, page->take), ui_text_width(b->ui, FACE_SMALL, page->file));
    const struct ui_box name = {row.x, row.y, fmin(width + 44, row.w), row.h};
    ui_fill(b->ui, name, TARGET / 2, t->glass);
    label(b, FACE_STRONG, (struct ui_box){name.x + 22, name.y + 8, name.w - 40, 22}, t->text, page->take);
    label(b, FACE_SMALL, (struct ui_box){name.x + 22, name.y + 31, name.w - 40, 20}, t->quiet, page->file);
}

void screen_live(const struct brush *b, struct screens *screens, struct view_state *s, const struct live_page *page,
                 int64_t now_ns)
{
    const struct ui_box all = {0, 0, ui_width(b->ui), ui_height(b->ui)}, free = screen_live_free(all.w, all.h);
    if (s->live.screen == LIVE_MIRROR)
        draw_mirror(b, s, page, all);
    else
        draw_scene(b, s, page, all, s->live.screen == LIVE_ROOM);
    ui_layer(b->ui, 1);
    const struct ui_box under = {free.x, MARGIN + TARGET + GAP, free.w, free.h};
    draw_legend(b, page, under);
    draw_count(b, &s->live, free);
    top_row(b, s, page, (struct ui_box){MARGIN, MARGIN, all.w - 2 * MARGIN, TARGET}, now_ns);
    controls(b, s, page, panel_box(all.w, all.h), now_ns);
    ui_layer(b->ui, 0);
    screens->image_held = ui_area(b->ui, "image", all).held;
}
