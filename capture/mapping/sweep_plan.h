// The plan of a room, from above, while it is swept and afterwards: what of it was seen, where its tags and landmarks
// are, where the sensor is, and what to do next. Plain data, 35 KiB: copied for the drawing thread. Pure.
//
// World axes: z up from the floor, metres. While a sweep adds to no place, they are the sweep's own, not yet those that
// mapper_finish chooses.
#pragma once
#include "recording/place.h"

enum { SWEEP_CELLS = 96, SWEEP_TAGS = 64, SWEEP_TRAIL = 256, SWEEP_BARE = 8 };
#define SWEEP_CELL_M 0.125 // the plan is 12 m wide, about its middle

struct sweep_cell {
    uint8_t floor, solid; // depth samples of it, at most 255: lower than 0.25 m; higher, up to 2.2 m
    uint8_t points;       // landmarks, at most 255
    bool tag;
};

struct sweep_tag {
    int32_t id;
    bool seen, placed; // placed: x and y are known
    double x, y;
    double sigma_m; // of its position in the finished map; 0: not known
};

// What to do next, worst first.
enum sweep_hint {
    SWEEP_LOOKING,    // nothing is known yet: show it something with texture, or a tag
    SWEEP_SLOWER,     // the picture is blurred, or the next one too different
    SWEEP_LOST,       // where the sensor is was lost: back to what was seen
    SWEEP_TOGETHER,   // two tags were never connected
    SWEEP_MISSING,    // a tag was not seen yet
    SWEEP_BARE_PLACE, // a place where nothing can be recognised
    SWEEP_ENOUGH,
    SWEEP_HINTS
};

struct sweep_plan {
    double middle_x, middle_y;                        // world position of the plan's middle
    struct sweep_cell cell[SWEEP_CELLS][SWEEP_CELLS]; // [row, from low to high y][column]
    struct sweep_tag tag[SWEEP_TAGS];
    int tag_count, tags_seen;
    float trail[SWEEP_TRAIL][2]; // where the sensor has been, oldest first; thinned out when full
    int trail_count;
    bool located;             // x, y and heading are known now
    double x, y, heading_rad; // of the sensor; heading about z, from x
    int frames, frames_located;
    struct {
        double x, y;
    } bare[SWEEP_BARE]; // middles of places, a metre wide, with surfaces and nothing to recognise
    int bare_count;
    enum sweep_hint hint;
    char text[160]; // the hint as a sentence
};

void sweep_plan_start(struct sweep_plan *plan, double middle_x, double middle_y);

// NULL: outside of the plan.
struct sweep_cell *sweep_plan_cell(struct sweep_plan *plan, double x, double y);

// Depth samples of one image, every sixteenth pixel each way.
void sweep_plan_add_depth(struct sweep_plan *plan, const struct lens *lens, const uint16_t *depth,
                          struct pose world_from_camera);
void sweep_plan_add_landmark(struct sweep_plan *plan, struct vec3 world);
void sweep_plan_set_tag(struct sweep_plan *plan, int32_t id, bool seen, const struct vec3 *world, double sigma_m);

// Where the sensor is now; NULL: not known.
void sweep_plan_move(struct sweep_plan *plan, const struct pose *world_from_camera);

// Looks for bare places again.
void sweep_plan_find_bare(struct sweep_plan *plan);

// The plan of a finished place: its views' depth, landmarks and tags.
void sweep_plan_of_place(const struct place *place, struct sweep_plan *out);

// Share of the cells with surfaces that have a landmark or a tag within half a metre, 0..1: there a camera finds its
// way.
double sweep_plan_recognisable(const struct sweep_plan *plan);
