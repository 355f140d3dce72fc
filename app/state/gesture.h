// Recognises touch gestures on the image: one finger drags, two spread, twist and push, a short touch taps.
// Lengths are in any one unit, in and out. y runs down. Pure.
#pragma once
#include "base/status.h"

enum { GESTURE_FINGERS = 5 };

struct gesture {
    int count;
    struct {
        int64_t id;
        double x, y;
    } fingers[GESTURE_FINGERS];
    double travelled; // path length of the first finger since it went down
    int64_t down_ns;
    bool several; // more than one finger took part since the first went down
    // Accumulated since the last gesture_take:
    double drag_x, drag_y; // of a single finger
    double push_x, push_y; // of the midpoint of two fingers
    double spread;         // ratio of the fingers' distances; 1: unchanged
    double twist;          // radians, clockwise as seen
    bool tapped;
};

// A tap travels no farther than `slack` and takes no longer than a third of a second.
void gesture_down(struct gesture *g, int64_t id, double x, double y, int64_t now_ns);
void gesture_move(struct gesture *g, int64_t id, double x, double y);
void gesture_up(struct gesture *g, int64_t id, double slack, int64_t now_ns);

// Returns what has accumulated, and resets it.
struct gesture gesture_take(struct gesture *g);
