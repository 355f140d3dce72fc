#include "app/drive/drive_controls.h"

#include "app/ui/widgets.h"

#include <stdio.h>
#include <string.h>

static void drive_controls_stop(struct drive_controls *c, enum drive_halt why);
static bool drive_controls_stick(const struct drive_controls *c, struct ui_point *stands);
static bool drive_controls_stop_is_held(const struct drive_controls *c);
static const char *drive_halt_sentence(enum drive_halt why);

// ---------------------------------------------------------------- drive controls draw

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

// ---------------------------------------------------------------- drive controls

enum { KEY_UP, KEY_DOWN, KEY_LEFT, KEY_RIGHT };
// How long key presses are ignored after the window gets the keyboard focus: the system reports keys that are already
// down as pressed then.
static const int64_t SETTLED_NS = 150000000;

// ---------------------------------------------------------------- where they are

void drive_controls_place(struct drive_controls *c, double width, double height)
{
    if (width == c->width && height == c->height)
        return;
    if (c->width > 0)
        drive_controls_stop(c, HALT_RESIZED);
    const double least = fmin(width, height);
    const double stop = fmin(170, fmax(96, 0.3 * least)), stick = fmin(240, fmax(130, 0.42 * least));
    const double scale = fmin(1, fmin(width / (stop + stick + 3 * MARGIN), height / (stick + TARGET + 3 * MARGIN)));
    const double button = fmin(110, (width - 2 * MARGIN - 2 * GAP) / 3);
    c->width = width;
    c->height = height;
    c->box[PART_STOP] =
        (struct ui_box){width - MARGIN - scale * stop, height - MARGIN - scale * stop, scale * stop, scale * stop};
    c->box[PART_STICK] = (struct ui_box){MARGIN, height - MARGIN - scale * stick, scale * stick, scale * stick};
    for (int i = 0; i < 3; i++)
        c->box[PART_LEAVE + i] = (struct ui_box){MARGIN + i * (button + GAP), MARGIN, button, TARGET};
}

static bool within(struct ui_box box, struct ui_point p)
{
    return p.x >= box.x && p.y >= box.y && p.x < box.x + box.w && p.y < box.y + box.h;
}

static enum drive_part part_at(const struct drive_controls *c, struct ui_point p)
{
    for (int i = PART_STOP; i < DRIVE_PARTS; i++)
        if (within(c->box[i], p))
            return (enum drive_part)i;
    return PART_NOTHING;
}

// ---------------------------------------------------------------- what they say

static bool drive_controls_stop_is_held(const struct drive_controls *c)
{
    for (int i = 0; i < c->fingers; i++)
        if (c->finger[i].part == PART_STOP)
            return true;
    return false;
}

static double bounded(double x) { return fmax(-1, fmin(1, x)); }

// Where the stick stands, -1..1: to the right and downwards. False: no finger holds it.
static bool drive_controls_stick(const struct drive_controls *c, struct ui_point *stands)
{
    const struct ui_box box = c->box[PART_STICK];
    const struct ui_point m = middle(box);
    *stands = (struct ui_point){0, 0};
    for (int i = 0; i < c->fingers; i++)
        if (c->finger[i].part == PART_STICK) {
            *stands = (struct ui_point){bounded((c->finger[i].at.x - m.x) / (0.4 * box.w)),
                                        bounded((c->finger[i].at.y - m.y) / (0.4 * box.h))};
            return true;
        }
    return false;
}

struct drive_command drive_controls_command(const struct drive_controls *c)
{
    struct drive_command out = {0, 0};
    struct ui_point stick;
    const double dead = 0.15; // of the stick: who drives straight on turns by this much without wanting to
    if (drive_controls_stop_is_held(c))
        return out;
    if (drive_controls_stick(c, &stick)) {
        out.speed = fabs(stick.y) > dead ? -stick.y * DRIVE_FASTEST_M_S : 0;
        out.turn_rate = fabs(stick.x) > dead ? -stick.x * DRIVE_FASTEST_RAD_S : 0;
    } else if (c->key[KEY_UP] || c->key[KEY_DOWN] || c->key[KEY_LEFT] || c->key[KEY_RIGHT]) {
        out.speed = (c->key[KEY_UP] - c->key[KEY_DOWN]) * DRIVE_KEY_M_S;
        out.turn_rate = (c->key[KEY_LEFT] - c->key[KEY_RIGHT]) * DRIVE_KEY_RAD_S;
    } else if (!c->pad_halted) {
        out.speed = c->pad_speed * DRIVE_FASTEST_M_S;
        out.turn_rate = c->pad_turn * DRIVE_FASTEST_RAD_S;
    }
    return out;
}

static bool drives(const struct drive_controls *c)
{
    const struct drive_command now = drive_controls_command(c);
    return now.speed != 0 || now.turn_rate != 0;
}

static void drive_controls_stop(struct drive_controls *c, enum drive_halt why)
{
    struct ui_point stick;
    const bool held = drive_controls_stick(c, &stick) || drives(c);
    memset(c->key, 0, sizeof c->key);
    for (int i = 0; i < c->fingers; i++)
        if (c->finger[i].part == PART_STICK)
            c->finger[i].part = PART_SPENT;
    c->pad_halted = c->pad_speed != 0 || c->pad_turn != 0;
    if (held || why == HALT_STOP)
        c->halt = why;
}

