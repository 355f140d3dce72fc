#include "app/drive/drive_controls.h"

#include "app/ui/widgets.h"

#include <stdio.h>
#include <string.h>

static void drive_controls_stop(struct drive_controls *controls, enum drive_halt why);
static bool drive_controls_stick(const struct drive_controls *controls, struct ui_point *stands);
static bool drive_controls_stop_is_held(const struct drive_controls *controls);
static const char *drive_halt_sentence(enum drive_halt why);

// ---------------------------------------------------------------- drive controls draw

static const uint32_t STOP_RED = 0xd3182dff, STOP_HELD = 0x8d0f1dff, STOP_INK = 0xffffffff;

static uint32_t color_of(const uint8_t rgb[3])
{
    return (uint32_t)rgb[0] << 24 | (uint32_t)rgb[1] << 16 | (uint32_t)rgb[2] << 8 | 255;
}

// A disc with a white rim; the largest letters that fit.
static void draw_stop(const struct drive_controls *controls, const struct brush *brush)
{
    const struct ui_box box = controls->box[PART_STOP];
    const double radius = box.w / 2;
    const enum face face = ui_text_width(brush->ui, FACE_TITLE, "STOP") < 1.7 * radius ? FACE_TITLE : FACE_STRONG;
    ui_shadow(brush->ui, box, radius, 10, brush->theme->shadow);
    ui_disc(brush->ui, middle(box), radius, drive_controls_stop_is_held(controls) ? STOP_HELD : STOP_RED);
    ui_ring(brush->ui, middle(box), radius - 4, 3, STOP_INK);
    label_centred(brush, face, box, STOP_INK, "STOP");
}

static void draw_arrows(const struct brush *brush, struct ui_box box)
{
    const struct ui_point m = middle(box);
    const double out = 0.43 * box.w, side = 0.05 * box.w, in = 0.36 * box.w;
    const double way[4][2] = {{0, -1}, {1, 0}, {0, 1}, {-1, 0}};
    for (int k = 0; k < 4; k++) {
        const double x = way[k][0], y = way[k][1];
        const struct ui_point tip[3] = {{m.x + in * x - side * y, m.y + in * y + side * x},
                                        {m.x + out * x, m.y + out * y},
                                        {m.x + in * x + side * y, m.y + in * y - side * x}};
        ui_stroke(brush->ui, tip, 3, false, 3, faint(brush->theme->text, 0.8));
    }
}

static void draw_stick(const struct drive_controls *controls, const struct brush *brush)
{
    const struct ui_box box = controls->box[PART_STICK];
    struct ui_point stands, m = middle(box);
    const bool held = drive_controls_stick(controls, &stands);
    ui_disc(brush->ui, m, box.w / 2, faint(brush->theme->glass, 0.55));
    ui_ring(brush->ui, m, box.w / 2 - 2, 2, faint(brush->theme->text, 0.5));
    draw_arrows(brush, box);
    m.x += 0.3 * box.w * stands.x;
    m.y += 0.3 * box.h * stands.y;
    ui_disc(brush->ui, m, 0.19 * box.w, held ? brush->theme->text : faint(brush->theme->text, 0.75));
}

static void draw_button(const struct drive_controls *controls, const struct brush *brush, enum drive_part part,
                        const char *text)
{
    const struct ui_box box = controls->box[part];
    ui_fill(brush->ui, box, ROUND, brush->theme->glass);
    ui_border(brush->ui, box, ROUND, 1, brush->theme->hairline);
    label_centred(brush, FACE_STRONG, box, brush->theme->text, text);
}

// One line of the readings; moves *at down.
static void draw_reading(const struct brush *brush, struct ui_point *at, enum face face, uint32_t color,
                         const char *text)
{
    const double height = ui_text_height(brush->ui, (int)face, text, 0);
    const struct ui_box ground = {at->x, at->y, ui_text_width(brush->ui, (int)face, text) + 20, height + 8};
    ui_fill(brush->ui, ground, 10, faint(brush->theme->glass, 0.8));
    ui_text(brush->ui, (int)face, (struct ui_point){at->x + 10, at->y + 4}, color, text);
    at->y += ground.h + 4;
}

