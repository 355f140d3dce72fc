// Labels at the things, the arrow that leads to one, the sheets about them, and the map beside the picture.
#include "app/ui/room_page.h"

#include "app/state/view_state.h"
#include "base/text.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

// ---------------------------------------------------------------- label layout

// Sides about the point: above, right, left, below and the diagonals, then the same farther away. GAP_DP: from the
// point to the label's edge; chosen by hand.
enum { DIRECTIONS = 8, RINGS = 4, SIDES = DIRECTIONS * RINGS };
static const double GAP_DP = 16, RING_DP = 34, ARROW_DP = 26;

static bool are_overlapping(struct ui_box a, struct ui_box b)
{
    return a.x < b.x + b.w && b.x < a.x + a.w && a.y < b.y + b.h && b.y < a.y + a.h;
}

static bool is_box_inside(struct ui_box a, struct ui_box b)
{
    return a.x >= b.x && a.y >= b.y && a.x + a.w <= b.x + b.w && a.y + a.h <= b.y + b.h;
}

static struct ui_box box_of(const struct placed_label *label, int side)
{
    static const double direction[DIRECTIONS][2] = {{0, -1}, {1, 0},   {-1, 0}, {0, 1},
                                                    {1, -1}, {-1, -1}, {1, 1},  {-1, 1}};
    const double *d = direction[side % DIRECTIONS], away = GAP_DP + RING_DP * (side / DIRECTIONS);
    const double x = label->at.x + d[0] * (away + label->w / 2), y = label->at.y + d[1] * (away + label->h / 2);
    return (struct ui_box){x - label->w / 2, y - label->h / 2, label->w, label->h};
}

static bool is_free(struct ui_box box, const struct placed_label *labels, int before, const struct ui_box *taken,
                    int taken_count)
{
    for (int i = 0; i < taken_count; i++)
        if (are_overlapping(box, taken[i]))
            return false;
    for (int i = 0; i < before; i++)
        if (labels[i].side != LABEL_NO_SIDE && are_overlapping(box, labels[i].box))
            return false;
    return true;
}

void label_layout(struct placed_label *labels, int count, struct ui_box bounds, const struct ui_box *taken,
                  int taken_count)
{
    for (int i = 0; i < count; i++) {
        struct placed_label *l = &labels[i];
        const int last = l->side;
        const struct ui_box point = {l->at.x, l->at.y, 0, 0};
        l->side = LABEL_NO_SIDE;
        if (!is_box_inside(point, bounds))
            continue;
        for (int k = -1; k < SIDES && l->side == LABEL_NO_SIDE; k++) {
            const int side = k < 0 ? last : k;
            if (side < 0 || side >= SIDES)
                continue;
            const struct ui_box box = box_of(l, side);
            if (is_box_inside(box, bounds) && is_free(box, labels, i, taken, taken_count)) {
                l->side = side;
                l->box = box;
            }
        }
    }
}

struct edge_arrow edge_arrow_of(struct ui_point axis, double x, double y, bool ahead, struct ui_box bounds)
{
    const struct ui_point at = {axis.x + x, axis.y + y};
    struct edge_arrow out = {.dx = 0, .dy = 1};
    out.inside = ahead && is_box_inside((struct ui_box){at.x, at.y, 0, 0}, bounds);
    if (out.inside) {
        out.at = (struct ui_point){at.x, at.y - ARROW_DP};
        return out;
    }
    // Along the ray from the bounds' middle to the point; what is behind lies on the other side of the screen's plane.
    const struct ui_point middle = {bounds.x + bounds.w / 2, bounds.y + bounds.h / 2};
    double dx = ahead ? at.x - middle.x : -x, dy = ahead ? at.y - middle.y : -y;
    const double length = sqrt(dx * dx + dy * dy);
    out.dx = length > 1e-9 ? dx / length : 1;
    out.dy = length > 1e-9 ? dy / length : 0;
    const double along = fmin(bounds.w / 2 / fmax(fabs(out.dx), 1e-9), bounds.h / 2 / fmax(fabs(out.dy), 1e-9));
    out.at = (struct ui_point){middle.x + along * out.dx, middle.y + along * out.dy};
    return out;
}

