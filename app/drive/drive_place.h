// The recorded place in which a robot is driven, over the driver's map: its things with their bodies, names and where
// they are with 95 %, its tags, and the actor as the first take that shows one begins. The robot is looked for there
// while it drives (robot_place.h); until it is found a line says so. Over the surroundings, not hidden by them:
// what is known is seen through walls, too. One thread, the GPU's.
#pragma once
#include "app/place/robot_place.h"
#include "app/viewer/room_things.h"
#include "surround/surroundings.h"

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

// Borrows the place, which is the recording's. As recording_open and take_open; ERR_MEMORY, ERR_DEVICE. On error
// drive_place_close is needed, too.
MUST_CHECK enum status drive_place_open(struct drive_place *p, struct gpu *gpu, const char *file,
                                        const struct place *place);
// Before the surroundings that it was updated with are closed. Zeroed is fine.
void drive_place_close(struct drive_place *place);

// Looks for the robot in its captures, on another thread, and fetches what was found.
void drive_place_update(struct drive_place *place, const struct surroundings *seen);

// view: of the image that is drawn already, in the robot's world; nothing is drawn beside it. ERR_DEVICE, ERR_MEMORY.
MUST_CHECK enum status drive_place_draw(struct drive_place *p, const struct brush *b, const struct figure_view *view);
