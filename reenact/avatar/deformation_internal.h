// The state of a deformation, shared by deformation.c (depth and silhouette), deformation_photometric.c (colours) and
// deformation_equations.c (the solver). For those only. Calls go one way, in this order.
#pragma once
#include "reenact/avatar/deformation.h"

// x, y, z and an unused fourth component, so that processors can use their vector instructions.
typedef float four __attribute__((vector_size(16)));
typedef double four_doubles __attribute__((vector_size(32)));

// One equation: sum of share[c] * dot(n, shift of node[c]) = value, metres; weight in 1/m².
struct deformation_row {
    four n;
    int32_t node[8];
    float share[8], value, weight;
};

// A depth sample of the actor, mapped into the bind pose by the bone that shows there.
struct deformation_sample {
    struct vec3 bind_point, ray; // ray: the viewing direction, unit, bind-pose axes
};

// A point of the actor's silhouette in the depth image.
struct contour_point {
    struct pixel px;
    double nx, ny; // outwards, unit
    int part;      // that is seen inside it
};

// A point of the surface that may project onto the silhouette.
struct silhouette_candidate {
    struct pixel px; // depth image
    double nx, ny;   // outwards in the image, unit
    double z;        // depth camera's axes, metres
    int point;       // of the surface
    int next;        // in the same tile; -1: none
};

// A point of the surface whose colour can be compared with the frame's image. Colours are gamma-encoded (square roots
// of linear ones), 0 to 1.
enum { DEFORMATION_COLOR_POINTS = 4000 };
struct color_point {
    struct vec3 bind_point, at; // at: colour camera's axes
    int bone;
    float known[3];                    // the avatar's colour there, under the frame's irradiance
    float seen[3], across[3], down[3]; // the smoothed image's colour there, and its change per pixel
};

struct deformation {
    struct bind_pose bind_pose;
    struct lens depth_lens;
    struct pose depth_from_color;
    struct deformation_grid grid;
    int32_t *node;          // of each grid point: number of its node; -1: none
    int32_t (*neighbor)[3]; // of each node: the next nodes in x, y, z; -1: none
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
    int32_t *tile;    // of the depth image: the first of its candidates; -1: none
    int across, down; // tiles
    struct color_point *color_points;
    int color_point_count;
    uint8_t *quantized; // of each grid point: x, y, z, unused; what deformation_at reads
};

// ---- deformation_equations.c

// The shift of a point of the bind pose in the current iteration, not quantised.
struct vec3 deformation_current_shift(const struct deformation *w, struct vec3 bind_point);

// bind_point should move by `gap` metres along `normal` beyond its current shift.
struct deformation_constraint {
    struct vec3 bind_point, normal; // normal: unit, bind-pose axes
    double gap, weight;             // weight: 1/m²
};
// Drops a constraint outside the nodes, or where the rows are full.
void deformation_add_row(struct deformation *w, const struct deformation_constraint *constraint);

// Solves the rows for the shifts, starting from the current ones.
void deformation_solve(struct deformation *w);

// ---- deformation_photometric.c

// Adds a row for each point and channel where the image, smoothed by sigma_px, has a gradient: move the surface so that
// the image shows the avatar's colours where they are.
void deformation_add_colors(struct deformation *w, const struct deformation_model *model,
                            const struct depth_frame *depth_frame, const struct bone_transforms *transforms,
                            const struct deformation_colors *colors, double sigma_px);
