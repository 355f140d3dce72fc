// A window or the whole screen with an OpenGL ES 3 context, and its input: touch, mouse, keyboard, game pads (SDL2).
// The same on KMS without a desktop, on Wayland and on X11. One window in a process, on the thread that opened it; only
// window_wake may be called from other threads. gpu_adopt takes the context over for drawing.
//
// Where the X server ends, the program does: by exit(1) in Xlib, or a second later, whatever it is at, by _exit(1).
//
// Lengths are pixels of the upright image, from its top left corner: for a display that is mounted rotated
// (quarter_turns), sizes and pointer positions are rotated here.
#pragma once
#include "base/status.h"

struct window;

struct window_options {
    const char *title;
    int width, height; // of a window; ignored on KMS and in fullscreen
    bool fullscreen;
    int quarter_turns; // 0..3, clockwise: how the display is mounted
    double dpi;        // 0: ask the system
};

// ERR_DEVICE: no display, or none with OpenGL ES 3; the sentence says which. ERR_MEMORY. *out is then NULL.
MUST_CHECK enum status window_open(struct window **out, const struct window_options *options);
void window_close(struct window **s); // NULL is fine

void window_size(const struct window *window, int *width, int *height);
double window_dpi(const struct window *window);        // pixels an inch; 96 where the system does not know
double window_refresh_hz(const struct window *window); // 60 where the system does not know
int window_quarter_turns(const struct window *window);
const char *window_driver(const struct window *window); // "KMSDRM", "wayland", "x11"

// Swaps buffers: shows what was drawn; waits for vertical sync where the driver supports it.
void window_present(struct window *window);

void window_fullscreen(struct window *window, bool on);

enum window_event_kind {
    WINDOW_NO_EVENT,     // no event
    WINDOW_WOKEN,        // window_wake
    WINDOW_QUIT,         // closed
    WINDOW_RESIZED,      // size or dpi changed, or the contents were lost: draw again
    WINDOW_HIDDEN,       // not visible: draw nothing, suspend the camera
    WINDOW_SHOWN,        // visible again
    WINDOW_POINTER_DOWN, // finger or mouse button
    WINDOW_POINTER_MOVE, // also the mouse with no button down
    WINDOW_POINTER_UP,
    WINDOW_WHEEL,        // amount: notches, away from the user is positive
    WINDOW_KEY,          // key; again while it is held, with repeat
    WINDOW_KEY_RELEASED, // key; not of one that was pressed before the window was focused
    WINDOW_TEXT,         // text, as typed, between window_type's on and off; the keys that made it come as well
    WINDOW_PAD_BUTTON,   // button, pressed
    WINDOW_PAD_AXIS,     // axis at amount, -1..1; triggers 0..1
    WINDOW_PAD_GONE,     // unplugged
    WINDOW_UNFOCUSED,    // keys go elsewhere, also to who locks the screen: what was held is held no more
    WINDOW_FOCUSED,      // keys come here; such as are down already may come as pressed at once
    WINDOW_DROPPED,      // a file was dragged here: window_dropped_file
};

// Keys without a printable character, and space; other keys are their lower-case ASCII character.
enum window_key {
    WINDOW_KEY_BACKSPACE = 8,
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
    int64_t pointer; // a finger's number, constant while it is down; the mouse is -1
    double x, y;     // pixels
    int key;         // enum window_key or a letter
    char text[32];   // UTF-8
    bool shift, repeat;
    enum pad_button button;
    enum pad_axis axis;
    double amount;
};

// The next event; waits up to wait_ms for one, 0: does not wait.
struct window_event window_wait(struct window *window, int wait_ms);

// The file that was dropped last, until the next one is waited for; "": none.
const char *window_dropped_file(const struct window *window);

// Forgets the presses, touches and text that have come and were not yet waited for: whoever made them saw an older
// picture. Keys that were released, motion and what the desktop says of the window stay.
void window_drop_input(struct window *window);

// A sentence in a small window of the desktop's own, until it is closed; nothing where that cannot be. Needs no window.
void window_say(const char *title, const char *sentence);

// Whether text is typed: capitals, accents and what input methods compose come as WINDOW_TEXT, and a tablet shows its
// keyboard. Off at first; costs nothing where nothing changes.
void window_type(struct window *window, bool on);

// Makes window_wait return; from any thread, until window_close.
void window_wake(struct window *window);
