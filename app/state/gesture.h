// Fingers on the picture, told apart: one drags, two spread, twist and push, a
// short touch taps. Pure. Any unit of length; what comes out is in the same.
#pragma once
#include "base/status.h"

enum { GESTURE_FINGERS = 5 };

struct gesture {
    int count;
    struct {
        int64_t id;
        double x, y;
    } fingers[GESTURE_FINGERS];
    double travelled; // by the first finger since it went down
    int64_t down_ns;
    bool several; // more than one finger took part since the first went down
    // Gathered since gesture_take.
    double drag_x, drag_y; // of one finger
    double push_x, push_y; // of the middle of two
    double spread;         // ratio of distances; 1: none
    double twist;          // radians, clockwise as seen
    bool tapped;
};

// A tap travels no farther than `slack` and takes no longer than a third of a second.
void gesture_down(struct gesture *g, int64_t id, double x, double y, int64_t now_ns);
void gesture_move(struct gesture *g, int64_t id, double x, double y);
void gesture_up(struct gesture *g, int64_t id, double slack, int64_t now_ns);

// What was gathered, which begins anew.
struct gesture gesture_take(struct gesture *g);
