// Unifies a moving robot's depth: each new capture is aligned with the earlier ones and added to them (Okura 2014,
// section 3.3). The odometry's motion since the last capture is the guess; branch and bound on the floor's plane by the
// L0 norm finds the basin; point-to-plane least squares over the map's voxels (Chen and Medioni 1992), on the floor's
// plane, gives the last millimetres.
//
// World: the body's axes at the first capture. Pure but for memory; one thread at a time.
#pragma once
#include "base/geometry.h"
#include "base/lens.h"
#include "base/status.h"

// ---------------------------------------------------------------- normal equations

// Normal equations of a small motion of a body: turned by a rotation vector about its origin, then shifted, both along
// the world's axes; order turn x y z, shift x y z. Pure.

struct normal_equations {
    double h[36], g[6];
    int matched;
};

// A residual r that changes with the world point of a body by n per metre; arm: that point less the body's origin.
static inline void normal_equations_add(struct normal_equations *equations, const double n[3], const double arm[3],
                                        double r, double weight)
{
    const double j[6] = {
        arm[1] * n[2] - arm[2] * n[1], arm[2] * n[0] - arm[0] * n[2], arm[0] * n[1] - arm[1] * n[0], n[0], n[1], n[2]};
    for (int a = 0; a < 6; a++) {
        const double weighted = weight * j[a];
        equations->g[a] -= weighted * r;
        for (int b = 0; b < 6; b++)
            equations->h[6 * a + b] += weighted * j[b];
    }
    equations->matched++;
}

// What else is known of a body's pose: adds its residuals at world_from_body.
struct pose_evidence {
    void (*add)(void *self, const struct pose *world_from_body, struct normal_equations *e); // NULL: nothing
    void *self;
};

// ---------------------------------------------------------------- depth points

// Points of a depth picture in its body's axes, each with its standard deviation. What lies on a jump of depth is left
// out: there a sample may hang between the near and the far surface (flying pixels). Pure but for memory.

struct depth_points {
    float (*xyz)[3]; // metres
    float *sigma;    // metres
    int count, capacity;
};

// Appends the points of a depth picture (millimetres, 0 = no reading), every `step`-th row and column. ERR_MEMORY: as
// before.
MUST_CHECK enum status depth_points_add(struct depth_points *points, const uint16_t *depth, const struct lens *lens,
                                        struct pose body_from_camera, int step);
void depth_points_free(struct depth_points *points); // a zeroed one is fine

// ---------------------------------------------------------------- voxel map

// Points averaged in cubes: each voxel of a hash table holds the weighted mean and covariance of what fell into it.
// Pure but for memory; one writer, or any number of readers.

// One line of the processor's cache: the table is read in no order, and each line waits for the memory.
struct voxel {
    int64_t key;      // 0: empty
    float weight;     // sum of 1 / sigma^2 of its points
    float sum[3];     // weighted, relative to the voxel's corner, metres
    float square[6];  // weighted products xx xy xz yy yz zz, relative to the corner
    int32_t count;    // points
    int32_t captures; // how many additions of a new capture
    int32_t last;     // number of the newest capture in it
    int32_t unused;
};

struct voxel_map {
    double side_m, per_m; // per_m: 1 / side_m
    struct voxel *table;  // a power of two of them, aligned to the cache's lines
    size_t size, used;
};

void voxel_mean(const struct voxel_map *map, const struct voxel *voxel, double mean[3]);

// ---------------------------------------------------------------- branch and bound

// Alignment on the floor's plane by the L0 norm (Okura 2014, section 3.3, equations 1 and 2): of all turns and shifts
// around the odometry's guess, the one with the most points within epsilon (2 cm) of a point of the map. Trying all is
// exact and slow; branch and bound (Hess et al. 2016, section V) gives the same answer: a block of shifts is left out
// when the maximum of the map over the block cannot beat what was found.
//
// Among equal answers, and against one flat wall that leaves a shift open, the one nearer to the guess is taken: the
// guess is a soft prior. Pure but for memory.

enum { SEARCH_LEVELS = 6, SEARCH_MAX_TURNS = 256 };

static const double SEARCH_CELL_M = 0.01;                           // step of the shift
static const double SEARCH_TURN_STEP = 0.25 * 0.017453292519943295; // radians
static const double SEARCH_EPSILON_M = 0.02;

struct search_options {
    int reach;    // shifts to each side, in cells; 32: 65 x 65
    int turns;    // turns to each side; 16: +-4 degrees
    double prior; // the guess's standard deviation, which costs 1 % of the points, over 5 cm and 0.02 radians; 1
};
struct search_options search_default_options(void);

struct search_result {
    int turn, x, y;  // steps from the guess
    int hits;        // points within epsilon of the map
    int64_t score;   // hits less the prior's cost, in 2^-16 points
    int64_t lookups; // how often the map was read, to compare methods
};

// The map's points around the guess as a grid, with its maxima over blocks of 2, 4, … cells.
struct search_grid {
    int width, height;
    double x0, y0; // world corner of cell (0, 0)
    uint8_t *levels[SEARCH_LEVELS + 1];
};
MUST_CHECK enum status search_grid_make(struct search_grid *grid, const double low[2], const double high[2]);
void search_grid_free(struct search_grid *grid); // a zeroed one is fine
void search_grid_mark(struct search_grid *grid, double x, double y);
void search_grid_finish(struct search_grid *grid); // after the last mark

// points: count x (x, y) in the body's axes. guess: x, y, heading in the world. *out is what trying all would find.
// ERR_MEMORY.
MUST_CHECK enum status search_branch_and_bound(const struct search_grid *grid, const double (*points)[2], int count,
                                               const double guess[3], const struct search_options *options,
                                               struct search_result *out);

// ---------------------------------------------------------------- depth alignment

struct depth_alignment {
    struct voxel_map surface; // all points
    struct voxel_map planes;  // 10 cm: for the refinement
    struct voxel_map outline; // 2 cm, z = 0: points of the compared heights
    int capture_count;
    struct pose odometry, world_from_body; // of the newest capture
    struct search_result search;           // of the newest capture
    struct pose_evidence more;             // beside the planes, for the refinement; set by the caller before an add
};

// surface_m: side of the voxels that all points are averaged in. ERR_MEMORY.
MUST_CHECK enum status depth_alignment_open(struct depth_alignment *alignment, double surface_m);
void depth_alignment_close(struct depth_alignment *alignment); // a zeroed one is fine

// Aligns and adds a capture. *world_from_body: where it was. NOTHING: the points do not fit the earlier ones, not even
// after the widened search; then *world_from_body is the odometry's, and the points are not added. ERR_MEMORY.
MUST_CHECK enum status depth_alignment_add(struct depth_alignment *alignment, const struct depth_points *points,
                                           struct pose odometry, struct pose *world_from_body);

// Adds points whose pose is known.
MUST_CHECK enum status depth_alignment_unify(struct depth_alignment *alignment, const struct depth_points *points,
                                             struct pose world_from_body);