static void draw_readings(const struct drive_controls *controls, const struct drive_readings *readings,
                          const struct brush *brush)
{
    char text[64];
    const struct theme *t = brush->theme;
    struct ui_point at = {MARGIN, controls->box[PART_LEAVE].y + controls->box[PART_LEAVE].h + GAP};
    if (readings->near) {
        const enum overlay_warning warning = overlay_warning_of(readings->nearest_m);
        snprintf(text, sizeof text, "%s%.2f m", warning == WARNING_TOUCHING ? "Too near: " : "Nearest ",
                 readings->nearest_m);
        draw_reading(brush, &at, FACE_HEAD, color_of(overlay_warning_color(warning)), text);
    }
    snprintf(text, sizeof text, "%.2f m/s", readings->command.speed);
    draw_reading(brush, &at, FACE_BODY, t->text, text);
    snprintf(text, sizeof text, "Picture %.1f s old", fmin(readings->age_s, 9999));
    draw_reading(brush, &at, FACE_BODY, readings->picture_old ? t->warn : t->quiet, text);
}

// In the middle, above stick and STOP, as wide as it must be.
static void draw_sentence(const struct drive_controls *controls, const struct drive_readings *readings,
                          const struct brush *brush)
{
    const char *why = readings->link_lost ? "LINK LOST: the robot stands" : drive_halt_sentence(controls->halt);
    if (!why)
        return;
    const double width = fmin(controls->width - 2 * MARGIN, ui_text_width(brush->ui, FACE_STRONG, why) + 2 * MARGIN);
    const double height = ui_text_height(brush->ui, FACE_STRONG, why, width - 2 * MARGIN);
    const double bottom = fmin(controls->box[PART_STICK].y, controls->box[PART_STOP].y) - GAP;
    const struct ui_box box = {(controls->width - width) / 2, bottom - height - 16, width, height + 16};
    ui_fill(brush->ui, box, 12, brush->theme->glass);
    ui_border(brush->ui, box, 12, 2, readings->link_lost ? brush->theme->wrong : brush->theme->warn);
    ui_text_lines(brush->ui, FACE_STRONG, (struct ui_point){box.x + MARGIN, box.y + 8}, width - 2 * MARGIN,
                  brush->theme->text, why);
}

void drive_controls_draw(const struct drive_controls *controls, const struct drive_readings *readings,
                         enum viewpoint viewpoint, bool map, const struct brush *brush)
{
    static const char *const seen_from[] = {
        [VIEWPOINT_FIRST] = "Ahead", [VIEWPOINT_THIRD] = "Behind", [VIEWPOINT_ABOVE] = "Above"};
    draw_button(controls, brush, PART_LEAVE, "Leave");
    draw_button(controls, brush, PART_VIEWPOINT, seen_from[viewpoint]);
    draw_button(controls, brush, PART_MAP, map ? "No map" : "Map");
    draw_readings(controls, readings, brush);
    draw_stick(controls, brush);
    draw_sentence(controls, readings, brush);
    draw_stop(controls, brush);
}

// ---------------------------------------------------------------- drive controls

enum { KEY_UP, KEY_DOWN, KEY_LEFT, KEY_RIGHT };
// How long key presses are ignored after the window gets the keyboard focus: the system reports keys that are already
// down as pressed then.
static const int64_t SETTLED_NS = 150000000;

// ---------------------------------------------------------------- where they are

