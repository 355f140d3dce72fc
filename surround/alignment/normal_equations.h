// Normal equations of a small motion of a body: turned by a rotation vector about its origin, then shifted, both along
// the world's axes; order turn x y z, shift x y z. Pure.
#pragma once
#include "base/geometry.h"

struct normal_equations {
    double h[36], g[6];
    int matched;
};

// A residual r that changes with the world point of a body by n per metre; arm: that point less the body's origin.
static inline void normal_equations_add(struct normal_equations *e, const double n[3], const double arm[3], double r,
                                        double weight)
{
    const double j[6] = {
        arm[1] * n[2] - arm[2] * n[1], arm[2] * n[0] - arm[0] * n[2], arm[0] * n[1] - arm[1] * n[0], n[0], n[1], n[2]};
    for (int a = 0; a < 6; a++) {
        const double weighted = weight * j[a];
        e->g[a] -= weighted * r;
        for (int b = 0; b < 6; b++)
            e->h[6 * a + b] += weighted * j[b];
    }
    e->matched++;
}

// What else is known of a body's pose: adds its residuals at world_from_body.
struct pose_evidence {
    void (*add)(void *self, const struct pose *world_from_body, struct normal_equations *e); // NULL: nothing
    void *self;
};