void drive_controls_tick(struct drive_controls *c, const struct drive_readings *readings, int64_t now_ns)
{
    const bool gap = c->ticked_ns && now_ns - c->ticked_ns > DRIVE_GAP_NS;
    c->ticked_ns = now_ns;
    if (gap)
        drive_controls_stop(c, HALT_GAP);
    else if (readings->link_lost)
        drive_controls_stop(c, HALT_LINK);
    else if (readings->interrupted)
        drive_controls_stop(c, HALT_INTERRUPTED);
    else if (readings->picture_old && drives(c))
        drive_controls_stop(c, HALT_PICTURE);
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

static bool on_key(struct drive_controls *c, const struct window_event *e, int64_t now_ns, enum drive_part *tapped)
{
    const int arrow = key_of(e->key);
    if (arrow >= 0) {
        const bool fresh = !e->repeat && !(c->focused_ns && now_ns - c->focused_ns < SETTLED_NS);
        if (fresh && !drive_controls_stop_is_held(c)) {
            c->key[arrow] = true;
            c->halt = HALT_NONE;
        }
        return true;
    }
    switch (e->key) {
    case WINDOW_KEY_SPACE: drive_controls_stop(c, HALT_STOP); return true;
    case WINDOW_KEY_ESCAPE:
    case WINDOW_KEY_BACK: {
        struct ui_point stick;
        if (!drives(c) && !drive_controls_stick(c, &stick) && !e->repeat)
            *tapped = PART_LEAVE;
        drive_controls_stop(c, HALT_STOP);
        return true;
    }
    default: return false;
    }
}

static struct drive_finger *finger_of(struct drive_controls *c, int64_t pointer)
{
    for (int i = 0; i < c->fingers; i++)
        if (c->finger[i].pointer == pointer)
            return &c->finger[i];
    return NULL;
}

static bool on_down(struct drive_controls *c, const struct window_event *e)
{
    const struct ui_point at = {e->x, e->y};
    enum drive_part part = part_at(c, at);
    struct ui_point stick;
    struct drive_finger *finger = finger_of(c, e->pointer); // its going up was lost
    if (finger)
        *finger = c->finger[--c->fingers];
    if (part == PART_STOP)
        drive_controls_stop(c, HALT_STOP);
    const bool was_part = part != PART_NOTHING;
    if (part == PART_STICK && (drive_controls_stick(c, &stick) || drive_controls_stop_is_held(c)))
        part = PART_SPENT; // another finger holds it; this one does not take it over later
    if (part == PART_STICK)
        c->halt = HALT_NONE;
    if (c->fingers < DRIVE_FINGERS)
        c->finger[c->fingers++] = (struct drive_finger){e->pointer, part, at};
    return was_part;
}

static bool on_move(struct drive_controls *c, const struct window_event *e)
{
    struct drive_finger *finger = finger_of(c, e->pointer);
    if (!finger)
        return false;
    finger->at = (struct ui_point){e->x, e->y};
    if (finger->part == PART_STICK && within(c->box[PART_STOP], finger->at)) {
        drive_controls_stop(c, HALT_STOP);
        return true;
    }
    return finger->part != PART_NOTHING;
}

static bool on_up(struct drive_controls *c, const struct window_event *e, enum drive_part *tapped)
{
    struct drive_finger *finger = finger_of(c, e->pointer);
    if (!finger)
        return false;
    const enum drive_part part = finger->part;
    *finger = c->finger[--c->fingers];
    if (part >= PART_LEAVE && part_at(c, (struct ui_point){e->x, e->y}) == part)
        *tapped = part;
    return part != PART_NOTHING;
}

static bool on_pad(struct drive_controls *c, const struct window_event *e)
{
    if (e->kind == WINDOW_PAD_BUTTON) {
        const bool stops = e->button == PAD_A || e->button == PAD_B || e->button == PAD_BACK || e->button == PAD_START;
        if (stops)
            drive_controls_stop(c, HALT_STOP);
        return stops;
    }
    if (e->axis != PAD_LEFT_X && e->axis != PAD_LEFT_Y)
        return false;
    *(e->axis == PAD_LEFT_X ? &c->pad_turn : &c->pad_speed) = -e->amount;
    if (c->pad_speed == 0 && c->pad_turn == 0)
        c->pad_halted = false;
    else if (drive_controls_stop_is_held(c))
        c->pad_halted = true;
    else if (!c->pad_halted)
        c->halt = HALT_NONE;
    return true;
}

// Fingers whose going up may not be told any more.
static void forget_fingers(struct drive_controls *c, enum drive_halt why)
{
    drive_controls_stop(c, why);
    c->fingers = 0;
}

bool drive_controls_event(struct drive_controls *c, const struct window_event *e, int64_t now_ns,
                          enum drive_part *tapped)
{
    *tapped = PART_NOTHING;
    switch (e->kind) {
    case WINDOW_KEY: return on_key(c, e, now_ns, tapped);
    case WINDOW_KEY_RELEASED:
        if (key_of(e->key) >= 0)
            c->key[key_of(e->key)] = false;
        return key_of(e->key) >= 0;
    case WINDOW_POINTER_DOWN: return on_down(c, e);
    case WINDOW_POINTER_MOVE: return on_move(c, e);
    case WINDOW_POINTER_UP: return on_up(c, e, tapped);
    case WINDOW_PAD_BUTTON:
    case WINDOW_PAD_AXIS: return on_pad(c, e);
    case WINDOW_PAD_GONE:
        drive_controls_stop(c, HALT_PAD_GONE);
        c->pad_speed = c->pad_turn = 0;
        return true;
    case WINDOW_UNFOCUSED: forget_fingers(c, HALT_UNFOCUSED); return true;
    case WINDOW_FOCUSED: c->focused_ns = now_ns; return true;
    case WINDOW_HIDDEN: forget_fingers(c, HALT_HIDDEN); return true;
    default: return false;
    }
}