// ---------------------------------------------------------------- thing sheets

// The sheets of things: finding one by its name, and what is known of it.

static const double ROW = 62, PAD = 14;

static void thing_row(const struct brush *brush, const struct room_thing *thing, struct ui_box row, double away_m,
                      bool wanted)
{
    char text[64];
    const struct theme *th = brush->theme;
    if (wanted)
        ui_fill(brush->ui, row, ROUND, faint(th->accent, 0.2));
    label(brush, FACE_BODY, (struct ui_box){row.x + 14, row.y + 6, row.w - 28, 28}, wanted ? th->accent : th->text,
          thing->name);
    snprintf(text, sizeof text, "%.1f m away%s", away_m, thing->gone ? " · not where it stood" : "");
    label(brush, FACE_SMALL, (struct ui_box){row.x + 14, row.y + 33, row.w - 28, 22}, th->quiet, text);
}

static void filter_field(const struct brush *brush, const struct view_state *state, struct ui_box box)
{
    const struct theme *t = brush->theme;
    ui_fill(brush->ui, box, box.h / 2, t->raised);
    icon_draw(brush->ui, ICON_FIND, (struct ui_point){box.x + 26, box.y + box.h / 2}, 22, t->quiet);
    const bool empty = !state->room.filter[0];
    const struct ui_box in = {box.x + 48, box.y, box.w - 60, box.h};
    label(brush, FACE_BODY, in, empty ? t->quiet : t->text, empty ? "Type a name, or choose" : state->room.filter);
    if (!empty) {
        const double x = in.x + fmin(ui_text_width(brush->ui, FACE_BODY, state->room.filter), in.w) + 2;
        ui_fill(brush->ui, (struct ui_box){x, box.y + 12, 2, box.h - 24}, 0, t->accent);
    }
}

static void find_sheet(const struct brush *brush, struct room_ui *ui, struct view_state *state,
                       const struct room_page *page, struct ui_box box, struct vec3 eye, int64_t now_ns)
{
    struct ui_box in = inner(box, PAD), head = cut_top(&in, SHEET_TITLE);
    if (icon_button(brush, "things-close", (struct icon_words){ICON_CLOSE, "Close"}, BUTTON_RAISED,
                    cut_right(&head, TARGET)))
        view_state_do(state, DO_THINGS, now_ns);
    label(brush, FACE_HEAD, (struct ui_box){head.x + 6, head.y, head.w - 6, head.h}, brush->theme->text,
          "Find a thing");
    filter_field(brush, state, cut_top(&in, 48));
    if (switch_row(brush, "sheet-names", ICON_TAG, "Names in the picture", state->room.names,
                   cut_bottom(&in, SHEET_ROW)))
        view_state_do(state, DO_NAMES, now_ns);
    int rows = 0, first = -1, more = 0;
    for (int i = 0; i < page->count; i++)
        rows += text_contains(page->things[i].name, state->room.filter);
    ui->list.at += state->list_steps * ROW;
    state->list_steps = 0;
    const struct brush inside = scroll_begin(brush, &ui->list, &in, rows * ROW);
    for (int i = 0, row = 0; i < page->count; i++) {
        char name[32];
        if (!text_contains(page->things[i].name, state->room.filter))
            continue;
        const double away = v3_distance(page->things[i].world_from_thing.translation, eye);
        const struct ui_box at = {in.x, in.y + row * ROW - ui->list.at, in.w - 6, ROW - 4};
        first = first < 0 ? i : first;
        more += at.y + at.h > in.y + in.h;
        row++;
        if (at.y + at.h < in.y || at.y > in.y + in.h)
            continue;
        thing_row(brush, &page->things[i], at, away, i == state->room.wanted);
        snprintf(name, sizeof name, "thing-%d", i);
        if (touch_area(&inside, name, at).tapped)
            view_state_find_thing(state, i, now_ns);
    }
    scroll_end(brush, &ui->list, more);
    if (!rows)
        label_centred(brush, FACE_BODY, (struct ui_box){in.x, in.y + 20, in.w, 30}, brush->theme->quiet,
                      "Nothing of that name");
    if (state->room.enter && first >= 0)
        view_state_find_thing(state, first, now_ns);
    state->room.enter = false;
}

