// An X server in memory (Xvfb), for tests of the real programs: what is on its screen, and a keyboard and a pointer by
// the XTEST extension. One in a process. Errors fail the test.
#pragma once
#include "base/status.h"

#include <sys/types.h>

struct display {
    int width, height;
    uint8_t *rgb; // as display_read found it last
    char frame_buffer[300];
    pid_t server; // 0: not running
    struct xcb_connection_t *connection;
};

// Starts a server on a number of its own, sets DISPLAY, and waits until its screen can be read. `folder`: for its frame
// buffer; must exist. False: it does not start.
bool display_open(struct display *d, const char *folder, int width, int height);
void display_close(struct display *d); // zeroed is fine

// Reads the screen. False: not now.
bool display_read(struct display *d);
// Of what was read last: pixels of a colour, 0xrrggbb, in a box, each channel nearer than 6; and the number of
// different colours, of 16 steps a channel, which tells an image from a plain background.
int display_count(const struct display *d, uint32_t color, int left, int top, int right, int bottom);
int display_colors(const struct display *d, int left, int top, int right, int bottom);

// A key, or a click of the left button, pressed and let go. The pointer then rests at the screen's upper edge, where it
// changes no button; the window below it has the keyboard.
void display_key(struct display *d, uint32_t keysym);
void display_click(struct display *d, int x, int y);
// The same, but held until it is let go: the key, or the button at a place.
void display_hold_key(struct display *d, uint32_t keysym, bool down);
void display_hold_button(struct display *d, int x, int y, bool down);
// The keyboard is the topmost window's, or nobody's; or it is grabbed, as by a program that locks the screen; or that
// window is taken from the screen.
void display_focus(struct display *d, bool window);
void display_grab_keyboard(struct display *d, bool grabbed);
void display_show_window(struct display *d, bool shown);
// Asks the topmost window to close, as a window manager does (WM_DELETE_WINDOW).
void display_close_window(struct display *d);