void drive_controls_place(struct drive_controls *controls, double width, double height)
{
    if (width == controls->width && height == controls->height)
        return;
    if (controls->width > 0)
        drive_controls_stop(controls, HALT_RESIZED);
    const double min = fmin(width, height);
    const double stop = fmin(170, fmax(96, 0.3 * min)), stick = fmin(240, fmax(130, 0.42 * min));
    const double scale = fmin(1, fmin(width / (stop + stick + 3 * MARGIN), height / (stick + TARGET + 3 * MARGIN)));
    const double button = fmin(110, (width - 2 * MARGIN - 2 * GAP) / 3);
    controls->width = width;
    controls->height = height;
    controls->box[PART_STOP] =
        (struct ui_box){width - MARGIN - scale * stop, height - MARGIN - scale * stop, scale * stop, scale * stop};
    controls->box[PART_STICK] = (struct ui_box){MARGIN, height - MARGIN - scale * stick, scale * stick, scale * stick};
    for (int i = 0; i < 3; i++)
        controls->box[PART_LEAVE + i] = (struct ui_box){MARGIN + i * (button + GAP), MARGIN, button, TARGET};
}

static bool is_in_box(struct ui_box box, struct ui_point point)
{
    return point.x >= box.x && point.y >= box.y && point.x < box.x + box.w && point.y < box.y + box.h;
}

static enum drive_part part_at(const struct drive_controls *controls, struct ui_point point)
{
    for (int i = PART_STOP; i < DRIVE_PARTS; i++)
        if (is_in_box(controls->box[i], point))
            return (enum drive_part)i;
    return PART_NOTHING;
}

// ---------------------------------------------------------------- what they say

static bool drive_controls_stop_is_held(const struct drive_controls *controls)
{
    for (int i = 0; i < controls->fingers; i++)
        if (controls->finger[i].part == PART_STOP)
            return true;
    return false;
}

static double clamp_to_unit(double x) { return fmax(-1, fmin(1, x)); }

// Where the stick stands, -1..1: to the right and downwards. False: no finger holds it.
static bool drive_controls_stick(const struct drive_controls *controls, struct ui_point *stands)
{
    const struct ui_box box = controls->box[PART_STICK];
    const struct ui_point m = middle(box);
    *stands = (struct ui_point){0, 0};
    for (int i = 0; i < controls->fingers; i++)
        if (controls->finger[i].part == PART_STICK) {
            *stands = (struct ui_point){clamp_to_unit((controls->finger[i].at.x - m.x) / (0.4 * box.w)),
                                        clamp_to_unit((controls->finger[i].at.y - m.y) / (0.4 * box.h))};
            return true;
        }
    return false;
}

struct drive_command drive_controls_command(const struct drive_controls *controls)
{
    struct drive_command out = {0, 0};
    struct ui_point stick;
    const double dead = 0.15; // of the stick: who drives straight on turns by this much without wanting to
    if (drive_controls_stop_is_held(controls))
        return out;
    if (drive_controls_stick(controls, &stick)) {
        out.speed = fabs(stick.y) > dead ? -stick.y * DRIVE_FASTEST_M_S : 0;
        out.turn_rate = fabs(stick.x) > dead ? -stick.x * DRIVE_FASTEST_RAD_S : 0;
    } else if (controls->key[KEY_UP] || controls->key[KEY_DOWN] || controls->key[KEY_LEFT] ||
               controls->key[KEY_RIGHT]) {
        out.speed = (controls->key[KEY_UP] - controls->key[KEY_DOWN]) * DRIVE_KEY_M_S;
        out.turn_rate = (controls->key[KEY_LEFT] - controls->key[KEY_RIGHT]) * DRIVE_KEY_RAD_S;
    } else if (!controls->pad_halted) {
        out.speed = controls->pad_speed * DRIVE_FASTEST_M_S;
        out.turn_rate = controls->pad_turn * DRIVE_FASTEST_RAD_S;
    }
    return out;
}

static bool is_driving(const struct drive_controls *controls)
{
    const struct drive_command now = drive_controls_command(controls);
    return now.speed != 0 || now.turn_rate != 0;
}

