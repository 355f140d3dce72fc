// What the files of the segmenter share.
#pragma once
#include "capture/segmentation/segment.h"
#include "capture/segmentation/floor_plane.h"

enum {
    COLUMNS_MAX = 320,
    DEPTH_TABLE_SIZE = 10001, // depths whose jump and noise are looked up, mm
    CONFIRMED_FRAMES = 3,     // a background value is believed after so many sightings
    REPLACEMENT_FRAMES = 24,  // something nearer that stays this long becomes background
};

struct segmenter {
    struct lens lens;
    int step, width, height;                // grid: pixels a cell, cells
    struct grid_ray *ray;                   // per cell: the ray's x/z, y/z
    uint16_t max_step_mm[DEPTH_TABLE_SIZE]; // by depth: how far two neighbouring readings of one surface may differ
    uint16_t noise_mm[DEPTH_TABLE_SIZE];    // by depth: how far two readings of one cell's surface may differ
    int step_slope_16;                      // max_step_mm[d] is at least d * step_slope_16 / 65536
    uint16_t *depth;                        // per cell, mm, flying pixels removed
    int32_t *label;                         // per cell: component, -1 none
    int32_t *parent;                        // union-find
    int32_t *candidate;                     // the cells that may be the person, in the picture's order
    int candidate_count;
    uint16_t *background; // per cell, learned; 0 unknown
    uint8_t *observed_count, *nearer_count;
    uint16_t *known_background; // per cell, given; 0 unknown
    uint16_t *static_limit;     // per cell: the furthest depth in front of the floor and of what is given, mm
    uint16_t *depth_limit;      // the same, and in front of what was learned: up to there it may be the person
    uint16_t *front_limit;      // by a surface's depth, mm: the furthest reading that is in front of it for certain
    uint8_t *person, *previous; // per cell
    float *mean_depth;          // per cell: the person's own depth there, mm, evened out
    uint8_t *mean_count;        // how often it was about that, in a row
    int32_t *mean_updated, update_count; // when that was last looked at, and how often all were
    int static_frames;                   // so many pictures in a row nothing of them moved
    struct component *components;
    int component_count, component_capacity;
    bool have_floor, floor_given, following;
    struct vec3 up;
    double height_m;
    int floor_tries;
    struct image_bounds bounds; // of this frame
};

struct component {
    int cells;
    double area_m2;
    double top, bottom;     // along up, metres (over the floor when known)
    double low[3], high[3]; // bounds: across, depth (horizontal), and picture depth
    double sum[3];          // of the points
    int border_left, border_right, border_bottom, border_top;
    int overlap;      // cells that were the person's before
    int near_body;    // cells close to the predicted body
    int adjacent;     // cells beside what is the person's already
    bool is_person;   // it is the person, or a part of them
    double top_width; // how wide it is within 0.2 m of its top
};

static inline int by_depth(const uint16_t table[DEPTH_TABLE_SIZE], int depth_mm)
{
    return table[depth_mm < DEPTH_TABLE_SIZE ? depth_mm : DEPTH_TABLE_SIZE - 1];
}

// Where a cell's background changed: up to where it may be the person.
static inline void segmenter_update_limit(struct segmenter *s, int i)
{
    int front = s->observed_count[i] >= CONFIRMED_FRAMES ? s->front_limit[s->background[i]] : UINT16_MAX;
    s->depth_limit[i] = (uint16_t)(front < s->static_limit[i] ? front : s->static_limit[i]);
}

// In front of everything that is known not to be the person.
static inline bool may_be_person(const struct segmenter *s, int i, int depth_mm)
{
    return depth_mm <= s->depth_limit[i];
}

// From the person's cells to every pixel; mask is all 0 before.
void segmenter_upsample_mask(const struct segmenter *s, const uint16_t *image, uint8_t *mask);

// One picture more of the person's own cells: has anything of them moved?
void segmenter_detect_motion(struct segmenter *s);
