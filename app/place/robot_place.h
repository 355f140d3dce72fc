// Where a robot's world is in a recorded place.
#pragma once
#include "capture/recording/place.h"
#include "reenact/surround/picture/surround_picture.h"

// Perspective pictures cut out of the robot's panoramas are localised in the place (locate/locator.h), and those that
// agree are averaged. Both worlds have z up from the floor: it is a turn about the vertical and a shift along the
// floor. The pictures have a pose in the robot's world. NOTHING: fewer than three cuts agree. ERR_INPUT, ERR_MEMORY,
// ERR_SOLVER: as locator_open and locator_localize.
MUST_CHECK enum status robot_place_find(const struct surround_picture *pictures, int count, const struct place *place,
                                        struct pose *place_from_world);
