#include "app/drive/drive_controls.h"

#include "app/ui/widgets.h"

#include <string.h>

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

bool drive_controls_stop_is_held(const struct drive_controls *c)
{
    for (int i = 0; i < c->fingers; i++)
        if (c->finger[i].part == PART_STOP)
            return true;
    return false;
}

static double bounded(double x) { return fmax(-1, fmin(1, x)); }

bool drive_controls_stick(const struct drive_controls *c, struct ui_point *stands)
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

void drive_controls_stop(struct drive_controls *c, enum drive_halt why)
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

const char *drive_halt_sentence(enum drive_halt why)
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
