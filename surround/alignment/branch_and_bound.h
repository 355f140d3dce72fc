// Alignment on the floor's plane by the L0 norm (Okura 2014, section 3.3, equations 1 and 2): of all turns and shifts
// around the odometry's guess, the one with the most points within epsilon of a point of the map. Trying all is exact
// and slow; branch and bound (Hess et al. 2016, section V) gives the same answer: a block of shifts is left out when
// the maximum of the map over the block cannot beat what was found.
//
// Among equal answers, and against one flat wall that leaves a shift open, the one nearer to the guess is taken: the
// guess is a soft prior. Pure but for memory.
#pragma once
#include "base/geometry.h"

enum { SEARCH_LEVELS = 6, SEARCH_MOST_TURNS = 256 };

struct search_options {
    double cell_m;        // step of the shift, 0.01
    int reach;            // shifts to each side, in cells; 32: 65 x 65
    double turn_step;     // radians, 0.25 degrees
    int turns;            // turns to each side; 16: +-4 degrees
    double epsilon_m;     // identical within this, 0.02
    double prior_shift_m; // the guess's standard deviation; moving by it costs 1 % of the points
    double prior_turn;    // radians
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
    double x0, y0, cell_m; // world corner of cell (0, 0)
    uint8_t *levels[SEARCH_LEVELS + 1];
};
MUST_CHECK enum status search_grid_make(struct search_grid *grid, const double low[2], const double high[2],
                                        const struct search_options *how);
void search_grid_free(struct search_grid *grid); // what was zeroed, too
void search_grid_mark(struct search_grid *grid, double x, double y, double epsilon_m);
void search_grid_finish(struct search_grid *grid); // after the last mark

// points: count x (x, y) in the body's axes. guess: x, y, heading in the world. Each fills *out; the answers are equal.
// ERR_MEMORY.
MUST_CHECK enum status search_branch_and_bound(const struct search_grid *grid, const double (*points)[2], int count,
                                               const double guess[3], const struct search_options *how,
                                               struct search_result *out);
MUST_CHECK enum status search_exhaustive(const struct search_grid *grid, const double (*points)[2], int count,
                                         const double guess[3], const struct search_options *how,
                                         struct search_result *out);
