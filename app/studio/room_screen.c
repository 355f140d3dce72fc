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

static void cell_color(const struct sweep_cell *cell, const struct theme *theme, uint8_t rgb[3])
{
    for (int k = 0; k < 3; k++)
        rgb[k] = (uint8_t)(theme->surface >> (24 - 8 * k));
    if (cell->floor)
        mix(rgb, theme->text, 0.05 + 0.1 * fmin(cell->floor / 12.0, 1));
    if (cell->solid)
        mix(rgb, theme->text, 0.2 + 0.45 * fmin(cell->solid / 12.0, 1));
    if (cell->points)
        mix(rgb, theme->accent, 0.35 + 0.6 * fmin(cell->points / 10.0, 1));
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

static struct ui_point on_screen(const struct plan_frame *frame, double x, double y)
{
    const double whole = SWEEP_CELLS * SWEEP_CELL_M, u = (x - frame->plan->middle_x) / whole + 0.5,
                 v = 0.5 - (y - frame->plan->middle_y) / whole;
    return (struct ui_point){frame->at.x + frame->at.w * (u - frame->part.x) / frame->part.w,
                             frame->at.y + frame->at.h * (v - frame->part.y) / frame->part.h};
}

static void draw_tags(const struct brush *brush, const struct plan_frame *frame)
{
    char text[16];
    for (int i = 0; i < frame->plan->tag_count; i++) {
        const struct sweep_tag *tag = &frame->plan->tag[i];
        if (!tag->placed)
            continue;
        const struct ui_point m = on_screen(frame, tag->x, tag->y);
        const struct ui_box box = {m.x - 15, m.y - 12, 30, 24};
        ui_fill(brush->ui, box, 6, tag->seen ? brush->theme->accent : brush->theme->warn);
        snprintf(text, sizeof text, "%d", (int)tag->id);
        label_centred(brush, FACE_SMALL, box, brush->theme->on_accent, text);
    }
}

// Where nothing can be recognised: a ring with a stroke through it, which is no matter of colour alone.
static void draw_bare(const struct brush *brush, const struct plan_frame *frame)
{
    const double radius = frame->at.w / (frame->part.w * SWEEP_CELLS * SWEEP_CELL_M) * 0.5;
    for (int i = 0; i < frame->plan->bare_count; i++) {
        const struct ui_point m = on_screen(frame, frame->plan->bare[i].x, frame->plan->bare[i].y);
        const double d = radius * 0.7;
        ui_ring(brush->ui, m, radius, 4, brush->theme->warn);
        ui_line(brush->ui, (struct ui_point){m.x - d, m.y + d}, (struct ui_point){m.x + d, m.y - d}, 3,
                brush->theme->warn);
    }
}

static void draw_sensor(const struct brush *brush, const struct plan_frame *frame)
{
    const struct sweep_plan *p = frame->plan;
    struct ui_point points[SWEEP_TRAIL];
    for (int i = 0; i < p->trail_count; i++)
        points[i] = on_screen(frame, (double)p->trail[i][0], (double)p->trail[i][1]);
    if (p->trail_count > 1)
        ui_stroke(brush->ui, points, p->trail_count, false, 3, brush->theme->text);
    if (!p->trail_count)
        return;
    const struct ui_point m = on_screen(frame, p->x, p->y);
    const double c = cos(p->heading_rad), s = -sin(p->heading_rad); // the screen's y points down
    const uint32_t color = p->located ? brush->theme->text : brush->theme->warn;
    if (p->located) {
        const struct ui_point view[3] = {m,
                                         {m.x + 60 * (c - 0.5 * s), m.y + 60 * (s + 0.5 * c)},
                                         {m.x + 60 * (c + 0.5 * s), m.y + 60 * (s - 0.5 * c)}};
        ui_polygon(brush->ui, view, 3, faint(brush->theme->text, 0.25));
    }
    ui_disc(brush->ui, m, 11, brush->theme->surface);
    ui_disc(brush->ui, m, 8, color);
}

static void draw_plan(const struct brush *brush, const struct studio_view *view, struct ui_box box)
{
    panel(brush, box, false);
    struct ui_box in = inner(box, 10), foot = cut_bottom(&in, 26);
    const double side = fmin(in.w, in.h);
    const struct plan_frame f = {
        &view->shown->room.plan, {in.x + (in.w - side) / 2, in.y + (in.h - side) / 2, side, side}, view->plan_part};
    if (view->plan)
        ui_image(brush->ui, view->plan, f.at,
                 (struct ui_uv_rect){f.part.x, f.part.y, f.part.x + f.part.w, f.part.y + f.part.h}, 10, 0xffffffff);
    ui_clip(brush->ui, f.at);
    draw_bare(brush, &f);
    draw_sensor(brush, &f);
    draw_tags(brush, &f);
    ui_unclip(brush->ui);
    // The legend: a metre, and what the colours mean.
    const double metre = side / (f.part.w * SWEEP_CELLS * SWEEP_CELL_M);
    ui_line(brush->ui, (struct ui_point){foot.x + 4, foot.y + 14}, (struct ui_point){foot.x + 4 + metre, foot.y + 14},
            3, brush->theme->text);
    label(brush, FACE_SMALL, (struct ui_box){foot.x + metre + 12, foot.y, 46, 26}, brush->theme->quiet, "1 m");
    ui_disc(brush->ui, (struct ui_point){foot.x + metre + 74, foot.y + 14}, 6, brush->theme->accent);
    label(brush, FACE_SMALL, (struct ui_box){foot.x + metre + 86, foot.y, foot.w - metre - 86, 26}, brush->theme->quiet,
          foot.w - metre - 86 > 140 ? "can be recognised" : "known");
}

// "9 of 12 tags · missing 3, 5, 7"
static void tags_text(const struct sweep_plan *plan, char *out, size_t capacity)
{
    int used, missing = 0;
    if (!plan->tag_count) {
        snprintf(out, capacity, "No list of tags: the room is known by what can be recognised in it");
        return;
    }
    used = snprintf(out, capacity, "%d of %d tags", plan->tags_seen, plan->tag_count);
    for (int i = 0; i < plan->tag_count && used < (int)capacity - 24; i++)
        if (!plan->tag[i].seen)
            used += snprintf(out + used, capacity - (size_t)used, "%s%d", missing++ ? ", " : " · missing ",
                             (int)plan->tag[i].id);
}

static void draw_hint(const struct brush *brush, const struct sweep_plan *plan, struct ui_box picture)
{
    const bool warns = plan->hint == SWEEP_SLOWER || plan->hint == SWEEP_LOST;
    enum icon icon = plan->hint == SWEEP_ENOUGH ? ICON_CHECK : ICON_TAG;
    if (warns)
        icon = ICON_WARNING;
    studio_hint_draw(brush, icon, warns, plan->text, picture);
}

static void draw_sweep(const struct brush *brush, struct studio_state *state, const struct studio_view *view,
                       struct ui_box in, int64_t now_ns)
{
    char text[300];
    const struct sweep_plan *p = &view->shown->room.plan;
    const bool upright = in.h > in.w;
    const bool on = state->page == STUDIO_ROOM;
    const struct control controls[] = {
        {"room-leave", "Leave", BUTTON_RAISED, STUDIO_BACK},
        {"room-done", on ? "Done" : "Computing ...", on ? BUTTON_MAIN : BUTTON_ON, STUDIO_START}};
    const char *const help =
        on ? "Walk slowly round the empty room, then Done" : "All pictures are put together: some seconds";
    tags_text(p, text, sizeof text);
    const double buttons_w = fmin(330, 0.5 * in.w), text_w = in.w - buttons_w - 2 * GAP;
    const double tags_h = ui_text_height(brush->ui, FACE_SMALL, text, text_w) + 6;
    const double foot_h = fmax(tags_h + ui_text_height(brush->ui, FACE_SMALL, help, text_w),
                               controls_height(brush, controls, (int)COUNT_OF(controls), buttons_w));
    struct ui_box foot = cut_bottom(&in, foot_h);
    struct ui_box plan = upright ? cut_bottom(&in, in.h * 0.56) : cut_right(&in, fmin(in.h, in.w * 0.52));
    const bool color = studio_snapshot_sees_color(view->shown);
    const struct calibration *c = &view->shown->calibration;
    const struct ui_box at =
        studio_picture_draw(brush, color ? view->color : view->depth, color ? &c->color : &c->depth, in, false);
    const struct ui_box hint = {at.x, in.y, at.w, in.h};
    if (color)
        draw_hint(brush, p, hint);
    else
        studio_hint_draw(brush, ICON_WARNING, true, coach_fault_text(FAULT_NO_COLOR), hint);
    draw_plan(brush, view, plan);
    const int done = controls_draw(brush, controls + !on, 1 + on, cut_right(&foot, buttons_w));
    if (done >= 0)
        studio_do(state, (enum studio_action)done, now_ns);
    ui_text_lines(brush->ui, FACE_SMALL, (struct ui_point){foot.x, foot.y}, text_w, brush->theme->text, text);
    ui_text_lines(brush->ui, FACE_SMALL, (struct ui_point){foot.x, foot.y + tags_h}, text_w, brush->theme->quiet, help);
}

static void draw_lines(const struct brush *brush, const struct studio_room_view *room, struct scroll *scroll,
                       struct ui_box box)
{
    const bool failed = *room->failure, good = !failed && !room->advice.count;
    char text[120];
    panel(brush, box, false);
    struct ui_box in = inner(box, 20), head = cut_top(&in, 44);
    icon_draw(brush->ui, good ? ICON_CHECK : ICON_WARNING, middle(cut_left(&head, 40)), 34,
              good ? brush->theme->accent : brush->theme->warn);
    const char *made = good ? "A good map" : "A map, with gaps";
    label(brush, FACE_HEAD, head, brush->theme->text, failed ? "No map" : made);
    const char *lines[MAP_ADVICE_LINES + 3];
    int count = 0;
    snprintf(text, sizeof text, "A camera finds its way before %.0f %% of what stands in the room",
             100 * sweep_plan_recognisable(&room->plan));
    if (failed) {
        lines[count++] = room->failure;
    } else {
        lines[count++] = room->advice.summary;
        lines[count++] = text;
        for (int i = 0; i < room->advice.count; i++)
            lines[count++] = room->advice.line[i];
    }
    if (!failed && room->plan.bare_count > 0)
        lines[count++] = "the places marked in the plan are bare: hang a tag there, or put something with print, and "
                         "film them again";
    bullet_list(brush, scroll, in, lines, count);
}

static void draw_room_review(const struct brush *brush, struct studio_state *state, const struct studio_view *view,
                             struct ui_box in, int64_t now_ns)
{
    static const struct control choices[] = {{"Keep", "Keep", BUTTON_MAIN, STUDIO_KEEP},
                                             {"Film again", "Film again", BUTTON_RAISED, STUDIO_RETAKE},
                                             {"Discard", "Discard", BUTTON_RAISED, STUDIO_DISCARD}};
    const struct studio_room_view *room = &view->shown->room;
    const bool upright = in.h > in.w;
    const int first = *room->failure ? 1 : 0, count = (int)COUNT_OF(choices) - first;
    const struct ui_box buttons = cut_bottom(&in, controls_height(brush, choices + first, count, in.w));
    struct ui_box plan = upright ? cut_bottom(&in, in.h * 0.56) : cut_right(&in, fmin(in.h, in.w * 0.52));
    draw_lines(brush, room, view->scroll, in);
    draw_plan(brush, view, plan);
    const int done = controls_draw(brush, choices + first, count, buttons);
    if (done >= 0)
        studio_do(state, (enum studio_action)done, now_ns);
}

void room_screen_draw(const struct brush *brush, struct studio_state *state, const struct studio_view *view,
                      struct ui_box in, int64_t now_ns)
{
    if (state->page == STUDIO_ROOM_REVIEW)
        draw_room_review(brush, state, view, in, now_ns);
    else
        draw_sweep(brush, state, view, in, now_ns);
}
