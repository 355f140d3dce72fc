// The difference of two aligned movements, instant by instant of the attempt B.
#pragma once
#include "compare/movement.h"

enum verdict { VERDICT_UNKNOWN, VERDICT_SAME, VERDICT_DIFFERENT };
const char *verdict_name(enum verdict v); // "unknown", "same", "different"

// A part is different where its directions are more than this apart, the same where they are less. Chosen by hand,
// half-way between what a viewer does not notice (5 degrees) and does (15).
#define DIFFERENT_RAD (10 * 3.14159265358979323846 / 180)

// Of an angle between two directions and its standard deviation: which side of DIFFERENT_RAD it is on, at a level of
// VERDICT_LEVEL for a Gaussian error; unknown where neither is that sure, or the standard deviation is above 15
// degrees.
#define VERDICT_LEVEL 0.76
enum verdict verdict_of(double angle_rad, double sigma_rad);

struct part_difference {
    float angle_rad, sigma_rad; // NaN where unknown
    enum verdict verdict;
};

// The frame of A that a frame of B shows. NaN: none, B is getting into position or out of it.
struct timeline {
    float *reference; // [count], in frames of A
    int32_t count;
};
void timeline_free(struct timeline *t);
// From the pairs of an alignment. Where one frame of B stands for many of A (a piece of A is missing in B) it is the
// one it resembles most, else their mean, smoothed over 5 frames. ERR_MEMORY.
MUST_CHECK enum status timeline_from_alignment(const struct alignment *x, const struct features *a,
                                               const struct features *b, struct timeline *out);

// A movement's frame at any time, interpolated; known where both neighbours are.
struct movement_frame movement_at(const struct movement *m, double frame);

// out: [PART_COUNT] of frame `frame` of B. The difference of the directions is averaged over 5 frames, and the variance
// of one axis is taken off its square: noise alone never points nowhere, and would be taken for an angle (two axes of
// it would be right for independent frames and an exact sigma; by hand).
void part_differences(const struct movement *a, const struct movement *b, const struct timeline *t, int32_t frame,
                      struct part_difference out[PART_COUNT]);
