// Maps window events to the app's input: keys and the game pad become actions; fingers and the mouse become a pointer
// for the controls and gestures for the image. Pure.
#pragma once
#include "app/state/view_state.h"
#include "platform/screen/window.h"

struct input_map {
    double pointer_x, pointer_y; // dp
    bool pointer_down, pointer_there;
    int64_t pointer;        // id of the finger that is the pointer; valid while pointer_down
    bool leaving;           // a finger was lifted: the pointer disappears after the next frame
    struct gesture gesture; // dp
    double wheel;
    double pad[PAD_AXES];
    bool shows;     // a frame has been drawn,
    int shown_page; // of this page
};

// px_per_dp: of the screen. True: a control may have been pressed or released; draw a frame before passing the next
// event.
bool input_map_event(struct input_map *map, struct view_state *state, const struct window_event *event,
                     double px_per_dp, int64_t now_ns);

// Presses, touches and text are meant for the page that is seen: false before the first frame, and once another page is
// to be drawn. Where that was dropped, what it began is forgotten (input_map_forget).
bool input_map_is_meant(const struct input_map *map, int page, const struct window_event *event);
// Fingers and the mouse's button count as lifted, until they are pressed again.
void input_map_forget(struct input_map *map);

// A frame of this page was drawn with the current pointer.
void input_map_frame_done(struct input_map *map, int page);

// Applies sticks and triggers for `passed_s`, seconds. True: something moves.
bool input_map_pad(const struct input_map *map, struct view_state *state, double passed_s, int64_t now_ns);

enum view_action input_map_key(int key, bool shift);
enum view_action input_map_button(enum pad_button button);