static void drive_controls_stop(struct drive_controls *controls, enum drive_halt why)
{
    struct ui_point stick;
    const bool held = drive_controls_stick(controls, &stick) || is_driving(controls);
    memset(controls->key, 0, sizeof controls->key);
    for (int i = 0; i < controls->fingers; i++)
        if (controls->finger[i].part == PART_STICK)
            controls->finger[i].part = PART_SPENT;
    controls->pad_halted = controls->pad_speed != 0 || controls->pad_turn != 0;
    if (held || why == HALT_STOP)
        controls->halt = why;
}

void drive_controls_tick(struct drive_controls *controls, const struct drive_readings *readings, int64_t now_ns)
{
    const bool gap = controls->ticked_ns && now_ns - controls->ticked_ns > DRIVE_GAP_NS;
    controls->ticked_ns = now_ns;
    if (gap)
        drive_controls_stop(controls, HALT_GAP);
    else if (readings->link_lost)
        drive_controls_stop(controls, HALT_LINK);
    else if (readings->interrupted)
        drive_controls_stop(controls, HALT_INTERRUPTED);
    else if (readings->picture_old && is_driving(controls))
        drive_controls_stop(controls, HALT_PICTURE);
}

// Why the robot stands, for the operator; NULL: by nothing but that nothing is held.
static const char *drive_halt_sentence(enum drive_halt why)
{
    static const char *const sentences[] = {
        [HALT_STOP] = "Stopped",
        [HALT_UNFOCUSED] = "Stopped: the window lost the keyboard",
        [HALT_HIDDEN] = "Stopped: the window was hidden",
        [HALT_RESIZED] = "Stopped: the window changed its size",
        [HALT_PAD_GONE] = "Stopped: the game pad was unplugged",
        [HALT_GAP] = "Stopped: the picture stood still",
        [HALT_INTERRUPTED] = "Stopped: this program stood still",
        [HALT_LINK] = "Stopped: the link was lost",
        [HALT_PICTURE] = "Stopped: no new picture from the robot",
    };
    return why == HALT_NONE ? NULL : sentences[why];
}

// ---------------------------------------------------------------- events

static int key_of(int key)
{
    switch (key) {
    case WINDOW_KEY_UP: return KEY_UP;
    case WINDOW_KEY_DOWN: return KEY_DOWN;
    case WINDOW_KEY_LEFT: return KEY_LEFT;
    case WINDOW_KEY_RIGHT: return KEY_RIGHT;
    default: return -1;
    }
}

static bool on_key(struct drive_controls *controls, const struct window_event *event, int64_t now_ns,
                   enum drive_part *tapped)
{
    const int arrow = key_of(event->key);
    if (arrow >= 0) {
        const bool fresh = !event->repeat && !(controls->focused_ns && now_ns - controls->focused_ns < SETTLED_NS);
        if (fresh && !drive_controls_stop_is_held(controls)) {
            controls->key[arrow] = true;
            controls->halt = HALT_NONE;
        }
        return true;
    }
    switch (event->key) {
    case WINDOW_KEY_SPACE: drive_controls_stop(controls, HALT_STOP); return true;
    case WINDOW_KEY_ESCAPE:
    case WINDOW_KEY_BACK: {
        struct ui_point stick;
        if (!is_driving(controls) && !drive_controls_stick(controls, &stick) && !event->repeat)
            *tapped = PART_LEAVE;
        drive_controls_stop(controls, HALT_STOP);
        return true;
    }
    default: return false;
    }
}

static struct drive_finger *finger_of(struct drive_controls *controls, int64_t pointer)
{
    for (int i = 0; i < controls->fingers; i++)
        if (controls->finger[i].pointer == pointer)
            return &controls->finger[i];
    return NULL;
}

