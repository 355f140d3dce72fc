#include "app/studio/studio_screen.h"

#include "app/ui/widgets.h"
#include "capture/coaching/coach.h"
#include "capture/coaching/coverage.h"
#include "capture/take_verdict.h"
#include "platform/files/installed.h"

#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

// ---------------------------------------------------------------- the sensor's pictures

void studio_depth_colors(const uint16_t *depth, int width, int height, uint8_t *out)
{
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++) {
            const int mm = depth[y * width + x];
            uint8_t *rgb = out + 3 * (y * width + x);
            if (!mm) { // no reading: hatched, so that it is not taken for near or far
                const uint8_t grey = (x + y) / 4 % 3 ? 22 : 70;
                rgb[0] = rgb[1] = rgb[2] = grey;
                continue;
            }
            const double near = fmin(fmax((5000 - mm) / 4400.0, 0), 1); // 0.6 m to 5 m
            rgb[0] = (uint8_t)(40 + 205 * near);
            rgb[1] = (uint8_t)(70 + 120 * (1 - fabs(2 * near - 1)));
            rgb[2] = (uint8_t)(215 - 180 * near);
        }
}

// Draws the image as large as fits, at the box's upper edge, mirrored as a mirror would show it or not. Returns where
// it is.
static struct ui_box draw_picture(const struct brush *brush, const struct gpu_texture *image, const struct lens *lens,
                                  struct ui_box box, bool mirrored)
{
    if (!image || lens->width <= 0) {
        ui_fill(brush->ui, box, ROUND, brush->theme->surface);
        return box;
    }
    const double aspect = (double)lens->width / lens->height;
    const double w = fmin(box.w, box.h * aspect), h = w / aspect;
    const struct ui_box at = {box.x + (box.w - w) / 2, box.y, w, h};
    const struct ui_uv_rect as_mirror = {1, 0, 0, 1}, as_is = {0, 0, 1, 1};
    ui_image(brush->ui, image, at, mirrored ? as_mirror : as_is, ROUND * 0.6, 0xffffffff);
    return at;
}

// What to do now, over the picture's lower edge: readable from four metres.
static void draw_hint_text(const struct brush *brush, enum icon icon, bool warns, const char *text,
                           struct ui_box picture)
{
    static const double LEAST = 68, EDGE = 12, ICON_W = 36;
    const double text_w = picture.w - 32 - 2 * EDGE - ICON_W - GAP;
    enum face face = FACE_HEAD; // the largest in which it is not too high
    while (face > FACE_TINY && ui_text_height(brush->ui, (int)face, text, text_w) > fmax(LEAST - EDGE, 0.3 * picture.h))
        face--;
    const double text_h = ui_text_height(brush->ui, (int)face, text, text_w), h = fmax(LEAST, text_h + EDGE);
    const struct ui_box box = {picture.x + 16, picture.y + picture.h - 16 - h, picture.w - 32, h};
    ui_fill(brush->ui, box, ROUND, brush->theme->glass);
    ui_border(brush->ui, box, ROUND, 2, warns ? brush->theme->warn : brush->theme->hairline);
    struct ui_box line = inner(box, EDGE);
    icon_draw(brush->ui, icon, middle(cut_left(&line, ICON_W)), 30, warns ? brush->theme->warn : brush->theme->accent);
    ui_text_lines(brush->ui, (int)face, (struct ui_point){line.x, box.y + (h - text_h) / 2}, text_w, brush->theme->text,
                  text);
}

// ---------------------------------------------------------------- what has been seen of the person

// The figure of the person, coloured by what has been seen, and the dial that fills.

static const double PI = 3.14159265358979323846;

// A standing figure as seen from its front, in a box of 1 x 2: where each part begins and ends and how thick it is. Its
// own left is to the right.
static const struct {
    double x0, y0, x1, y1, thick;
} limbs[SURFACE_PARTS] = {
    [PART_HEAD] = {0.5, 0.17, 0.5, 0.24, 0.21},
    [PART_UPPER_TORSO] = {0.5, 0.48, 0.5, 0.66, 0.3},
    [PART_LOWER_TORSO] = {0.5, 0.78, 0.5, 0.92, 0.27},
    [PART_LEFT_UPPER_ARM] = {0.73, 0.46, 0.83, 0.72, 0.1},
    [PART_LEFT_FOREARM] = {0.85, 0.79, 0.92, 1.06, 0.085},
    [PART_RIGHT_UPPER_ARM] = {0.27, 0.46, 0.17, 0.72, 0.1},
    [PART_RIGHT_FOREARM] = {0.15, 0.79, 0.08, 1.06, 0.085},
    [PART_LEFT_THIGH] = {0.6, 1.08, 0.64, 1.36, 0.15},
    [PART_LEFT_SHIN] = {0.645, 1.47, 0.66, 1.76, 0.11},
    [PART_RIGHT_THIGH] = {0.4, 1.08, 0.36, 1.36, 0.15},
    [PART_RIGHT_SHIN] = {0.355, 1.47, 0.34, 1.76, 0.11},
    [SURFACE_LEFT_FOOT] = {0.67, 1.88, 0.72, 1.9, 0.08},
    [SURFACE_RIGHT_FOOT] = {0.33, 1.88, 0.28, 1.9, 0.08},
};

