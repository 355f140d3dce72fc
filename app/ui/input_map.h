// What hands do, in what the app understands: keys and the game pad become actions,
// fingers and mouse a pointer for the controls and gestures for the picture. Pure.
#pragma once
#include "app/state/view_state.h"
#include "platform/window.h"

struct input_map {
    double pointer_x, pointer_y; // dp
    bool pointer_down, pointer_there;
    int64_t pointer;        // which finger it is; valid while pointer_down
    bool leaving;           // a finger was lifted: the pointer goes with the next frame
    struct gesture gesture; // dp
    double wheel;
    double pad[PAD_AXES];
};

// px_per_dp: of the screen. True: a control may have been pressed or let go, which
// has to be drawn before the next event is heard.
bool input_map_event(struct input_map *h, struct view_state *show, const struct window_event *event, double px_per_dp,
                     int64_t now_ns);

// A frame was drawn with the pointer as it is.
void input_map_frame_done(struct input_map *h);

// Sticks held for `passed_s`. True: they move something.
bool input_map_pad(const struct input_map *h, struct view_state *show, double passed_s, int64_t now_ns);

enum view_action input_map_key(int key, bool shift);
enum view_action input_map_button(enum pad_button button);
