// The tablet's glass: a window or the whole screen with an OpenGL ES 3 context on
// it, and everything hands can do to it (SDL2). The same on KMS without a desktop,
// on Wayland and on X11. One screen in a process, on the thread that opened it;
// only window_wake may be called from others.
//
// Lengths are pixels of the picture as the eye has it up: a screen that is mounted
// turned (quarter_turns) is turned here, fingers included. gpu_adopt takes the
// context over for drawing.
#pragma once
#include "base/status.h"

struct window;

struct window_options {
    const char *title;
    int width, height; // of a window; on KMS and in fullscreen the glass says
    bool fullscreen;
    int quarter_turns; // 0..3, clockwise: how the glass is mounted
    double dpi;        // 0: ask the system
};

// ERR_DEVICE: no display, or none with OpenGL ES 3; the sentence says which.
MUST_CHECK enum status window_open(struct window **out, const struct window_options *options);
void window_close(struct window **s); // NULL is fine

void window_size(const struct window *s, int *width, int *height);
double window_dpi(const struct window *s);        // pixels an inch; 96 where nobody knows
double window_refresh_hz(const struct window *s); // 60 where nobody knows
int window_quarter_turns(const struct window *s);
const char *window_driver(const struct window *s); // "KMSDRM", "wayland", "x11"

// Shows what was drawn; waits for the display's turn.
void window_present(struct window *s);

void window_fullscreen(struct window *s, bool on);

enum window_event_kind {
    WINDOW_NO_EVENT,     // nothing happened
    WINDOW_WOKEN,        // window_wake
    WINDOW_QUIT,         // closed
    WINDOW_RESIZED,      // size or dpi are others; or what was shown is lost and has to be drawn again
    WINDOW_HIDDEN,       // nobody sees it: draw nothing, let the camera rest
    WINDOW_SHOWN,        // it is seen again
    WINDOW_POINTER_DOWN, // finger or mouse button
    WINDOW_POINTER_MOVE, // also the mouse with no button down
    WINDOW_POINTER_UP,
    WINDOW_WHEEL,      // amount: notches, away from the hand is positive
    WINDOW_KEY,        // key
    WINDOW_PAD_BUTTON, // button, pressed
    WINDOW_PAD_AXIS,   // axis at amount, -1..1; triggers 0..1
};

// Keys that write nothing; others are their lower-case Latin letter.
enum window_key {
    WINDOW_KEY_ENTER = 13,
    WINDOW_KEY_ESCAPE = 27,
    WINDOW_KEY_SPACE = 32,
    WINDOW_KEY_LEFT = 256,
    WINDOW_KEY_RIGHT,
    WINDOW_KEY_UP,
    WINDOW_KEY_DOWN,
    WINDOW_KEY_HOME,
    WINDOW_KEY_END,
    WINDOW_KEY_F11,
    WINDOW_KEY_BACK,
};

enum pad_button {
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
enum pad_axis { PAD_LEFT_X, PAD_LEFT_Y, PAD_RIGHT_X, PAD_RIGHT_Y, PAD_LEFT_TRIGGER, PAD_RIGHT_TRIGGER, PAD_AXES };

struct window_event {
    enum window_event_kind kind;
    int64_t pointer; // fingers are told apart; the mouse is -1
    double x, y;     // pixels
    int key;         // enum window_key or a letter
    bool shift;
    enum pad_button button;
    enum pad_axis axis;
    double amount;
};

// The next thing that happened; waits up to wait_ms for one, 0 not at all.
struct window_event window_wait(struct window *s, int wait_ms);

// Makes window_wait return; from any thread, until window_close.
void window_wake(struct window *s);
