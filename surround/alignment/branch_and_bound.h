// Alignment on the floor's plane by the L0 norm (Okura 2014, section 3.3, equations 1 and 2): of all turns and shifts
// around the odometry's guess, the one with the most points within epsilon (2 cm) of a point of the map. Trying all is
// exact and slow; branch and bound (Hess et al. 2016, section V) gives the same answer: a block of shifts is left out
// when the maximum of the map over the block cannot beat what was found.
//
// Among equal answers, and against one flat wall that leaves a shift open, the one nearer to the guess is taken: the
// guess is a soft prior. Pure but for memory.
#pragma once
#include "base/geometry.h"

enum { SEARCH_LEVELS = 6, SEARCH_MOST_TURNS = 256 };

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
void search_grid_free(struct search_grid *grid); // what was zeroed, too
void search_grid_mark(struct search_grid *grid, double x, double y);
void search_grid_finish(struct search_grid *grid); // after the last mark

// points: count x (x, y) in the body's axes. guess: x, y, heading in the world. *out is what trying all would find.
// ERR_MEMORY.
MUST_CHECK enum status search_branch_and_bound(const struct search_grid *grid, const double (*points)[2], int count,
                                               const double guess[3], const struct search_options *how,
                                               struct search_result *out);