// ---------------------------------------------------------------- what is known

static double draw_passage(const struct brush *brush, struct ui_box in, double y, const char *head, const char *text)
{
    const struct theme *t = brush->theme;
    if (!text[0])
        return y;
    if (head) {
        label(brush, FACE_SMALL, (struct ui_box){in.x, y, in.w, 22}, t->quiet, head);
        y += 23;
    }
    ui_text_lines(brush->ui, FACE_BODY, (struct ui_point){in.x, y}, in.w, t->text, text);
    return y + ui_text_height(brush->ui, FACE_BODY, text, in.w) + 12;
}

static double draw_pictures(const struct brush *brush, const struct thing_card *card, struct ui_box in, double y)
{
    const struct ui_uv_rect whole = {0, 0, 1, 1};
    const double h = fmin(170, (in.w - GAP) / 2);
    double x = in.x;
    if (card->picture) {
        const double w = fmin(h * card->picture_aspect, in.w - h - GAP), own_h = w / card->picture_aspect;
        ui_image(brush->ui, card->picture, (struct ui_box){x, y + (h - own_h) / 2, w, own_h}, whole, 10, 0xffffffff);
        x += w + GAP;
    }
    if (card->body) {
        const struct ui_box box = {x, y, h, h};
        ui_fill(brush->ui, box, 12, brush->theme->raised);
        ui_image(brush->ui, card->body, box, whole, 12, 0xffffffff);
        if (!card->is_model)
            label_centred(brush, FACE_SMALL, (struct ui_box){x, y + h - 26, h, 24}, brush->theme->quiet,
                          "no model kept");
    }
    return card->picture || card->body ? y + h + 14 : y;
}

static double card_text(const struct brush *brush, const struct thing_card *card, const struct room_thing *thing,
                        struct ui_box in, double y)
{
    char where[128];
    const struct vec3 at = thing->world_from_thing.translation;
    y = draw_passage(brush, in, y, NULL, card->description);
    y = draw_passage(brush, in, y, "Weight", card->weight);
    y = draw_passage(brush, in, y, "Material", card->material);
    y = draw_passage(brush, in, y, "How to use it", card->instructions);
    y = draw_passage(brush, in, y, "Note", card->note);
    const int n = snprintf(where, sizeof where, "%.2f, %.2f, %.2f m", at.x, at.y, at.z);
    if (thing->sigma_m > 0)
        snprintf(where + n, sizeof where - (size_t)n, ", to %.0f mm", fmax(1, thing->sigma_m * 1e3));
    y = draw_passage(brush, in, y, "Where it stands", where);
    ui_text_lines(brush->ui, FACE_SMALL, (struct ui_point){in.x, y}, in.w,
                  card->source_warns ? brush->theme->warn : brush->theme->quiet, card->source);
    return y + ui_text_height(brush->ui, FACE_SMALL, card->source, in.w) + 8;
}

