// What drives the robot: keys, a stick and a STOP on the screen for finger and mouse, a game pad. The robot moves only
// while one of them is held. It stops when that is let go; by STOP, space and Escape; when the window loses the
// keyboard, is hidden or changes its size under a finger; when a pad is unplugged; when the picture stood still for a
// second, or this program so long that its guard stopped the robot (ros_guard.h); and when the link is lost or the
// picture is old. After a stop what is still held has no effect: it is let go and pressed again. STOP wins over all
// else while it is held, and a finger that went down on it never drives, nor does one that went down elsewhere than on
// the stick. Pure: no clock, no window. Lengths in dp, as events are given them.
#pragma once
#include "app/ui/widgets.h"
#include "platform/screen/ui.h"
#include "platform/screen/window.h"
#include "surround/drive/drive_session.h"

// Chosen by hand. The stick and a pad go up to the fastest, a key at a walking robot's pace: it knows no less.
#define DRIVE_FASTEST_M_S   0.5
#define DRIVE_FASTEST_RAD_S 0.8
#define DRIVE_KEY_M_S       0.25
#define DRIVE_KEY_RAD_S     0.6
// A picture that stood still for so long is none to drive by. Longer than a software renderer's slowest picture.
#define DRIVE_GAP_NS 1000000000

// PART_SPENT: of a finger that has no effect any more until it goes up.
enum drive_part { PART_NOTHING, PART_STOP, PART_STICK, PART_LEAVE, PART_VIEWPOINT, PART_MAP, PART_SPENT, DRIVE_PARTS };
enum drive_halt {
    HALT_NONE,
    HALT_STOP,      // by the operator
    HALT_UNFOCUSED, // the window's keys went elsewhere
    HALT_HIDDEN,
    HALT_RESIZED,
    HALT_PAD_GONE,
    HALT_GAP,
    HALT_INTERRUPTED, // the whole program stood still, so that its guard stopped the robot
    HALT_LINK,
    HALT_PICTURE
};
enum { DRIVE_FINGERS = 10 };

struct drive_finger {
    int64_t pointer;
    enum drive_part part; // on which it went down
    struct ui_point at;
};

struct drive_controls {
    struct ui_box box[DRIVE_PARTS]; // where they are; of PART_NOTHING and PART_SPENT empty
    double width, height;           // of the screen
    bool key[4];                    // up, down, left, right: held since the last stop
    struct drive_finger finger[DRIVE_FINGERS];
    int fingers;
    double pad_speed, pad_turn; // -1..1, as the pad's stick stands
    bool pad_halted;            // until it stands in the middle
    enum drive_halt halt;       // why what may be held has no effect; until something is pressed
    int64_t focused_ns, ticked_ns;
};

// Lays the parts out for a screen of that size; on the smallest they are smaller. A change of size stops.
void drive_controls_place(struct drive_controls *controls, double width, double height);

// True: the event was the controls', and nothing else is to be done with it but what *tapped says: PART_LEAVE,
// PART_VIEWPOINT or PART_MAP. Escape (and a tablet's Back) stops a robot that is driven, and leaves else.
bool drive_controls_event(struct drive_controls *controls, const struct window_event *event, int64_t now_ns,
                          enum drive_part *tapped);

// Once before each command is sent, with what is known of the robot.
void drive_controls_tick(struct drive_controls *controls, const struct drive_readings *readings, int64_t now_ns);

// What is to be sent now.
struct drive_command drive_controls_command(const struct drive_controls *controls);

// ---------------------------------------------------------------- drive controls draw

// The controls and the readings over the driver's picture: STOP, the stick, buttons with words, how
// fast the robot is, how far off what is nearest, in the colour of its warning, how old the picture is, and why it
// stands.

void drive_controls_draw(const struct drive_controls *controls, const struct drive_readings *readings,
                         enum viewpoint viewpoint, bool map, const struct brush *brush);
