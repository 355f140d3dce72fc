// How well an attempt matches a reference, as one number. 100: the same movement, by any person, anywhere.
//
// Of every part of the body, its direction against the part that carries it (upper arms against the chest, forearms and
// shins against upper arms and thighs, the others in the person's upright frame), and of the upper torso the shoulders'
// line as well, by which the trunk turns, over the pairs of the alignment:
//
//     offset   how far the mean of the differences is from none: held otherwise all along
//     course   the standard deviation of the differences, as a share of how much both move: moved otherwise
//     range    the logarithm of the ratio of how far both swing; a larger one counts half
//
// What the joints' noise adds is taken off: as much as directions leave the middle between those a tenth of a second
// before and after, where the part moves slowly. Each is divided by its natural spread, its root mean square between
// healthy people who do the same exercise right (UI-PRMD movements 1 to 5, each repetition against one of each other
// person; score.c): z. A deviation costs z^2 / (1 + z^2) (Geman & McClure 1985), a part the mean of its three, the body
// half the mean of trunk and head and half the mean of the limbs, which weigh as the reference moves them: in an
// exercise of the arms the arms matter. With what is missing or added and what the findings say, each a share of what
// is then left, that is the cost C, and the score is 100 (1 - C).
//
// Where something else is expected (expectation.h) the natural spreads are multiplied by what that says, and parts that
// do not matter are unknown.
//
// The halves are by hand: docs/notes/comparing.md has what was tried beside them.
#pragma once
#include "compare/difference.h"
#include "compare/expectation.h"

struct part_deviation {
    double z[DEVIATIONS]; // in natural spreads
    double weight;        // of all parts 1 in sum; 0: the part is unknown
    double cost;          // 0..1, without the weight
};

struct score_terms {
    struct part_deviation part[PART_COUNT];
    double posture;       // weighted mean of the costs
    double missing_share; // of the reference's moving time
    double extra_share;   // of the attempt's
    double findings;      // what the findings cost beside, 0..1 (findings.h)
};

double score_from_terms(const struct score_terms *terms); // 0..100; 0 where no part can be compared

// Beside the parts' directions the line from the right shoulder to the left: how the trunk is turned.
enum { LINE_SHOULDERS = PART_COUNT, SCORED_LINES };

// What parts' directions have in common over pairs of frames, summed up; several alignments may be added, such as those
// of repetitions. Zeroed: none.
struct pair_sums {
    struct pair_moments {
        double count, a[3], b[3], aa, bb, ab;     // of the directions and of their products
    } carried[SCORED_LINES], upright[PART_COUNT]; // against the carriers; in the upright frame
    struct noise_sum {
        double sum, count;    // rad^2
    } noise[2][SCORED_LINES]; // of the directions of A's and of B's parts (score.c)
    uint16_t ignored;         // parts of which nothing is added
};
void pair_sums_add(struct pair_sums *sums, const struct movement *a, const struct movement *b,
                   const struct alignment *x);
void noise_sums_add(struct noise_sum sums[SCORED_LINES], const struct movement *movement, int32_t first, int32_t end);

// posture and part; the rest of the terms is zeroed. moved: [PART_COUNT], how much the reference moves each part, rad;
// NULL: as its directions vary over the pairs. by: NULL: the natural spreads.
struct score_terms score_posture(const struct pair_sums *sums, const double *moved, const struct tolerances *by);

// What the score may be off by for the joints' errors, points, one standard deviation. NaN where either movement's
// source does not give them. What they add from frame to frame is taken off before; what is left is taken to be wrong
// in pieces of a second, and of all parts the same way, because a joint belongs to two. terms: of these sums.
double score_error(const struct score_terms *terms, const struct pair_sums *sums, const struct movement *a,
                   const struct movement *b, const struct tolerances *by);

double robust_cost(double z); // of a deviation of z natural spreads, 0..1

// What healthy people who do the same exercise right hold a part otherwise by, all along; root mean square, rad.
double natural_offset_rad(enum part part);

// How much two aligned movements have in common, over the parts' directions in the upright frame.
struct similarity {
    double correlation;              // of the directions less their means, all parts together; 1: one is a multiple
    double rms_rad;                  // root mean square of the differences
    double moved_a_rad, moved_b_rad; // standard deviation of each one's directions without noise, r.m.s. over the parts
    double error_a_rad, error_b_rad; // what the joints' slow errors may add to that
};
// The slow errors are by what the movements' source says of its joints; where it says nothing, as large as the
// noise of the one that has less of it: a sensor that jitters also drifts.
struct similarity similarity_of(const struct pair_sums *sums, const struct movement *a, const struct movement *b);
