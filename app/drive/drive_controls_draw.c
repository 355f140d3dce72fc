#include "app/drive/drive_controls_draw.h"

#include <stdio.h>
#include <string.h>

static const uint32_t STOP_RED = 0xd3182dff, STOP_HELD = 0x8d0f1dff, STOP_INK = 0xffffffff;

static uint32_t color_of(const uint8_t rgb[3])
{
    return (uint32_t)rgb[0] << 24 | (uint32_t)rgb[1] << 16 | (uint32_t)rgb[2] << 8 | 255;
}

// A disc with a white rim; the largest letters that fit.
static void draw_stop(const struct drive_controls *c, const struct brush *b)
{
    const struct ui_box box = c->box[PART_STOP];
    const double radius = box.w / 2;
    const enum face face = ui_text_width(b->ui, FACE_TITLE, "STOP") < 1.7 * radius ? FACE_TITLE : FACE_STRONG;
    ui_shadow(b->ui, box, radius, 10, b->theme->shadow);
    ui_disc(b->ui, middle(box), radius, drive_controls_stop_is_held(c) ? STOP_HELD : STOP_RED);
    ui_ring(b->ui, middle(box), radius - 4, 3, STOP_INK);
    label_centred(b, face, box, STOP_INK, "STOP");
}

static void draw_arrows(const struct brush *b, struct ui_box box)
{
    const struct ui_point m = middle(box);
    const double out = 0.43 * box.w, side = 0.05 * box.w, in = 0.36 * box.w;
    const double way[4][2] = {{0, -1}, {1, 0}, {0, 1}, {-1, 0}};
    for (int k = 0; k < 4; k++) {
        const double x = way[k][0], y = way[k][1];
        const struct ui_point tip[3] = {{m.x + in * x - side * y, m.y + in * y + side * x},
                                        {m.x + out * x, m.y + out * y},
                                        {m.x + in * x + side * y, m.y + in * y - side * x}};
        ui_stroke(b->ui, tip, 3, false, 3, faint(b->theme->text, 0.8));
    }
}

static void draw_stick(const struct drive_controls *c, const struct brush *b)
{
    const struct ui_box box = c->box[PART_STICK];
    struct ui_point stands, m = middle(box);
    const bool held = drive_controls_stick(c, &stands);
    ui_disc(b->ui, m, box.w / 2, faint(b->theme->glass, 0.55));
    ui_ring(b->ui, m, box.w / 2 - 2, 2, faint(b->theme->text, 0.5));
    draw_arrows(b, box);
    m.x += 0.3 * box.w * stands.x;
    m.y += 0.3 * box.h * stands.y;
    ui_disc(b->ui, m, 0.19 * box.w, held ? b->theme->text : faint(b->theme->text, 0.75));
}

static void draw_button(const struct drive_controls *c, const struct brush *b, enum drive_part part, const char *text)
{
    const struct ui_box box = c->box[part];
    ui_fill(b->ui, box, ROUND, b->theme->glass);
    ui_border(b->ui, box, ROUND, 1, b->theme->hairline);
    label_centred(b, FACE_STRONG, box, b->theme->text, text);
}

// One line of the readings; moves *at down.
static void line(const struct brush *b, struct ui_point *at, enum face face, uint32_t color, const char *text)
{
    const double height = ui_text_height(b->ui, (int)face, text, 0);
    const struct ui_box ground = {at->x, at->y, ui_text_width(b->ui, (int)face, text) + 20, height + 8};
    ui_fill(b->ui, ground, 10, faint(b->theme->glass, 0.8));
    ui_text(b->ui, (int)face, (struct ui_point){at->x + 10, at->y + 4}, color, text);
    at->y += ground.h + 4;
}

static void draw_readings(const struct drive_controls *c, const struct drive_readings *r, const struct brush *b)
{
    char text[64];
    const struct theme *t = b->theme;
    struct ui_point at = {MARGIN, c->box[PART_LEAVE].y + c->box[PART_LEAVE].h + GAP};
    if (r->near) {
        const enum overlay_warning warning = overlay_warning_of(r->nearest_m);
        snprintf(text, sizeof text, "%s%.2f m", warning == WARNING_TOUCHING ? "Too near: " : "Nearest ", r->nearest_m);
        line(b, &at, FACE_HEAD, color_of(overlay_warning_color(warning)), text);
    }
    snprintf(text, sizeof text, "%.2f m/s", r->command.speed);
    line(b, &at, FACE_BODY, t->text, text);
    snprintf(text, sizeof text, "Picture %.1f s old", fmin(r->age_s, 9999));
    line(b, &at, FACE_BODY, r->picture_old ? t->warn : t->quiet, text);
}

// In the middle, above stick and STOP, as wide as it must be.
static void draw_sentence(const struct drive_controls *c, const struct drive_readings *r, const struct brush *b)
{
    const char *why = r->link_lost ? "LINK LOST: the robot stands" : drive_halt_sentence(c->halt);
    if (!why)
        return;
    const double width = fmin(c->width - 2 * MARGIN, ui_text_width(b->ui, FACE_STRONG, why) + 2 * MARGIN);
    const double height = ui_text_height(b->ui, FACE_STRONG, why, width - 2 * MARGIN);
    const double bottom = fmin(c->box[PART_STICK].y, c->box[PART_STOP].y) - GAP;
    const struct ui_box box = {(c->width - width) / 2, bottom - height - 16, width, height + 16};
    ui_fill(b->ui, box, 12, b->theme->glass);
    ui_border(b->ui, box, 12, 2, r->link_lost ? b->theme->wrong : b->theme->warn);
    ui_text_lines(b->ui, FACE_STRONG, (struct ui_point){box.x + MARGIN, box.y + 8}, width - 2 * MARGIN, b->theme->text,
                  why);
}

void drive_controls_draw(const struct drive_controls *c, const struct drive_readings *readings,
                         enum viewpoint viewpoint, bool map, const struct brush *b)
{
    static const char *const seen_from[] = {
        [VIEWPOINT_FIRST] = "Ahead", [VIEWPOINT_THIRD] = "Behind", [VIEWPOINT_ABOVE] = "Above"};
    draw_button(c, b, PART_LEAVE, "Leave");
    draw_button(c, b, PART_VIEWPOINT, seen_from[viewpoint]);
    draw_button(c, b, PART_MAP, map ? "No map" : "Map");
    draw_readings(c, readings, b);
    draw_stick(c, b);
    draw_sentence(c, readings, b);
    draw_stop(c, b);
}
