// The tablet's glass: a window or the whole screen with an OpenGL ES 3 context on
// it, and everything hands can do to it (SDL2). The same on KMS without a desktop,
// on Wayland and on X11. One screen in a process, on the thread that opened it;
// only screen_wake may be called from others.
//
// Lengths are pixels of the picture as the eye has it up: a screen that is mounted
// turned (quarter_turns) is turned here, fingers included. gpu_adopt takes the
// context over for drawing.
#pragma once
#include "base/status.h"

struct screen;

struct screen_options {
    const char *title;
    int width, height; // of a window; on KMS and in fullscreen the glass says
    bool fullscreen;
    int quarter_turns; // 0..3, clockwise: how the glass is mounted
    double dpi;        // 0: ask the system
};

// ERR_DEVICE: no display, or none with OpenGL ES 3; the sentence says which.
MUST_CHECK enum status screen_open(struct screen **out, const struct screen_options *options);
void screen_close(struct screen **s); // NULL is fine

void screen_size(const struct screen *s, int *width, int *height);
double screen_dpi(const struct screen *s);        // pixels an inch; 96 where nobody knows
double screen_refresh_hz(const struct screen *s); // 60 where nobody knows
int screen_quarter_turns(const struct screen *s);
const char *screen_driver(const struct screen *s); // "KMSDRM", "wayland", "x11"

// Shows what was drawn; waits for the display's turn.
void screen_show(struct screen *s);

void screen_fullscreen(struct screen *s, bool on);

enum screen_event_kind {
    SCREEN_NOTHING,      // nothing happened
    SCREEN_WOKEN,        // screen_wake
    SCREEN_QUIT,         // closed
    SCREEN_RESIZED,      // size or dpi are others; or what was shown is lost and has to be drawn again
    SCREEN_HIDDEN,       // nobody sees it: draw nothing, let the camera rest
    SCREEN_SHOWN,        // it is seen again
    SCREEN_POINTER_DOWN, // finger or mouse button
    SCREEN_POINTER_MOVE, // also the mouse with no button down
    SCREEN_POINTER_UP,
    SCREEN_WHEEL,      // amount: notches, away from the hand is positive
    SCREEN_KEY,        // key
    SCREEN_PAD_BUTTON, // button, pressed
    SCREEN_PAD_AXIS,   // axis at amount, -1..1; triggers 0..1
};

// Keys that write nothing; others are their lower-case Latin letter.
enum screen_key {
    SCREEN_KEY_ENTER = 13,
    SCREEN_KEY_ESCAPE = 27,
    SCREEN_KEY_SPACE = 32,
    SCREEN_KEY_LEFT = 256,
    SCREEN_KEY_RIGHT,
    SCREEN_KEY_UP,
    SCREEN_KEY_DOWN,
    SCREEN_KEY_HOME,
    SCREEN_KEY_END,
    SCREEN_KEY_F11,
    SCREEN_KEY_BACK,
};

enum screen_button {
    PAD_A,
    PAD_B,
    PAD_X,
    PAD_Y,
    PAD_BACK,
    PAD_START,
    PAD_LEFT_SHOULDER,
    PAD_RIGHT_SHOULDER,
    PAD_UP,
    PAD_DOWN,
    PAD_LEFT,
    PAD_RIGHT,
    PAD_BUTTONS
};
enum screen_axis { PAD_LEFT_X, PAD_LEFT_Y, PAD_RIGHT_X, PAD_RIGHT_Y, PAD_LEFT_TRIGGER, PAD_RIGHT_TRIGGER, PAD_AXES };

struct screen_event {
    enum screen_event_kind kind;
    int64_t pointer; // fingers are told apart; the mouse is -1
    double x, y;     // pixels
    int key;         // enum screen_key or a letter
    bool shift;
    enum screen_button button;
    enum screen_axis axis;
    double amount;
};

// The next thing that happened; waits up to wait_ms for one, 0 not at all.
struct screen_event screen_wait(struct screen *s, int wait_ms);

// Makes screen_wait return; from any thread, until screen_close.
void screen_wake(struct screen *s);