static void card_sheet(const struct brush *brush, struct room_ui *ui, struct view_state *state,
                       const struct room_page *page, struct ui_box box, int64_t now_ns)
{
    const struct thing_card *c = page->card;
    const int i = state->room.card;
    struct ui_box in = inner(box, PAD), head = cut_top(&in, TARGET), foot = cut_bottom(&in, TARGET);
    if (icon_button(brush, "card-close", (struct icon_words){ICON_CLOSE, "Close"}, BUTTON_RAISED,
                    cut_right(&head, TARGET)))
        view_state_open_card(state, i, now_ns);
    label(brush, FACE_HEAD, (struct ui_box){head.x + 6, head.y, head.w - 6, head.h}, brush->theme->text, c->name);
    const bool led = state->room.wanted == i;
    if (text_button(brush, "card-find", led ? "Hide the arrow" : "Lead me there", led ? BUTTON_RAISED : BUTTON_MAIN,
                    foot))
        view_state_find_thing(state, i, now_ns);
    ui->text.at += state->list_steps * ROW;
    state->list_steps = 0;
    (void)scroll_begin(brush, &ui->text, &in, ui->text_h); // of the last frame: it is known once it was laid out
    const struct ui_box text = {in.x + 6, in.y, in.w - 12, in.h};
    const double from = in.y - ui->text.at, y = draw_pictures(brush, c, text, from);
    ui->text_h = card_text(brush, c, &page->things[i], text, y) - from;
    scroll_end(brush, &ui->text, 0);
}

void thing_sheet_draw(const struct brush *brush, struct room_ui *ui, struct view_state *state,
                      const struct room_page *page, struct ui_box box, struct vec3 eye, int64_t now_ns)
{
    panel(brush, box, false);
    if (state->sheet == SHEET_THINGS)
        find_sheet(brush, ui, state, page, box, eye, now_ns);
    else if (state->sheet == SHEET_CARD && page->card && state->room.card >= 0 && state->room.card < page->count)
        card_sheet(brush, ui, state, page, box, now_ns);
    (void)ui_area(brush->ui, "sheet", box); // touches do not pass through
}

// ---------------------------------------------------------------- thing labels

static const double LABEL_H = 40, FAINTEST = 0.08, TOO_NEAR_M = 0.15, INSIDE_DP = 34;
static const double HIDDEN_OPACITY = 0.6; // of the label of what is hidden; chosen by hand

void room_ui_start(struct room_ui *ui)
{
    *ui = (struct room_ui){.text_h = 0};
    for (int i = 0; i < 2 * ROOM_LABELS_MAX; i++)
        ui->sides[i / ROOM_LABELS_MAX][i % ROOM_LABELS_MAX] = LABEL_NO_SIDE;
}

struct marked {
    int thing;
    double distance_m, opacity;
    bool hidden;
    char text[96];
};

// What is hidden chooses its place last.
static int nearer_first(const void *a, const void *b)
{
    const struct marked *x = a, *y = b;
    if (x->hidden != y->hidden)
        return x->hidden ? 1 : -1;
    if (x->distance_m != y->distance_m)
        return x->distance_m < y->distance_m ? -1 : 1;
    return x->thing - y->thing;
}

static const char *answer_text(const struct room_thing *thing)
{
    if (thing->gone)
        return " · gone?";
    if (thing->answer == ANSWER_ASKING)
        return " · asking …";
    return thing->answer == ANSWER_NONE ? " · no answer" : "";
}

// in_map: its viewpoint is far from everything and looks in from outside; labels fade and are hidden in the picture
// only.
static int mark_things(const struct room_page *page, const struct figure_view *view, int wanted, bool in_map,
                       struct marked out[ROOM_LABELS_MAX])
{
    int count = 0;
    for (int i = 0; i < page->count && i < ROOM_LABELS_MAX; i++) {
        const struct room_thing *t = &page->things[i];
        const double away = v3_distance(t->world_from_thing.translation, view->world_from_camera.translation);
        struct marked m = {.thing = i,
                           .distance_m = away,
                           .opacity = room_label_opacity(in_map ? 0 : away, t->sigma_m, t->gone),
                           .hidden = t->hidden && !in_map};
        if (i == wanted) {
            m.opacity = 1;
            m.hidden = false; // the arrow leads to it, whatever is before it
            m.distance_m = 0; // it chooses its place first
        }
        if (away < TOO_NEAR_M || m.opacity < FAINTEST)
            continue;
        snprintf(m.text, sizeof m.text, "%s%s", t->name, answer_text(t));
        out[count++] = m;
    }
    qsort(out, (size_t)count, sizeof *out, nearer_first);
    return count;
}

