// What hands do, in what the app understands: keys and the game pad become actions,
// fingers and mouse a pointer for the controls and gestures for the picture. Pure.
#pragma once
#include "app/state/view_state.h"
#include "platform/window.h"

struct hands {
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
bool hands_hear(struct hands *h, struct show *show, const struct screen_event *event, double px_per_dp, int64_t now_ns);

// A frame was drawn with the pointer as it is.
void hands_drawn(struct hands *h);

// Sticks held for `passed_s`. True: they move something.
bool hands_pad(const struct hands *h, struct show *show, double passed_s, int64_t now_ns);

enum show_action hands_key(int key, bool shift);
enum show_action hands_button(enum screen_button button);
