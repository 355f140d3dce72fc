// Tags as a camera sees them, without a picture: their true corners and noise, for fits
// that no tag finder would let through.
#pragma once
#include "locate/pose_solver.h"
#include "tests/support/random.h"

#define TAG_SIGHT_F_PX 525.0

static inline struct sighting tag_sight(const struct place_tag *tag, const struct pose *world_from_camera,
                                        double noise_px, struct dice *dice)
{
    struct sighting s = {.id = tag->id, .likeness = 1};
    struct vec3 world[4];
    place_tag_corners(tag, world);
    for (int k = 0; k < 4; k++) {
        struct vec3 p = pose_apply(pose_inverse(*world_from_camera), world[k]);
        s.ray[k] = v3(p.x / p.z + noise_px * dice_normal(dice) / TAG_SIGHT_F_PX,
                      p.y / p.z + noise_px * dice_normal(dice) / TAG_SIGHT_F_PX, 1);
        s.information[2 * k][2 * k] = s.information[2 * k + 1][2 * k + 1] = 1 / (noise_px * noise_px + 1e-4);
    }
    return s;
}

static inline struct fit_tag tag_sight_for_fit(const struct place_tag *tag, const struct sighting *s)
{
    return (struct fit_tag){.seen = s, .world_from_tag = tag->world_from_tag, .side_m = tag->side_m};
}
