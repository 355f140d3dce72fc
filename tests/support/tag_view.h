// Tags as a camera observes them, without an image: their true corners and noise, for cases that the tag detector would
// not let through.
#pragma once
#include "locate/pose_solver.h"
#include "tests/support/random.h"

#define TAG_VIEW_F_PX 525.0

static inline struct tag_observation tag_view_observe(const struct place_tag *tag, const struct pose *world_from_camera,
                                                      double noise_px, struct rng *rng)
{
    struct tag_observation s = {.id = tag->id, .correlation = 1};
    struct vec3 world[4];
    place_tag_corners(tag, world);
    for (int k = 0; k < 4; k++) {
        struct vec3 p = pose_apply(pose_inverse(*world_from_camera), world[k]);
        s.ray[k] = v3(p.x / p.z + noise_px * rng_normal(rng) / TAG_VIEW_F_PX,
                      p.y / p.z + noise_px * rng_normal(rng) / TAG_VIEW_F_PX, 1);
        s.information[2 * k][2 * k] = s.information[2 * k + 1][2 * k + 1] = 1 / (noise_px * noise_px + 1e-4);
    }
    return s;
}

static inline struct pnp_tag tag_view_for_solver(const struct place_tag *tag, const struct tag_observation *s)
{
    return (struct pnp_tag){.seen = s, .world_from_tag = tag->world_from_tag, .side_m = tag->side_m};
}

static inline enum status tag_view_solve(struct pnp_tag *tags, int count, double max_rms_px, struct pnp_solution *out)
{
    const struct pose_problem problem = {.tags = tags, .tag_count = count, .fx = TAG_VIEW_F_PX, .fy = TAG_VIEW_F_PX};
    return pnp_solve(&problem, max_rms_px, out);
}