static bool on_down(struct drive_controls *controls, const struct window_event *event)
{
    const struct ui_point at = {event->x, event->y};
    enum drive_part part = part_at(controls, at);
    struct ui_point stick;
    struct drive_finger *finger = finger_of(controls, event->pointer); // its going up was lost
    if (finger)
        *finger = controls->finger[--controls->fingers];
    if (part == PART_STOP)
        drive_controls_stop(controls, HALT_STOP);
    const bool was_part = part != PART_NOTHING;
    if (part == PART_STICK && (drive_controls_stick(controls, &stick) || drive_controls_stop_is_held(controls)))
        part = PART_SPENT; // another finger holds it; this one does not take it over later
    if (part == PART_STICK)
        controls->halt = HALT_NONE;
    if (controls->fingers < DRIVE_FINGERS)
        controls->finger[controls->fingers++] = (struct drive_finger){event->pointer, part, at};
    return was_part;
}

static bool on_move(struct drive_controls *controls, const struct window_event *event)
{
    struct drive_finger *finger = finger_of(controls, event->pointer);
    if (!finger)
        return false;
    finger->at = (struct ui_point){event->x, event->y};
    if (finger->part == PART_STICK && is_in_box(controls->box[PART_STOP], finger->at)) {
        drive_controls_stop(controls, HALT_STOP);
        return true;
    }
    return finger->part != PART_NOTHING;
}

static bool on_up(struct drive_controls *controls, const struct window_event *event, enum drive_part *tapped)
{
    struct drive_finger *finger = finger_of(controls, event->pointer);
    if (!finger)
        return false;
    const enum drive_part part = finger->part;
    *finger = controls->finger[--controls->fingers];
    if (part >= PART_LEAVE && part_at(controls, (struct ui_point){event->x, event->y}) == part)
        *tapped = part;
    return part != PART_NOTHING;
}

static bool on_pad(struct drive_controls *controls, const struct window_event *event)
{
    if (event->kind == WINDOW_PAD_BUTTON) {
        const bool stops =
            event->button == PAD_A || event->button == PAD_B || event->button == PAD_BACK || event->button == PAD_START;
        if (stops)
            drive_controls_stop(controls, HALT_STOP);
        return stops;
    }
    if (event->axis != PAD_LEFT_X && event->axis != PAD_LEFT_Y)
        return false;
    *(event->axis == PAD_LEFT_X ? &controls->pad_turn : &controls->pad_speed) = -event->amount;
    if (controls->pad_speed == 0 && controls->pad_turn == 0)
        controls->pad_halted = false;
    else if (drive_controls_stop_is_held(controls))
        controls->pad_halted = true;
    else if (!controls->pad_halted)
        controls->halt = HALT_NONE;
    return true;
}

// Fingers whose going up may not be told any more.
static void forget_fingers(struct drive_controls *controls, enum drive_halt why)
{
    drive_controls_stop(controls, why);
    controls->fingers = 0;
}

bool drive_controls_event(struct drive_controls *controls, const struct window_event *event, int64_t now_ns,
                          enum drive_part *tapped)
{
    *tapped = PART_NOTHING;
    switch (event->kind) {
    case WINDOW_KEY: return on_key(controls, event, now_ns, tapped);
    case WINDOW_KEY_RELEASED:
        if (key_of(event->key) >= 0)
            controls->key[key_of(event->key)] = false;
        return key_of(event->key) >= 0;
    case WINDOW_POINTER_DOWN: return on_down(controls, event);
    case WINDOW_POINTER_MOVE: return on_move(controls, event);
    case WINDOW_POINTER_UP: return on_up(controls, event, tapped);
    case WINDOW_PAD_BUTTON:
    case WINDOW_PAD_AXIS: return on_pad(controls, event);
    case WINDOW_PAD_GONE:
        drive_controls_stop(controls, HALT_PAD_GONE);
        controls->pad_speed = controls->pad_turn = 0;
        return true;
    case WINDOW_UNFOCUSED: forget_fingers(controls, HALT_UNFOCUSED); return true;
    case WINDOW_FOCUSED: controls->focused_ns = now_ns; return true;
    case WINDOW_HIDDEN: forget_fingers(controls, HALT_HIDDEN); return true;
    default: return false;
    }
}
