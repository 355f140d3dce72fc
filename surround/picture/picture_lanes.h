// Four points at a time into a picture, for who asks many: lane by lane the arithmetic of surround_picture.h's
// functions in the same order, so that the results are the same bit for bit, on every processor.
#pragma once
#include "surround/picture/fast_angle.h"
#include "surround/picture/surround_picture.h"

#include <string.h>

typedef float four __attribute__((vector_size(16)));
typedef int32_t four_ints __attribute__((vector_size(16)));
typedef double four_doubles __attribute__((vector_size(32)));

// Comparing lanes gives four_ints, -1 for true. Functions take pointers to four_doubles: not every ABI can pass them.
#define FOUR_SELECT(yes, a, b) ((four)(((yes) & (four_ints)(a)) | (~(yes) & (four_ints)(b))))
#define FOUR(number)           ((four){0} + (number))

static inline bool four_any(four_ints mask)
{
    uint64_t halves[2];
    memcpy(halves, &mask, sizeof halves);
    return halves[0] | halves[1];
}

static inline four four_sqrt(four a) { return (four){sqrtf(a[0]), sqrtf(a[1]), sqrtf(a[2]), sqrtf(a[3])}; }

static inline four four_atan2(four y, four x)
{
    const four ax = (four)((four_ints)x & 0x7fffffff), ay = (four)((four_ints)y & 0x7fffffff);
    const four max = FOUR_SELECT(ax > ay, ax, ay), min = FOUR_SELECT(ax > ay, ay, ax);
    const four t = min / FOUR_SELECT(max > 0, max, FOUR(1.0f)), s = t * t;
    const four a = FAST_ATAN(t, s);
    const four b = FOUR_SELECT(ay > ax, 1.57079633f - a, a);
    const four c = FOUR_SELECT(x < 0, 3.14159265f - b, b);
    return FOUR_SELECT(y < 0, -c, c);
}

// As surround_picture_ray, of pixels u to u + 3 of a row, all within the picture.
void surround_picture_rays(const struct surround_picture *picture, int u, int v, four ray[3]);

struct four_points {
    four u, v, distance;
    four_ints inside; // what surround_picture_find returns; of other lanes u and v mean nothing
};

// As surround_picture_distance; distances into out->distance.
void surround_picture_distances(const struct surround_picture *picture, const four_doubles world[3], four camera[3],
                                struct four_points *out);
// As surround_picture_find; out->distance is given.
void surround_picture_find_four(const struct surround_picture *picture, const four camera[3], struct four_points *out);
