// Labels at the things, and the arrow that leads to one.
#include "app/ui/room_page.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

static const double LABEL_H = 40, FAINTEST = 0.08, TOO_NEAR_M = 0.15, INSIDE_DP = 34;
static const double HIDDEN_OPACITY = 0.6; // of the label of what is hidden; chosen by hand

void room_ui_start(struct room_ui *ui)
{
    *ui = (struct room_ui){.text_h = 0};
    for (int i = 0; i < 2 * ROOM_LABELS_MOST; i++)
        ui->sides[i / ROOM_LABELS_MOST][i % ROOM_LABELS_MOST] = LABEL_NO_SIDE;
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

static const char *answer_text(const struct room_thing *t)
{
    if (t->gone)
        return " · gone?";
    if (t->answer == ANSWER_ASKING)
        return " · asking …";
    return t->answer == ANSWER_NONE ? " · no answer" : "";
}

// in_map: its viewpoint is far from everything and looks in from outside; labels fade and are hidden in the picture
// only.
static int mark_things(const struct room_page *page, const struct figure_view *view, int wanted, bool in_map,
                       struct marked out[ROOM_LABELS_MOST])
{
    int count = 0;
    for (int i = 0; i < page->count && i < ROOM_LABELS_MOST; i++) {
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

static void draw_label(const struct brush *b, const struct placed_label *l, const struct marked *m, bool wanted)
{
    const struct theme *t = b->theme;
    const struct ui_box pill = {l->box.x, l->box.y + (l->box.h - LABEL_H) / 2, l->box.w, LABEL_H};
    const double x = fmin(fmax(l->at.x, pill.x), pill.x + pill.w), y = fmin(fmax(l->at.y, pill.y), pill.y + pill.h);
    const double o = 0.25 + 0.75 * m->opacity;
    if (m->hidden) { // an outline: what it names is not in sight
        const uint32_t color = faint(t->text, HIDDEN_OPACITY * o);
        ui_ring(b->ui, l->at, 4.5, 1.5, color);
        ui_line(b->ui, l->at, (struct ui_point){x, y}, 1, color);
        ui_border(b->ui, pill, LABEL_H / 2, 1.5, color);
        label_centred(b, FACE_SMALL, pill, color, m->text);
        return;
    }
    ui_line(b->ui, l->at, (struct ui_point){x, y}, 2, faint(wanted ? t->accent : t->text, o));
    ui_disc(b->ui, l->at, 6.5, faint(t->ground, o));
    ui_disc(b->ui, l->at, 4.5, faint(t->accent, o));
    ui_shadow(b->ui, pill, LABEL_H / 2, 6, faint(t->shadow, o));
    ui_fill(b->ui, pill, LABEL_H / 2, faint(wanted ? t->accent : t->glass, o));
    label_centred(b, FACE_SMALL, pill, faint(wanted ? t->on_accent : t->text, o), m->text);
}

// Where the point would be on the screen's plane, dp from the view's axis; behind the viewpoint mirrored, as
// edge_arrow_of takes it.
static struct edge_arrow arrow_to(const struct figure_view *v, struct vec3 world, struct ui_box bounds)
{
    const struct vec3 c = pose_apply(pose_inverse(v->world_from_camera), world);
    const double z = fabs(c.z) < 1e-3 ? copysign(1e-3, c.z) : c.z, scale = v->cover.scale * v->lens.fx / z;
    const struct ui_point axis = {v->cover.x + (v->lens.cx + 0.5) * v->cover.scale,
                                  v->cover.y + (v->lens.cy + 0.5) * v->cover.scale};
    struct ui_point at;
    if (figure_point(v, world, &at)) // with the lens's distortion
        return edge_arrow_of(axis, at.x - axis.x, at.y - axis.y, true, bounds);
    return edge_arrow_of(axis, scale * c.x, scale * c.y, c.z > 0, bounds);
}

static void draw_arrow(const struct brush *b, const struct edge_arrow *a, double distance_m)
{
    const struct theme *t = b->theme;
    const double size = 20, px = -a->dy, py = a->dx;
    const struct ui_point tip = a->at, base = {tip.x - 1.5 * size * a->dx, tip.y - 1.5 * size * a->dy};
    const struct ui_point left = {base.x + 0.8 * size * px, base.y + 0.8 * size * py},
                          right = {base.x - 0.8 * size * px, base.y - 0.8 * size * py};
    const struct ui_point shape[3] = {tip, right, left}; // clockwise on the screen, as polygons are drawn
    ui_stroke(b->ui, shape, 3, true, 9, faint(t->ground, 0.8));
    ui_polygon(b->ui, shape, 3, t->accent);
    ui_stroke(b->ui, shape, 3, true, 4, t->accent);
    if (a->inside)
        return;
    char text[32];
    snprintf(text, sizeof text, "%.1f m", distance_m);
    const double w = ui_text_width(b->ui, FACE_SMALL, text) + 20;
    const struct ui_point m = {base.x - 34 * a->dx, base.y - 26 * a->dy};
    const struct ui_box pill = {m.x - w / 2, m.y - 14, w, 28};
    ui_fill(b->ui, pill, 14, t->glass);
    label_centred(b, FACE_SMALL, pill, t->text, text);
}

// In sight, the arrow is on the side of the point where its label is not.
static void draw_wanted(const struct brush *b, const struct room_state *s, const struct room_page *page,
                        const struct label_view *where, const struct placed_label *own)
{
    const int i = s->wanted;
    if (i < 0 || i >= page->count)
        return;
    const struct vec3 at = page->things[i].world_from_thing.translation;
    struct edge_arrow arrow = arrow_to(where->view, at, inner(where->bounds, INSIDE_DP));
    if (arrow.inside && own && own->side != LABEL_NO_SIDE && own->box.y + own->box.h / 2 < own->at.y) {
        arrow.at.y = 2 * own->at.y - arrow.at.y;
        arrow.dy = -1;
    }
    draw_arrow(b, &arrow, v3_distance(at, where->view->world_from_camera.translation));
}

struct label_set { // the same thing's at each index
    struct marked marked[ROOM_LABELS_MOST];
    struct placed_label labels[ROOM_LABELS_MOST];
    int count;
};

// Keeps of those that are marked the ones in sight, and chooses places for their labels.
static void place_labels(const struct brush *b, const struct room_ui *ui, const struct room_page *page,
                         const struct label_view *where, struct label_set *set)
{
    int shown = 0;
    for (int i = 0; i < set->count; i++) {
        struct placed_label *l = &set->labels[shown];
        const int thing = set->marked[i].thing;
        if (!figure_point(where->view, page->things[thing].world_from_thing.translation, &l->at))
            continue;
        l->w = ui_text_width(b->ui, FACE_SMALL, set->marked[i].text) + 32;
        l->h = TARGET;
        l->side = ui->sides[where->number][thing];
        set->marked[shown++] = set->marked[i];
    }
    set->count = shown;
    label_layout(set->labels, shown, inner(where->bounds, 4), where->taken, where->taken_count);
}

int thing_labels_draw(const struct brush *b, struct room_ui *ui, const struct room_state *s,
                      const struct room_page *page, const struct label_view *where)
{
    struct label_set set;
    const int number = where->number;
    int touched = ROOM_NOTHING;
    set.count = s->names ? mark_things(page, where->view, s->wanted, number == 1, set.marked) : 0;
    place_labels(b, ui, page, where, &set);
    ui_clip(b->ui, where->bounds);
    for (int i = set.count - 1; i >= 0; i--) { // the nearest last, over the lines of others
        const struct placed_label *l = &set.labels[i];
        const struct marked *m = &set.marked[i];
        ui->sides[number][m->thing] = l->side;
        ui->boxes[number][m->thing] = l->box;
        if (l->side == LABEL_NO_SIDE)
            ui_disc(b->ui, l->at, 4.5, faint(b->theme->accent, m->opacity)); // there is no room for its name
        else
            draw_label(b, l, m, m->thing == s->wanted);
    }
    for (int i = 0; i < set.count; i++) {
        char name[32];
        snprintf(name, sizeof name, "label-%d-%d", number, set.marked[i].thing);
        if (set.labels[i].side != LABEL_NO_SIDE && ui_area(b->ui, name, set.labels[i].box).tapped)
            touched = set.marked[i].thing;
    }
    const bool has_own = set.count && set.marked[0].thing == s->wanted;
    draw_wanted(b, s, page, where, has_own ? &set.labels[0] : NULL);
    ui_unclip(b->ui);
    return touched;
}
