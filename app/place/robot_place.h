// Where a robot's world is in a recorded place.
//
// Perspective pictures cut out of the robot's panoramas are localised in the place (locate/locator.h), and those that
// agree are averaged. Both worlds have z up from the floor: it is a turn about the vertical and a shift along the
// floor. The pictures have a pose in the robot's world. One thread at a time, any thread.
#pragma once
#include "recording/place.h"
#include "surround/picture/surround_picture.h"

struct robot_place;

// Borrows the place. ERR_MEMORY; *out is then NULL.
MUST_CHECK enum status robot_place_open(struct robot_place **out, const struct place *place);
void robot_place_close(struct robot_place **r); // NULL is fine
// Localises what one picture shows: of a panorama six cuts, some tenths of a second. Of the newest two dozen panoramas
// is kept where they are. ERR_INPUT, ERR_MEMORY, ERR_SOLVER: as locator_open and locator_localize.
MUST_CHECK enum status robot_place_look(struct robot_place *r, const struct surround_picture *picture);
// From all pictures looked at. NOTHING: fewer than three cuts agree; *place_from_world is then untouched.
MUST_CHECK enum status robot_place_settle(const struct robot_place *r, struct pose *place_from_world);

// The same of a whole drive, evenly over its pictures. Errors as robot_place_look, NOTHING as robot_place_settle.
MUST_CHECK enum status robot_place_find(const struct surround_picture *pictures, int count, const struct place *place,
                                        struct pose *place_from_world);
