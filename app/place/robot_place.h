// Where a robot's world is in a recorded place.
//
// Perspective pictures cut out of the robot's panoramas are localised in the place (locate/locator.h), and those that
// agree are averaged. Both worlds have z up from the floor: it is a turn about the vertical and a shift along the
// floor. The pictures have a pose in the robot's world. One thread at a time, any thread.
#pragma once
#include "recording/place.h"
#include "surround/picture/surround_picture.h"

struct robot_place;

// The same of a whole drive, evenly over its pictures. Errors as robot_place_look, NOTHING as robot_place_settle.
MUST_CHECK enum status robot_place_find(const struct surround_picture *pictures, int count, const struct place *place,
                                        struct pose *place_from_world);

// ---------------------------------------------------------------- robot place finder

// Looks for a robot in a recorded place while it drives, on a thread of its own with lower priority.
// Until it is found, the newest capture is looked at whenever the thread is free; then one of several, so that what is
// known gets better, at little cost. One thread calls; nothing waits for it.

enum robot_place_state {
    ROBOT_PLACE_WAITING,    // no capture has been looked at yet
    ROBOT_PLACE_TOO_LITTLE, // those that were show too little of the place
    ROBOT_PLACE_FOUND,      // from then on
    ROBOT_PLACE_FAILED,     // and is not looked for any more
};

struct robot_place_finder;

// Borrows the place. ERR_MEMORY, also: no thread; *out is then NULL.
MUST_CHECK enum status robot_place_finder_start(struct robot_place_finder **out, const struct place *place);
// NULL is fine; waits for the capture in work. Call it before the pictures are freed.
void robot_place_finder_close(struct robot_place_finder **f);

struct robot_place_answer {
    enum robot_place_state state;
    struct pose place_from_world; // FOUND
    int looked;                   // captures so far
    char trouble[256];            // FAILED: why
};
// Offers the captures taken so far, and says what is known by now. The pictures' colours are borrowed until the finder
// is closed, the rest is copied.
void robot_place_finder_update(struct robot_place_finder *finder, const struct surround_picture *pictures, int count,
                               struct robot_place_answer *out);
