// The inside of a deformation, for fitting it to depth and outline (deformation.c) and to colours
// (deformation_photometric.c) only.
#pragma once
#include "reenact/avatar/deformation.h"

// Point (x, y, z) lies at corner + (x, y, z) * DEFORMATION_STEP_M.
struct deformation_grid {
    struct vec3 corner;
    int size[3];
};

// x, y, z and a fourth that is nothing, for which processors have instructions.
typedef float four __attribute__((vector_size(16)));
typedef double four_doubles __attribute__((vector_size(32)));

struct deformation_row { // share . shift along n = value
    four n;
    int32_t node[8];
    float share[8], value, weight;
};

// A pixel of the person, and where in the bind pose its part has it.
struct deformation_sample {
    struct vec3 bind_point, ray; // ray: the direction in which the camera saw it, unit
};

// A place of the outline that the person has in the picture.
struct contour_point {
    struct pixel px;
    double nx, ny; // outwards, unit
    int part;
};

// A place of the surface that may be at the outline.
struct silhouette_candidate {
    struct pixel px;
    double nx, ny; // outwards in the picture, unit
    double z;      // depth camera's axes, metres
    int point;
    int next; // in the same tile; -1: none
};

struct deformation {
    struct bind_pose bind_pose;
    struct lens depth_lens;
    struct pose depth_from_color;
    struct deformation_grid grid;
    int32_t *node;          // of each point of the grid; -1: none
    int32_t (*neighbor)[3]; // of each node: the nodes that follow in x, y, z; -1: none
    int node_count;
    four *shift;                                           // of each node
    four *rhs, *residual, *direction, *product, *diagonal; // the solver's
    struct deformation_row *rows;
    int row_count, row_most;
    struct deformation_sample *depth_samples;
    int sample_count;
    struct contour_point *contour;
    int contour_count;
    struct silhouette_candidate *candidates;
    int candidate_count;
    int32_t *tile;    // of the depth picture: the first of its candidates; -1: none
    int across, down; // tiles
    struct color_point *color_points;
    int color_point_count;
    uint8_t *quantized;
};

// How far a point of the bind pose is shifted by now.
struct vec3 deformation_current_shift(const struct deformation *w, struct vec3 bind_point);
// The place `bind_point` should go by `more` metres along n (unit, bind-pose axes) beyond what it is shifted now.
void deformation_add_row(struct deformation *w, struct vec3 bind_point, struct vec3 n, double more, double weight);

// A place of the surface whose colour in the frame's picture can be compared with the vertex_colors's.
enum { DEFORMATION_COLOR_POINTS = 4000 };
struct color_point {
    struct vec3 bind_point, at; // at: colour camera's axes
    int bone;
    float known[3];                    // as the vertex_colors has it, in the frame's light; roots, 0 to 1
    float seen[3], across[3], down[3]; // the picture's colour there, and how it changes by a pixel
};
// Adds what the colours say: where the picture, smoothed by sigma_px, shows the vertex_colors's colours neighbor where
// they are.
void deformation_add_colors(struct deformation *w, const struct deformation_model *model,
                            const struct depth_frame *depth_frame, const struct bone_transforms *transforms,
                            const struct deformation_colors *colors, double sigma_px);