static uint32_t mixed(uint32_t a, uint32_t b, double share)
{
    uint32_t out = 0;
    for (int shift = 0; shift < 32; shift += 8) {
        const double from = a >> shift & 255, to = b >> shift & 255;
        out |= (uint32_t)lround(from + (to - from) * share) << shift;
    }
    return out;
}

static void draw_one(const struct brush *brush, const struct coverage *coverage, enum coverage_side side,
                     struct ui_box box)
{
    const struct theme *t = brush->theme;
    const double unit = fmin(box.w, box.h / 2);
    const struct ui_point at = {box.x + (box.w - unit) / 2, box.y + (box.h - 2 * unit) / 2};
    // From the back left and right change places; from a side the limbs stand one before the other.
    const double narrow = side == COVERAGE_LEFT || side == COVERAGE_RIGHT ? 0.35 : 1,
                 mirror = side == COVERAGE_BACK ? -1 : 1;
    for (int p = 0; p < SURFACE_PARTS; p++) {
        const double share = coverage_part_share(coverage, p, side);
        const struct ui_point ends[2] = {
            {at.x + unit * (0.5 + mirror * narrow * (limbs[p].x0 - 0.5)), at.y + unit * limbs[p].y0},
            {at.x + unit * (0.5 + mirror * narrow * (limbs[p].x1 - 0.5)), at.y + unit * limbs[p].y1}};
        ui_stroke(brush->ui, ends, 2, false, unit * limbs[p].thick,
                  mixed(mixed(t->raised, t->text, 0.18), t->accent, share));
    }
}

// Four figures side by side: front, left, back, right. Grey: unseen; the accent colour: seen.
static void draw_coverage(const struct brush *brush, const struct coverage *coverage, struct ui_box box)
{
    static const char *const names[] = {"front", "left", "back", "right"};
    const double w = box.w / 4;
    for (int side = 0; side < 4; side++) {
        const struct ui_box one = {box.x + side * w, box.y, w, box.h - 24};
        draw_one(brush, coverage, (enum coverage_side)side, inner(one, 2));
        const double foot = one.y + one.h / 2 + fmin(one.w - 4, (one.h - 4) / 2); // of the figure, in the box's middle
        label_centred(brush, FACE_SMALL, (struct ui_box){one.x, fmin(foot, one.y + one.h), w, 24}, brush->theme->quiet,
                      names[side]);
    }
}

static void draw_arc(const struct brush *brush, struct ui_point centre, double radius, double share, uint32_t color)
{
    enum { POINTS = 64 };
    struct ui_point points[POINTS + 1];
    const int count = (int)ceil(fmax(share, 0.01) * POINTS);
    for (int i = 0; i <= count; i++) {
        const double a = 2 * PI * share * i / count - PI / 2;
        points[i] = (struct ui_point){centre.x + radius * cos(a), centre.y + radius * sin(a)};
    }
    ui_stroke(brush->ui, points, count + 1, false, 10, color);
}

// A turn as the person sees it in the mirror of the screen: to the own left is to the left.
static void draw_turn(const struct brush *brush, struct ui_point centre, double radius, bool left)
{
    const double way = left ? -1 : 1;
    struct ui_point points[13];
    for (int i = 0; i < 13; i++) {
        const double a = -PI / 2 - way * 0.9 + way * 1.8 * i / 12;
        points[i] = (struct ui_point){centre.x + radius * cos(a), centre.y + radius * sin(a)};
    }
    const struct ui_point tip = points[12];
    ui_stroke(brush->ui, points, 13, false, 5, brush->theme->accent);
    const struct ui_point head[3] = {
        {tip.x - way * 2, tip.y - 16}, {tip.x + way * 4, tip.y + 4}, {tip.x - way * 17, tip.y + 1}};
    ui_stroke(brush->ui, head, 3, false, 5, brush->theme->accent);
}