static void draw_label(const struct brush *brush, const struct placed_label *label, const struct marked *marked,
                       bool wanted)
{
    const struct theme *t = brush->theme;
    const struct ui_box pill = {label->box.x, label->box.y + (label->box.h - LABEL_H) / 2, label->box.w, LABEL_H};
    const double x = fmin(fmax(label->at.x, pill.x), pill.x + pill.w),
                 y = fmin(fmax(label->at.y, pill.y), pill.y + pill.h);
    const double o = 0.25 + 0.75 * marked->opacity;
    if (marked->hidden) { // an outline: what it names is not in sight
        const uint32_t color = faint(t->text, HIDDEN_OPACITY * o);
        ui_ring(brush->ui, label->at, 4.5, 1.5, color);
        ui_line(brush->ui, label->at, (struct ui_point){x, y}, 1, color);
        ui_border(brush->ui, pill, LABEL_H / 2, 1.5, color);
        label_centred(brush, FACE_SMALL, pill, color, marked->text);
        return;
    }
    ui_line(brush->ui, label->at, (struct ui_point){x, y}, 2, faint(wanted ? t->accent : t->text, o));
    ui_disc(brush->ui, label->at, 6.5, faint(t->ground, o));
    ui_disc(brush->ui, label->at, 4.5, faint(t->accent, o));
    ui_shadow(brush->ui, pill, LABEL_H / 2, 6, faint(t->shadow, o));
    ui_fill(brush->ui, pill, LABEL_H / 2, faint(wanted ? t->accent : t->glass, o));
    label_centred(brush, FACE_SMALL, pill, faint(wanted ? t->on_accent : t->text, o), marked->text);
}

// Where the point would be on the screen's plane, dp from the view's axis; behind the viewpoint mirrored, as
// edge_arrow_of takes it.
static struct edge_arrow arrow_to(const struct figure_view *view, struct vec3 world, struct ui_box bounds)
{
    const struct vec3 c = pose_apply(pose_inverse(view->world_from_camera), world);
    const double z = fabs(c.z) < 1e-3 ? copysign(1e-3, c.z) : c.z, scale = view->cover.scale * view->lens.fx / z;
    const struct ui_point axis = {view->cover.x + (view->lens.cx + 0.5) * view->cover.scale,
                                  view->cover.y + (view->lens.cy + 0.5) * view->cover.scale};
    struct ui_point at;
    if (figure_point(view, world, &at)) // with the lens's distortion
        return edge_arrow_of(axis, at.x - axis.x, at.y - axis.y, true, bounds);
    return edge_arrow_of(axis, scale * c.x, scale * c.y, c.z > 0, bounds);
}

static void draw_arrow(const struct brush *brush, const struct edge_arrow *arrow, double distance_m)
{
    const struct theme *t = brush->theme;
    const double size = 20, px = -arrow->dy, py = arrow->dx;
    const struct ui_point tip = arrow->at, base = {tip.x - 1.5 * size * arrow->dx, tip.y - 1.5 * size * arrow->dy};
    const struct ui_point left = {base.x + 0.8 * size * px, base.y + 0.8 * size * py},
                          right = {base.x - 0.8 * size * px, base.y - 0.8 * size * py};
    const struct ui_point shape[3] = {tip, right, left}; // clockwise on the screen, as polygons are drawn
    ui_stroke(brush->ui, shape, 3, true, 9, faint(t->ground, 0.8));
    ui_polygon(brush->ui, shape, 3, t->accent);
    ui_stroke(brush->ui, shape, 3, true, 4, t->accent);
    if (arrow->inside)
        return;
    char text[32];
    snprintf(text, sizeof text, "%.1f m", distance_m);
    const double w = ui_text_width(brush->ui, FACE_SMALL, text) + 20;
    const struct ui_point m = {base.x - 34 * arrow->dx, base.y - 26 * arrow->dy};
    const struct ui_box pill = {m.x - w / 2, m.y - 14, w, 28};
    ui_fill(brush->ui, pill, 14, t->glass);
    label_centred(brush, FACE_SMALL, pill, t->text, text);
}

