#include "app/studio/room_screen.h"

#include "app/studio/studio_picture.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

// ---------------------------------------------------------------- the plan as a picture

static void mix(uint8_t *rgb, uint32_t color, double share)
{
    for (int k = 0; k < 3; k++)
        rgb[k] = (uint8_t)lround(rgb[k] + ((color >> (24 - 8 * k) & 255) - (double)rgb[k]) * share);
}

static void cell_color(const struct sweep_cell *cell, const struct theme *t, uint8_t rgb[3])
{
    for (int k = 0; k < 3; k++)
        rgb[k] = (uint8_t)(t->surface >> (24 - 8 * k));
    if (cell->floor)
        mix(rgb, t->text, 0.05 + 0.1 * fmin(cell->floor / 12.0, 1));
    if (cell->solid)
        mix(rgb, t->text, 0.2 + 0.45 * fmin(cell->solid / 12.0, 1));
    if (cell->points)
        mix(rgb, t->accent, 0.35 + 0.6 * fmin(cell->points / 10.0, 1));
}

void room_plan_colors(const struct sweep_plan *plan, const struct theme *theme, uint8_t *out)
{
    enum { ZOOM = ROOM_PLAN_PX / SWEEP_CELLS };
    for (int row = 0; row < SWEEP_CELLS; row++)
        for (int column = 0; column < SWEEP_CELLS; column++) {
            uint8_t rgb[3];
            cell_color(&plan->cell[row][column], theme, rgb);
            for (int y = 0; y < ZOOM; y++)
                for (int x = 0; x < ZOOM; x++) {
                    const int at = ((SWEEP_CELLS - 1 - row) * ZOOM + y) * ROOM_PLAN_PX + column * ZOOM + x;
                    memcpy(out + 3 * at, rgb, 3);
                }
        }
}

struct ui_box room_plan_part(const struct sweep_plan *plan)
{
    enum { LEAST = 40, EDGE = 3 }; // cells: five metres
    int low[2] = {SWEEP_CELLS, SWEEP_CELLS}, high[2] = {-1, -1};
    for (int row = 0; row < SWEEP_CELLS; row++)
        for (int column = 0; column < SWEEP_CELLS; column++) {
            const struct sweep_cell *c = &plan->cell[row][column];
            const int at[2] = {column, SWEEP_CELLS - 1 - row};
            if (c->floor + c->solid < 2 && !c->points && !c->tag)
                continue;
            for (int k = 0; k < 2; k++) {
                low[k] = at[k] < low[k] ? at[k] : low[k];
                high[k] = at[k] > high[k] ? at[k] : high[k];
            }
        }
    if (high[0] < 0)
        return (struct ui_box){0.25, 0.25, 0.5, 0.5};
    const double wide = fmax(high[0] - low[0], high[1] - low[1]) + 1 + 2 * EDGE,
                 side = fmin(fmax(wide, LEAST), SWEEP_CELLS);
    double corner[2];
    for (int k = 0; k < 2; k++)
        corner[k] = fmin(fmax((low[k] + high[k] + 1) / 2.0 - side / 2, 0), SWEEP_CELLS - side);
    return (struct ui_box){corner[0] / SWEEP_CELLS, corner[1] / SWEEP_CELLS, side / SWEEP_CELLS, side / SWEEP_CELLS};
}

// ---------------------------------------------------------------- drawn

// World metres to the screen.
struct plan_frame {
    const struct sweep_plan *plan;
    struct ui_box at, part;
};

static struct ui_point on_screen(const struct plan_frame *f, double x, double y)
{
    const double whole = SWEEP_CELLS * SWEEP_CELL_M, u = (x - f->plan->middle_x) / whole + 0.5,
                 v = 0.5 - (y - f->plan->middle_y) / whole;
    return (struct ui_point){f->at.x + f->at.w * (u - f->part.x) / f->part.w,
                             f->at.y + f->at.h * (v - f->part.y) / f->part.h};
}

static void draw_tags(const struct brush *b, const struct plan_frame *f)
{
    char text[16];
    for (int i = 0; i < f->plan->tag_count; i++) {
        const struct sweep_tag *tag = &f->plan->tag[i];
        if (!tag->placed)
            continue;
        const struct ui_point m = on_screen(f, tag->x, tag->y);
        const struct ui_box box = {m.x - 15, m.y - 12, 30, 24};
        ui_fill(b->ui, box, 6, tag->seen ? b->theme->accent : b->theme->warn);
        snprintf(text, sizeof text, "%d", (int)tag->id);
        label_centred(b, FACE_SMALL, box, b->theme->on_accent, text);
    }
}

// Where nothing can be recognised: a ring with a stroke through it, which is no matter of colour alone.
static void draw_bare(const struct brush *b, const struct plan_frame *f)
{
    const double radius = f->at.w / (f->part.w * SWEEP_CELLS * SWEEP_CELL_M) * 0.5;
    for (int i = 0; i < f->plan->bare_count; i++) {
        const struct ui_point m = on_screen(f, f->plan->bare[i].x, f->plan->bare[i].y);
        const double d = radius * 0.7;
        ui_ring(b->ui, m, radius, 4, b->theme->warn);
        ui_line(b->ui, (struct ui_point){m.x - d, m.y + d}, (struct ui_point){m.x + d, m.y - d}, 3, b->theme->warn);
    }
}

