// The inside of a warp, for fitting it to depth and outline (deformation.c) and to colours (deformation_photometric.c)
// only.
#pragma once
#include "reenact/avatar/deformation.h"

// Point (x, y, z) lies at corner + (x, y, z) * WARP_STEP_M.
struct warp_grid {
    struct vec3 corner;
    int size[3];
};

// x, y, z and a fourth that is nothing, for which processors have instructions.
typedef float four __attribute__((vector_size(16)));
typedef double four_doubles __attribute__((vector_size(32)));

struct row { // share . shift along n = value
    four n;
    int32_t node[8];
    float share[8], value, weight;
};

// A pixel of the person, and where in the rest pose its part has it.
struct reading {
    struct vec3 rest, ray; // ray: the direction in which the camera saw it, unit
};

// A place of the outline that the person has in the picture.
struct edge {
    struct pixel px;
    double nx, ny; // outwards, unit
    int part;
};

// A place of the surface that may be at the outline.
struct brink {
    struct pixel px;
    double nx, ny; // outwards in the picture, unit
    double z;      // depth camera's axes, metres
    int point;
    int next; // in the same tile; -1: none
};

struct warp {
    struct rest rest;
    struct lens depth_lens;
    struct pose depth_from_color;
    struct warp_grid grid;
    int32_t *node;        // of each point of the grid; -1: none
    int32_t (*beside)[3]; // of each node: the nodes that follow in x, y, z; -1: none
    int node_count;
    four *shift;                                    // of each node
    four *right, *residual, *along, *image, *scale; // the solver's
    struct row *rows;
    int row_count, row_most;
    struct reading *readings;
    int reading_count;
    struct edge *edges;
    int edge_count;
    struct brink *brinks;
    int brink_count;
    int32_t *tile;    // of the depth picture: the first of its brinks; -1: none
    int across, down; // tiles
    struct color_place *color_places;
    int color_place_count;
    uint8_t *picture;
};

// How far a point of the rest pose is shifted by now.
struct vec3 warp_shift_now(const struct warp *w, struct vec3 rest);
// The place `rest` should go by `more` metres along n (unit, rest axes) beyond what it is shifted now.
void warp_add_row(struct warp *w, struct vec3 rest, struct vec3 n, double more, double weight);

// A place of the surface whose colour in the frame's picture can be compared with the coat's.
enum { WARP_COLOR_PLACES = 4000 };
struct color_place {
    struct vec3 rest, at; // at: colour camera's axes
    int bone;
    float known[3];                    // as the coat has it, in the frame's light; roots, 0 to 1
    float seen[3], across[3], down[3]; // the picture's colour there, and how it changes by a pixel
};
// Adds what the colours say: where the picture, smoothed by sigma_px, shows the coat's colours beside where they are.
void warp_add_colors(struct warp *w, const struct warp_model *model, const struct sight *sight,
                     const struct posture *posture, const struct warp_colors *colors, double sigma_px);
