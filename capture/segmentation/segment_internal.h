// What the files of the segmenter share.
#pragma once
#include "capture/segmentation/segment.h"
#include "capture/segmentation/floor_plane.h"

enum {
    COLUMNS_MAX = 320,
    JUMPS = 10001,        // depths whose jump and noise are looked up, mm
    SETTLED_FRAMES = 3,   // a background value is believed after so many sightings
    REPLACED_FRAMES = 24, // something nearer that stays this long becomes background
};

struct segmenter {
    struct lens lens;
    int step, width, height; // grid: pixels a cell, cells
    struct grid_ray *ray;    // per cell: the ray's x/z, y/z
    uint16_t jump_mm[JUMPS]; // by depth: how far two neighbouring readings of one surface may differ
    uint16_t same_mm[JUMPS]; // by depth: how far two readings of one cell's surface may differ
    int slope_16;            // jump_mm[d] is at least d * slope_16 / 65536
    uint16_t *depth;         // per cell, mm, flying pixels removed
    int32_t *label;          // per cell: component, -1 none
    int32_t *parent;         // union-find
    int32_t *candidate;      // the cells that may be the person, in the picture's order
    int candidate_count;
    uint16_t *background; // per cell, learned; 0 unknown
    uint8_t *sightings, *nearer;
    uint16_t *given;               // per cell, given; 0 unknown
    uint16_t *fixed;               // per cell: the furthest depth in front of the floor and of what is given, mm
    uint16_t *limit;               // the same, and in front of what was learned: up to there it may be the person
    uint16_t *front;               // by a surface's depth, mm: the furthest reading that is in front of it for certain
    uint8_t *person, *before;      // per cell
    float *own;                    // per cell: the person's own depth there, mm, evened out
    uint8_t *own_sightings;        // how often it was about that, in a row
    int32_t *own_watched, watched; // when that was last looked at, and how often all were
    int motionless;                // so many pictures in a row nothing of them moved
    struct component *components;
    int component_count, component_room;
    bool have_floor, floor_given, follows;
    struct vec3 up;
    double height_m;
    int floor_tries;
    struct picture_bounds picture; // of this frame
};

struct component {
    int cells;
    double area_m2;
    double top, bottom;     // along up, metres (over the floor when known)
    double low[3], high[3]; // bounds: across, depth (horizontal), and picture depth
    double sum[3];          // of the points
    int border_left, border_right, border_bottom, border_top;
    int overlap;      // cells that were the person's before
    int close;        // cells close to the predicted body
    int touching;     // cells beside what is the person's already
    bool mine;        // it is the person, or a part of them
    double top_width; // how wide it is within 0.2 m of its top
};

static inline int by_depth(const uint16_t table[JUMPS], int depth_mm)
{
    return table[depth_mm < JUMPS ? depth_mm : JUMPS - 1];
}

// Where a cell's background changed: up to where it may be the person.
static inline void segmenter_limit(struct segmenter *s, int i)
{
    int front = s->sightings[i] >= SETTLED_FRAMES ? s->front[s->background[i]] : UINT16_MAX;
    s->limit[i] = (uint16_t)(front < s->fixed[i] ? front : s->fixed[i]);
}

// In front of everything that is known not to be the person.
static inline bool may_be_person(const struct segmenter *s, int i, int depth_mm) { return depth_mm <= s->limit[i]; }

// From the person's cells to every pixel; mask is all 0 before.
void segmenter_refine(const struct segmenter *s, const uint16_t *picture, uint8_t *mask);

// One picture more of the person's own cells: has anything of them moved?
void segmenter_watch(struct segmenter *s);