static void draw_sensor(const struct brush *b, const struct plan_frame *f)
{
    const struct sweep_plan *p = f->plan;
    struct ui_point points[SWEEP_TRAIL];
    for (int i = 0; i < p->trail_count; i++)
        points[i] = on_screen(f, (double)p->trail[i][0], (double)p->trail[i][1]);
    if (p->trail_count > 1)
        ui_stroke(b->ui, points, p->trail_count, false, 3, b->theme->text);
    if (!p->trail_count)
        return;
    const struct ui_point m = on_screen(f, p->x, p->y);
    const double c = cos(p->heading_rad), s = -sin(p->heading_rad); // the screen's y points down
    const uint32_t color = p->located ? b->theme->text : b->theme->warn;
    if (p->located) {
        const struct ui_point view[3] = {m,
                                         {m.x + 60 * (c - 0.5 * s), m.y + 60 * (s + 0.5 * c)},
                                         {m.x + 60 * (c + 0.5 * s), m.y + 60 * (s - 0.5 * c)}};
        ui_polygon(b->ui, view, 3, faint(b->theme->text, 0.25));
    }
    ui_disc(b->ui, m, 11, b->theme->surface);
    ui_disc(b->ui, m, 8, color);
}

static void draw_plan(const struct brush *b, const struct studio_view *v, struct ui_box box)
{
    panel(b, box, false);
    struct ui_box in = inner(box, 10), foot = cut_bottom(&in, 26);
    const double side = fmin(in.w, in.h);
    const struct plan_frame f = {
        &v->shown->room.plan, {in.x + (in.w - side) / 2, in.y + (in.h - side) / 2, side, side}, v->plan_part};
    if (v->plan)
        ui_image(b->ui, v->plan, f.at,
                 (struct ui_uv_rect){f.part.x, f.part.y, f.part.x + f.part.w, f.part.y + f.part.h}, 10, 0xffffffff);
    ui_clip(b->ui, f.at);
    draw_bare(b, &f);
    draw_sensor(b, &f);
    draw_tags(b, &f);
    ui_unclip(b->ui);
    // The legend: a metre, and what the colours mean.
    const double metre = side / (f.part.w * SWEEP_CELLS * SWEEP_CELL_M);
    ui_line(b->ui, (struct ui_point){foot.x + 4, foot.y + 14}, (struct ui_point){foot.x + 4 + metre, foot.y + 14}, 3,
            b->theme->text);
    label(b, FACE_SMALL, (struct ui_box){foot.x + metre + 12, foot.y, 46, 26}, b->theme->quiet, "1 m");
    ui_disc(b->ui, (struct ui_point){foot.x + metre + 74, foot.y + 14}, 6, b->theme->accent);
    label(b, FACE_SMALL, (struct ui_box){foot.x + metre + 86, foot.y, foot.w - metre - 86, 26}, b->theme->quiet,
          "can be recognised");
}

// "9 of 12 tags · missing 3, 5, 7"
static void tags_text(const struct sweep_plan *p, char *out, size_t capacity)
{
    int used, missing = 0;
    if (!p->tag_count) {
        snprintf(out, capacity, "No list of tags: the room is known by what can be recognised in it");
        return;
    }
    used = snprintf(out, capacity, "%d of %d tags", p->tags_seen, p->tag_count);
    for (int i = 0; i < p->tag_count && used < (int)capacity - 24; i++)
        if (!p->tag[i].seen)
            used += snprintf(out + used, capacity - (size_t)used, "%s%d", missing++ ? ", " : " · missing ",
                             (int)p->tag[i].id);
}

static void draw_hint(const struct brush *b, const struct sweep_plan *p, struct ui_box picture)
{
    const bool warns = p->hint == SWEEP_SLOWER || p->hint == SWEEP_LOST;
    studio_hint_draw(b,
                     warns                     ? ICON_WARNING
                     : p->hint == SWEEP_ENOUGH ? ICON_CHECK
                                               : ICON_TAG,
                     warns, p->text, picture);
}

