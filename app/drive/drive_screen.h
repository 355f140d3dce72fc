// What a robot's driver sees: the picture and, beside it or, where the screen is upright, below it, the map: the same
// surroundings from a viewpoint of its own, and over them the recorded place in which the robot is driven, where one is
// given. All of it but the window, so that it is drawn the same on a screen and, in tests, into memory. One thread, the
// GPU's.
#pragma once
#include "app/drive/drive_controls.h"
#include "app/place/robot_place.h"
#include "app/viewer/room_things.h"
#include "app/viewer/viewer.h"
#include "surround/gpu/operator_picture.h"
#include "surround/surroundings.h"

// ---------------------------------------------------------------- the recorded place

// The recorded place in which a robot is driven, over the driver's map: its things with their bodies, names and where
// they are with 95 %, its tags, and the actor as the first take that shows one begins. The robot is looked for there
// while it drives (robot_place.h); until it is found a line says so. Over the surroundings, not hidden by them:
// what is known is seen through walls, too. One thread, the GPU's.

struct drive_place {
    const struct place *place;
    char name[128]; // of the file, without its folder
    struct gpu *gpu;
    struct room_things things;
    struct skeleton actor; // the place's world
    bool has_actor;
    struct solid_renderer *renderer;
    struct gpu_target *bodies;
    int bodies_width, bodies_height;
    struct robot_place_finder *finder;
    struct robot_place_answer answer; // at the last update
    struct room_state state;
    struct room_ui ui;
};

// Looks for the robot in its captures, on another thread, and fetches what was found.
void drive_place_update(struct drive_place *place, const struct surroundings *seen);

// ---------------------------------------------------------------- the screen

enum { DRIVE_PICTURE, DRIVE_MAP, DRIVE_PANES };

struct drive_pane {
    struct operator_picture *picture; // NULL: not opened yet, or the processor draws
    struct gpu_texture *texture;      // the processor's picture
    const struct gpu_texture *shown;  // either's; NULL: none yet
    struct lens lens;                 // of what is shown
    struct pose world_from_view;      // likewise; the robot's world
};

struct drive_screen {
    struct drive_session *session;
    struct gpu *gpu;
    struct ui *ui;
    struct drive_pane pane[DRIVE_PANES];
    bool by_card;                          // false: the graphics card cannot; the processor draws
    bool map;                              // is shown
    struct drive_eye map_eye;              // from where
    const struct drive_controls *controls; // drawn over it, with the readings; NULL: none; borrowed
    bool has_place;
    struct drive_place place;
};

// Borrows the session. file: the recording in whose place the robot is driven; NULL: none; place: that place, borrowed.
// ERR_DEVICE, ERR_MEMORY; as recording_open and take_open. On error drive_screen_close is needed, too.
MUST_CHECK enum status drive_screen_open(struct drive_screen *screen, struct gpu *gpu, struct drive_session *session,
                                         const char *file, const struct place *place);
void drive_screen_close(struct drive_screen *screen); // zeroed is fine; before the session is closed

// The pane's part of a screen of that size, in the size's unit.
struct ui_box drive_screen_box(const struct drive_screen *screen, double width, double height, int pane);
// From where that pane is seen; may be changed.
struct drive_eye *drive_screen_eye(struct drive_screen *screen, int pane);

// Draws the session as it is now. ERR_DEVICE, ERR_MEMORY, and as drive_session_draw.
MUST_CHECK enum status drive_screen_draw(struct drive_screen *screen, const struct viewer_surface *surface,
                                         int64_t now_ns);