// In sight, the arrow is on the side of the point where its label is not.
static void draw_wanted(const struct brush *brush, const struct room_state *state, const struct room_page *page,
                        const struct label_view *where, const struct placed_label *own)
{
    const int i = state->wanted;
    if (i < 0 || i >= page->count)
        return;
    const struct vec3 at = page->things[i].world_from_thing.translation;
    struct edge_arrow arrow = arrow_to(where->view, at, inner(where->bounds, INSIDE_DP));
    if (arrow.inside && own && own->side != LABEL_NO_SIDE && own->box.y + own->box.h / 2 < own->at.y) {
        arrow.at.y = 2 * own->at.y - arrow.at.y;
        arrow.dy = -1;
    }
    draw_arrow(brush, &arrow, v3_distance(at, where->view->world_from_camera.translation));
}

struct label_set { // the same thing's at each index
    struct marked marked[ROOM_LABELS_MAX];
    struct placed_label labels[ROOM_LABELS_MAX];
    int count;
};

// Keeps of those that are marked the ones in sight, and chooses places for their labels.
static void place_labels(const struct brush *brush, const struct room_ui *ui, const struct room_page *page,
                         const struct label_view *where, struct label_set *set)
{
    int shown = 0;
    for (int i = 0; i < set->count; i++) {
        struct placed_label *l = &set->labels[shown];
        const int thing = set->marked[i].thing;
        if (!figure_point(where->view, page->things[thing].world_from_thing.translation, &l->at))
            continue;
        l->w = ui_text_width(brush->ui, FACE_SMALL, set->marked[i].text) + 32;
        l->h = TARGET;
        l->side = ui->sides[where->number][thing];
        set->marked[shown++] = set->marked[i];
    }
    set->count = shown;
    label_layout(set->labels, shown, inner(where->bounds, 4), where->taken, where->taken_count);
}

int thing_labels_draw(const struct brush *brush, struct room_ui *ui, const struct room_state *state,
                      const struct room_page *page, const struct label_view *where)
{
    struct label_set set;
    const int number = where->number;
    int touched = ROOM_NOTHING;
    set.count = state->names ? mark_things(page, where->view, state->wanted, number == 1, set.marked) : 0;
    place_labels(brush, ui, page, where, &set);
    ui_clip(brush->ui, where->bounds);
    for (int i = set.count - 1; i >= 0; i--) { // the nearest last, over the lines of others
        const struct placed_label *l = &set.labels[i];
        const struct marked *m = &set.marked[i];
        ui->sides[number][m->thing] = l->side;
        ui->boxes[number][m->thing] = l->box;
        if (l->side == LABEL_NO_SIDE)
            ui_disc(brush->ui, l->at, 4.5, faint(brush->theme->accent, m->opacity)); // there is no room for its name
        else
            draw_label(brush, l, m, m->thing == state->wanted);
    }
    for (int i = 0; i < set.count; i++) {
        char name[32];
        snprintf(name, sizeof name, "label-%d-%d", number, set.marked[i].thing);
        if (set.labels[i].side != LABEL_NO_SIDE && ui_area(brush->ui, name, set.labels[i].box).tapped)
            touched = set.marked[i].thing;
    }
    const bool has_own = set.count && set.marked[0].thing == state->wanted;
    draw_wanted(brush, state, page, where, has_own ? &set.labels[0] : NULL);
    ui_unclip(brush->ui);
    return touched;
}

// ---------------------------------------------------------------- map

enum { ROUND_POINTS = 36 };
static const double PI = 3.14159265358979323846, HEADING_M = 0.55;

static void draw_segment(const struct brush *brush, const struct figure_view *view, struct vec3 from, struct vec3 to,
                         double thickness, uint32_t color)
{
    struct ui_point p, q;
    if (figure_point(view, from, &p) && figure_point(view, to, &q))
        ui_line(brush->ui, p, q, thickness, color);
}

