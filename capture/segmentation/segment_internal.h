// State and functions that the source files of the segmenter share.
#pragma once
#include "base/depth_noise.h"
#include "capture/segmentation/floor_plane.h"
#include "capture/segmentation/image_bounds.h"
#include "capture/segmentation/segment.h"

enum {
    COLUMNS_MAX = 320,
    DEPTH_TABLE_SIZE = 10001, // depths whose jump and noise are looked up, mm
    // Updates at 15 Hz (every second frame of 30 Hz), chosen by hand:
    CONFIRMED_FRAMES = 3,    // a background value is used after so many samples
    REPLACEMENT_FRAMES = 24, // something nearer that stays this long (1.6 s) becomes background
};

struct segmenter {
    struct lens lens;
    int step, width, height;                // grid: pixels a cell, cells
    struct grid_ray *ray;                   // per cell: the ray's x/z, y/z
    uint16_t max_step_mm[DEPTH_TABLE_SIZE]; // by depth: how far two neighbouring samples of one surface may differ
    uint16_t noise_mm[DEPTH_TABLE_SIZE];    // by depth: how far two samples of one cell's surface may differ
    int step_slope_16;                      // max_step_mm[d] is at least d * step_slope_16 / 65536
    uint16_t *depth;                        // per cell, mm, flying pixels removed
    int32_t *label;                         // per cell: component, -1 none
    int32_t *parent;                        // union-find
    int32_t *candidate;                     // the cells that may be the person, in raster order
    int candidate_count;
    uint16_t *background; // per cell, learned; 0 unknown
    uint8_t *observed_count, *nearer_count;
    uint16_t *known_background; // per cell, set by the caller; 0 unknown
    uint16_t *static_limit;     // per cell: the largest depth in front of the floor and of known_background, mm
    uint16_t *depth_limit;      // the same, and in front of the learned background: up to there it may be the person
    uint16_t *front_limit;      // by a surface's depth, mm: the largest depth that is significantly in front of it
    uint8_t *person, *previous; // per cell: this frame's person, and the last one's
    float *mean_depth;          // per cell: running mean of the person's depth there, mm
    uint8_t *mean_count;        // number of consecutive samples in that mean
    int32_t *mean_updated, update_count; // the update in which a cell's mean was last used; number of updates
    int static_frames;                   // number of consecutive updates in which no part of the person moved
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
    double low[3], high[3]; // bounds: lateral, horizontal distance, and depth along z
    double sum[3];          // of the points
    int border_left, border_right, border_bottom, border_top;
    int overlap;                         // cells that were the person's in the last frame
    int near_body;                       // cells close to the predicted body
    int adjacent;                        // cells next to cells already taken for the person
    bool is_person;                      // it is the person, or a part of the person
    double top_low, top_high, top_width; // lateral bounds and extent within 0.2 m of its top
};

static inline int by_depth(const uint16_t table[DEPTH_TABLE_SIZE], int depth_mm)
{
    return table[depth_mm < DEPTH_TABLE_SIZE ? depth_mm : DEPTH_TABLE_SIZE - 1];
}

// To be called where a cell's background changed: sets its depth_limit.
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

// Labels the components of continuous depth among the cells that may be the person. ERR_MEMORY.
MUST_CHECK enum status segmenter_label_components(struct segmenter *s);
// Counts each component's cells, and those of them that are close to the spheres.
void segmenter_count_near_body(struct segmenter *s, const struct bounding_sphere *spheres, int sphere_count);
// Fills every other measure of the components. Without memory the top widths stay 0: every top then counts as narrow.
void segmenter_measure_components(struct segmenter *s);

// Of the outline of that component, the share along which its surface continues, within max_step_mm, in cells that
// cannot be the person: a person's feet on the floor; disoccluded background nearly all round. Cell sides, 0 to 1.
double segmenter_continued_share(const struct segmenter *s, int component);

// Upsamples the person's cells to every pixel; mask must be all 0.
void segmenter_upsample_mask(const struct segmenter *s, const uint16_t *image, uint8_t *mask);

// Compares the person's cells with their running means and updates static_frames.
void segmenter_detect_motion(struct segmenter *s);
