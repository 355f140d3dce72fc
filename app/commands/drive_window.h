// reenact drive's window: the controls of app/drive/drive_controls.h; a finger beside them turns the viewpoint, the
// wheel brings it nearer; 1, 2, 3 (pad: X) choose first person, third person and from above; M (pad: Y) shows the map,
// the same surroundings with the path driven from a viewpoint of its own, beside the picture, and what is known of a
// recorded place in which the robot is (app/drive/drive_screen.h); with a camera the tablet's own way turns and moves
// the picture's viewpoint, and C centres that. Main thread: while it does not run, nothing is sent, and a robot with a
// watchdog stops.
#pragma once
#include "recording/place.h"
#include "surround/drive/drive_session.h"

struct drive_window_options {
    double seconds;            // leave after this time; 0: when the window is closed
    const char *camera;        // URI of the tablet's camera, the head tracker; NULL: none
    const char *file;          // a recording in whose place the robot and the tablet are; NULL: none
    const struct place *place; // that place; borrowed; with file
    bool map;                  // shown from the start
    bool fullscreen;
    int size[2]; // of the window, pixels
    double dpi;  // 0: the screen's own
};

// ERR_DEVICE: no screen.
MUST_CHECK enum status drive_window_run(struct drive_session *session, const struct drive_window_options *how);