// Where there is no surface yet, a floor of half metres tells how far things are apart.
static void draw_floor(const struct brush *brush, const struct room_page *page)
{
    const struct figure_view *v = &page->map_view;
    const double step = 0.5;
    const int reach = 10;
    for (int i = -reach; i <= reach; i++)
        for (int k = -reach; k < reach; k++) {
            const double away = hypot(i, k) / reach, share = fmax(0, 1 - away * away);
            if (share <= 0)
                continue;
            draw_segment(brush, v, v3(i * step, k * step, 0), v3(i * step, (k + 1) * step, 0), 1,
                         faint(brush->theme->grid, share));
            draw_segment(brush, v, v3(k * step, i * step, 0), v3((k + 1) * step, i * step, 0), 1,
                         faint(brush->theme->grid, share));
        }
}

static void draw_tag(const struct brush *brush, const struct figure_view *view, const struct place_tag *tag)
{
    struct vec3 world[4];
    struct ui_point at[4];
    place_tag_corners(tag, world);
    for (int i = 0; i < 4; i++)
        if (!figure_point(view, world[i], &at[i]))
            return;
    ui_stroke(brush->ui, at, 4, true, 2.5, brush->theme->ghost);
}

// The three great circles of the 95 % ellipsoid.
static void draw_ellipsoid(const struct brush *brush, const struct figure_view *view, const struct room_thing *thing)
{
    const uint32_t color = faint(thing->gone ? brush->theme->warn : brush->theme->accent, 0.9);
    for (int axis = 0; axis < 3; axis++) {
        struct ui_point at[ROUND_POINTS];
        bool good = true;
        for (int i = 0; i < ROUND_POINTS && good; i++) {
            const double a = 2 * PI * i / ROUND_POINTS;
            const struct vec3 p =
                v3_add(v3_scale(thing->ellipsoid[axis], cos(a)), v3_scale(thing->ellipsoid[(axis + 1) % 3], sin(a)));
            good = figure_point(view, v3_add(thing->world_from_thing.translation, p), &at[i]);
        }
        if (good)
            ui_stroke(brush->ui, at, ROUND_POINTS, true, 1.5, color);
    }
}

// The outline of the thing's front, so that it is found where its body is small or hidden.
static void draw_front(const struct brush *brush, const struct figure_view *view, const struct room_thing *thing)
{
    static const double corner[4][2] = {{-0.5, -0.5}, {0.5, -0.5}, {0.5, 0.5}, {-0.5, 0.5}};
    struct ui_point at[4];
    for (int i = 0; i < 4; i++)
        if (!figure_point(view,
                          pose_apply(thing->world_from_thing,
                                     v3(corner[i][0] * thing->width_m, corner[i][1] * thing->height_m, 0)),
                          &at[i]))
            return;
    ui_stroke(brush->ui, at, 4, true, 2, thing->gone ? brush->theme->warn : brush->theme->accent);
}

// The tablet's picture plane as a pyramid, and an arrow on the floor below it where it looks to.
static void draw_viewer(const struct brush *brush, const struct room_page *page)
{
    const struct figure_view *v = &page->map_view;
    const struct lens *l = &page->viewer_lens;
    const struct pose *pose = &page->world_from_viewer;
    const struct vec3 eye = pose->translation;
    struct vec3 corner[4];
    for (int i = 0; i < 4; i++) {
        const struct pixel px = {i == 1 || i == 2 ? l->width - 1 : 0, i >= 2 ? l->height - 1 : 0};
        corner[i] = pose_apply(*pose, v3_scale(lens_ray(l, px), 0.35));
    }
    for (int i = 0; i < 4; i++) {
        draw_segment(brush, v, eye, corner[i], 2, brush->theme->warn);
        draw_segment(brush, v, corner[i], corner[(i + 1) % 4], 2, brush->theme->warn);
    }
    const struct vec3 ahead = quat_rotate(pose->rotation, v3(0, 0, 1)), level = v3_unit(v3(ahead.x, ahead.y, 0));
    const struct vec3 foot = v3(eye.x, eye.y, 0), tip = v3_add(foot, v3_scale(level, HEADING_M));
    const struct vec3 across = v3(-level.y, level.x, 0), back = v3_sub(tip, v3_scale(level, 0.16));
    draw_segment(brush, v, eye, foot, 1, faint(brush->theme->warn, 0.6));
    draw_segment(brush, v, foot, tip, 3, brush->theme->warn);
    draw_segment(brush, v, tip, v3_add(back, v3_scale(across, 0.1)), 3, brush->theme->warn);
    draw_segment(brush, v, tip, v3_sub(back, v3_scale(across, 0.1)), 3, brush->theme->warn);
}