static void draw_sweep(const struct brush *b, struct studio_state *s, const struct studio_view *v, struct ui_box in,
                       int64_t now_ns)
{
    char text[300];
    const struct sweep_plan *p = &v->shown->room.plan;
    const bool upright = in.h > in.w;
    struct ui_box foot = cut_bottom(&in, 92);
    struct ui_box plan = upright ? cut_bottom(&in, in.h * 0.56) : cut_right(&in, fmin(in.h, in.w * 0.52));
    const bool color = studio_snapshot_sees_color(v->shown);
    const struct calibration *c = &v->shown->calibration;
    const struct ui_box at =
        studio_picture_draw(b, color ? v->color : v->depth, color ? &c->color : &c->depth, in, false);
    const struct ui_box hint = {at.x, in.y, at.w, in.h};
    if (color)
        draw_hint(b, p, hint);
    else
        studio_hint_draw(b, ICON_WARNING, true, coach_fault_text(FAULT_NO_COLOR), hint);
    draw_plan(b, v, plan);
    const bool on = s->page == STUDIO_ROOM;
    struct ui_box button = cut_right(&foot, 200);
    button = (struct ui_box){button.x, button.y + 12, button.w, 64};
    if (text_button(b, "room-done", on ? "Done" : "Computing ...", on ? BUTTON_MAIN : BUTTON_ON, button))
        studio_do(s, STUDIO_START, now_ns);
    struct ui_box leave = cut_right(&foot, 130);
    leave = (struct ui_box){leave.x, leave.y + 12, leave.w, 64};
    if (on && text_button(b, "room-leave", "Leave", BUTTON_RAISED, leave))
        studio_do(s, STUDIO_BACK, now_ns);
    tags_text(p, text, sizeof text);
    label(b, FACE_SMALL, (struct ui_box){foot.x, foot.y + 10, foot.w, 26}, b->theme->text, text);
    label(b, FACE_SMALL, (struct ui_box){foot.x, foot.y + 40, foot.w, 26}, b->theme->quiet,
          on ? "Walk slowly round the empty room, then Done" : "All pictures are put together: some seconds");
}

static void draw_lines(const struct brush *b, const struct studio_room_view *room, struct ui_box box)
{
    const bool failed = *room->failure, good = !failed && !room->advice.count;
    char text[120];
    panel(b, box, false);
    struct ui_box in = inner(box, 20), head = cut_top(&in, 44);
    icon_draw(b->ui, good ? ICON_CHECK : ICON_WARNING, middle(cut_left(&head, 40)), 34,
              good ? b->theme->accent : b->theme->warn);
    label(b, FACE_HEAD, head, b->theme->text, failed ? "No map" : good ? "A good map" : "A map, with gaps");
    double y = in.y + 6;
    if (!failed) {
        snprintf(text, sizeof text, "A camera finds its way before %.0f %% of what stands in the room",
                 100 * sweep_plan_recognisable(&room->plan));
        const char *const first[2] = {room->advice.summary, text};
        for (int i = 0; i < 2; i++) {
            ui_text_lines(b->ui, FACE_BODY, (struct ui_point){in.x, y}, in.w, b->theme->text, first[i]);
            y += ui_text_height(b->ui, FACE_BODY, first[i], in.w) + 8;
        }
    }
    const int lines = failed ? 1 : room->advice.count + (room->plan.bare_count > 0);
    for (int i = 0; i < lines && y < in.y + in.h - 26; i++) {
        const char *line = failed ? room->failure
                           : i < room->advice.count
                               ? room->advice.line[i]
                               : "the places marked in the plan are bare: hang a tag there, or put "
                                 "something with print, and film them again";
        ui_disc(b->ui, (struct ui_point){in.x + 8, y + 13}, 3, b->theme->quiet);
        ui_text_lines(b->ui, FACE_BODY, (struct ui_point){in.x + 24, y}, in.w - 24, b->theme->text, line);
        y += ui_text_height(b->ui, FACE_BODY, line, in.w - 24) + 8;
    }
}

static void draw_room_review(const struct brush *b, struct studio_state *s, const struct studio_view *v,
                             struct ui_box in, int64_t now_ns)
{
    static const struct {
        const char *text;
        enum studio_action action;
    } choices[] = {{"Keep", STUDIO_KEEP}, {"Film again", STUDIO_RETAKE}, {"Discard", STUDIO_DISCARD}};
    const struct studio_room_view *room = &v->shown->room;
    const bool upright = in.h > in.w;
    struct ui_box buttons = cut_bottom(&in, TARGET);
    struct ui_box plan = upright ? cut_bottom(&in, in.h * 0.56) : cut_right(&in, fmin(in.h, in.w * 0.52));
    draw_lines(b, room, in);
    draw_plan(b, v, plan);
    const int first = *room->failure ? 1 : 0, count = (int)COUNT_OF(choices) - first;
    const double w = (buttons.w - (count - 1) * GAP) / count;
    for (int i = 0; i < count; i++) {
        const struct ui_box at = {buttons.x + i * (w + GAP), buttons.y, w, TARGET};
        if (text_button(b, choices[first + i].text, choices[first + i].text, i ? BUTTON_RAISED : BUTTON_MAIN, at))
            studio_do(s, choices[first + i].action, now_ns);
    }
}

void room_screen_draw(const struct brush *b, struct studio_state *s, const struct studio_view *v, struct ui_box in,
                      int64_t now_ns)
{
    if (s->page == STUDIO_ROOM_REVIEW)
        draw_room_review(b, s, v, in, now_ns);
    else
        draw_sweep(b, s, v, in, now_ns);
}