// A ring with the share in its middle; `advice` adds an arrow for the person's turn.
static void draw_dial(const struct brush *brush, double share, enum pose_advice advice, struct ui_box box)
{
    char text[16];
    const double radius = fmin(box.w, box.h) / 2 - 22;
    const struct ui_point centre = middle(box);
    ui_ring(brush->ui, centre, radius, 10, faint(brush->theme->text, 0.14));
    if (share > 0)
        draw_arc(brush, centre, radius, fmin(share, 1), brush->theme->accent);
    snprintf(text, sizeof text, "%.0f %%", share * 100);
    label_centred(brush, FACE_HEAD, (struct ui_box){centre.x - radius, centre.y - 16, 2 * radius, 32},
                  brush->theme->text, text);
    if (advice == ADVICE_TURN_LEFT || advice == ADVICE_TURN_RIGHT)
        draw_turn(brush, centre, radius + 17, advice == ADVICE_TURN_LEFT);
}

// ---------------------------------------------------------------- verdict

// Heading and sentences in a panel. failure: of the take, comes first; "": none. They scroll.
static void draw_verdict(const struct brush *brush, const struct take_verdict *verdict, const char *failure,
                         struct scroll *scroll, struct ui_box box)
{
    const bool good = verdict_is_good(verdict) && !*failure;
    char heading[VERDICT_LINE_BYTES];
    panel(brush, box, false);
    struct ui_box in = inner(box, 20), head = cut_top(&in, 44);
    icon_draw(brush->ui, good ? ICON_CHECK : ICON_WARNING, middle(cut_left(&head, 40)), 34,
              good ? brush->theme->accent : brush->theme->warn);
    snprintf(heading, sizeof heading, "%s", verdict_headline(verdict));
    *heading = (char)toupper((unsigned char)*heading);
    label(brush, FACE_HEAD, head, brush->theme->text, heading);
    const char *lines[VERDICT_LINES + 1];
    int count = 0;
    if (*failure)
        lines[count++] = failure;
    for (int i = 0; i < verdict->count; i++)
        if (verdict_shows_line(verdict, i))
            lines[count++] = verdict->line[i].text;
    bullet_list(brush, scroll, in, lines, count);
}

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

// ---------------------------------------------------------------- the room

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

static void draw_sweep_hint(const struct brush *brush, const struct sweep_plan *plan, struct ui_box picture)
{
    const bool warns = plan->hint == SWEEP_SLOWER || plan->hint == SWEEP_LOST;
    enum icon icon = plan->hint == SWEEP_ENOUGH ? ICON_CHECK : ICON_TAG;
    if (warns)
        icon = ICON_WARNING;
    draw_hint_text(brush, icon, warns, plan->text, picture);
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
        draw_picture(brush, color ? view->color : view->depth, color ? &c->color : &c->depth, in, false);
    const struct ui_box hint = {at.x, in.y, at.w, in.h};
    if (color)
        draw_sweep_hint(brush, p, hint);
    else
        draw_hint_text(brush, ICON_WARNING, true, coach_fault_text(FAULT_NO_COLOR), hint);
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

// Pages ROOM, ROOM_FINISHING and ROOM_REVIEW.
static void draw_room(const struct brush *brush, struct studio_state *state, const struct studio_view *view,
                      struct ui_box in, int64_t now_ns)
{
    if (state->page == STUDIO_ROOM_REVIEW)
        draw_room_review(brush, state, view, in, now_ns);
    else
        draw_sweep(brush, state, view, in, now_ns);
}

// ---------------------------------------------------------------- pieces of the pages

static const double SIDE = 380, ROW = 64, BESIDE = 480, LOW = 420, HINT_AND_COUNT = 300, BUTTONS_W = 520;

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
    draw_hint_text(brush, icon, shown->fault, shown->text, picture);
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
        draw_dial(brush, share, advice, flat ? cut_left(&in, side) : cut_top(&in, side));
    if (in.h >= MIN_FIGURE && in.w >= 2 * MIN_FIGURE)
        draw_coverage(brush, coverage, in);
}

static void draw_side(const struct brush *brush, const struct studio_view *view, struct ui_box box, bool upright)
{
    if (studio_snapshot_sees_color(view->shown) && (upright ? box.w > 500 : box.h > 300)) {
        struct ui_box depth = upright ? cut_left(&box, box.w * 0.5) : cut_top(&box, fmin(box.w * 0.75, box.h * 0.45));
        draw_picture(brush, view->depth, &view->shown->calibration.depth, depth, true);
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
    const struct ui_box at = draw_picture(brush, picture, large_lens(view->shown), in, true);
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
    draw_verdict(brush, &view->shown->judgement.verdict, view->shown->failure, view->scroll, in);
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
    case STUDIO_ROOM_REVIEW: draw_room(brush, state, view, in, now_ns); break;
    case STUDIO_TROUBLE: draw_trouble(brush, state, in, now_ns); break;
    default: draw_live(brush, state, view, in, now_ns); break;
    }
}