static void draw_path(const struct brush *brush, const struct room_page *page)
{
    for (int i = 1; i < page->path_count; i++) {
        const double share = 0.25 + 0.75 * i / page->path_count;
        draw_segment(brush, &page->map_view, page->path[i - 1], page->path[i], 2.5, faint(brush->theme->warn, share));
    }
}

// A robot's way over the floor, and where it stands: the edges of its body, and a chevron on it at its front.
static void draw_drive(const struct brush *brush, const struct figure_view *view, const struct recorded_drive *drive)
{
    const uint32_t color = brush->theme->right;
    const struct pose *at = &drive->world_from_body;
    const double half[3] = {drive->size_m[0] / 2, drive->size_m[1] / 2, drive->size_m[2]};
    struct vec3 corner[8];
    for (int i = 1; i <= drive->path_count; i++)
        draw_segment(brush, view, drive->path[i - 1], i < drive->path_count ? drive->path[i] : at->translation, 2.5,
                     faint(color, 0.8));
    for (int i = 0; i < 8; i++)
        corner[i] = pose_apply(*at, v3(i & 1 ? half[0] : -half[0], i & 2 ? half[1] : -half[1], i & 4 ? half[2] : 0));
    for (int i = 0; i < 8; i++)
        for (int axis = 1; axis <= 4; axis *= 2)
            if (!(i & axis))
                draw_segment(brush, view, corner[i], corner[i | axis], 2, color);
    for (int side = -1; side <= 1; side += 2)
        draw_segment(brush, view, pose_apply(*at, v3(half[0], 0, half[2])),
                     pose_apply(*at, v3(0, side * half[1], half[2])), 3, color);
}

void map_overlay_draw(const struct brush *brush, const struct room_page *page)
{
    const struct figure_view *v = &page->map_view;
    for (int i = 0; i < page->tag_count; i++)
        draw_tag(brush, v, &page->tags[i]);
    for (int i = 0; i < page->count; i++) {
        draw_front(brush, v, &page->things[i]);
        draw_ellipsoid(brush, v, &page->things[i]);
    }
    draw_path(brush, page);
    if (page->drive)
        draw_drive(brush, v, page->drive);
    if (page->actor)
        figure_draw(brush, v, &(struct figure){FIGURE_BODY, page->actor, NULL, false, 0});
    if (page->viewer_known)
        draw_viewer(brush, page);
}

void map_draw(const struct brush *brush, const struct room_page *page, struct ui_box box)
{
    const struct theme *t = brush->theme;
    ui_clip(brush->ui, box);
    ui_fade(brush->ui, box, t->sky, t->floor);
    draw_floor(brush, page);
    if (page->map)
        ui_image(brush->ui, page->map, figure_image_box(&page->map_view), (struct ui_uv_rect){0, 0, 1, 1}, 0,
                 0xffffffff);
    map_overlay_draw(brush, page);
    if (page->map_is_coming)
        label_centred(brush, FACE_SMALL, (struct ui_box){box.x, box.y + MARGIN + TARGET + GAP, box.w, 24}, t->quiet,
                      "The map is being made");
    ui_fill(brush->ui, (struct ui_box){box.x, box.y, box.h > box.w ? 2 : box.w, box.h > box.w ? box.h : 2}, 0,
            t->ground);
    ui_unclip(brush->ui);
}
