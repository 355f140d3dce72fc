// Checks that reported covariances are consistent: of poses whose truth is known, the stated share must lie inside the
// 95 % and 50 % ellipsoids (chi-squared test of the squared Mahalanobis distance). 6-vectors are ordered as in struct
// location: rotation, then translation.
#pragma once
#include "tests/support/test.h"

#include "base/linear_algebra.h"
#include "locate/locator.h"

#include <stdio.h>

// Chi-squared distribution with six degrees of freedom: 95 % and 50 % lie below.
static const double WITHIN_95 = 12.592, WITHIN_50 = 5.348;

// Squared Mahalanobis distance of a pose error. Its expected value is 6.
static inline double pose_mahalanobis_squared(struct pose found, const double covariance[36], struct pose truth)
{
    struct pose off = pose_multiply(pose_inverse(found), truth);
    struct vec3 rotation_error = quat_to_rotation_vector(off.rotation);
    const double d[6] = {rotation_error.x,  rotation_error.y,  rotation_error.z,
                         off.translation.x, off.translation.y, off.translation.z};
    double inverse[36], sum = 0;
    EXPECT_TRUE(invert_symmetric(covariance, 6, inverse));
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < 6; j++)
            sum += d[i] * inverse[i * 6 + j] * d[j];
    return sum;
}

// The mean of the same over a place's tags. truth: all tags, in any order.
static inline double tags_mahalanobis_squared(const struct place *place, const struct place_tag *truth,
                                              struct pose truth_from_place)
{
    double sum = 0;
    for (int32_t i = 0; i < place->tag_count; i++) {
        const struct place_tag *tag = &place->tags[i], *same = truth;
        double covariance[36];
        while (same->id != tag->id)
            same++;
        for (int a = 0, k = 0; a < 6; a++)
            for (int b = a; b < 6; b++, k++)
                covariance[a * 6 + b] = covariance[b * 6 + a] = (double)tag->covariance[k];
        sum += pose_mahalanobis_squared(pose_multiply(truth_from_place, tag->world_from_tag), covariance,
                                        same->world_from_tag);
    }
    return sum / place->tag_count;
}

struct coverage_count {
    int found, within_95, within_50;
    double sum; // of squared Mahalanobis distances
};

// Fails unless the coverage and the mean squared distance are as expected for this number of images: within 3 % of the
// images, a quarter of the squares, and what chance allows.
static inline void expect_coverage(const struct coverage_count *t)
{
    EXPECT_NEAR((double)t->within_95 / t->found, 0.95, 0.03 + sqrt(0.95 * 0.05 / t->found));
    EXPECT_AT_MOST(t->sum / t->found, 1.25 * 6 + 3 * sqrt(2 * 6.0 / t->found));
}

static inline void print_coverage(const struct coverage_count *t)
{
    printf("of %d cameras %.1f %% within 95 %%, %.1f %% within 50 %%, %.2f instead of 6\n", t->found,
           100.0 * t->within_95 / t->found, 100.0 * t->within_50 / t->found, t->sum / t->found);
}

// Counts one more pose.
static inline void coverage_add(struct coverage_count *t, const struct location *at, struct pose truth)
{
    double e = pose_mahalanobis_squared(at->world_from_camera, at->covariance, truth);
    t->found++;
    t->sum += e;
    t->within_95 += e < WITHIN_95;
    t->within_50 += e < WITHIN_50;
}
