#include "reenact/outline.h"

enum { EVERY_PX = 2 };
enum { SURE = 50 }; // places; a bone with fewer keeps nearer to what it is

static const double BEFORE_M = 0.10, BEHIND_M = 0.15, STEP_M = 0.01; // along the line of sight, about what is seen

// The least distance between the shape, as one bone goes, and the line of sight through `px`. NAN: it is nowhere near.
static double passing(const struct volume *v, const struct lens *lens, struct pose rest_from_depth, struct pixel px,
                      double z)
{
    double least = NAN;
    struct vec3 ray = lens_ray(lens, px);
    for (double along = z - BEFORE_M; along <= z + BEHIND_M; along += STEP_M) {
        double distance, seen;
        struct vec3 gradient;
        if (volume_at(v, pose_apply(rest_from_depth, v3_scale(ray, along)), &distance, &gradient, &seen) &&
            !(distance >= least))
            least = distance;
    }
    return least;
}

void outline_measure(const struct volume *v, const struct calibration *calibration, const struct sight *sight,
                     const struct posture *posture, struct outline_gaps *gaps)
{
    static const int steps[4][2] = {{1, 0}, {-1, 0}, {0, 1}, {0, -1}};
    const struct pose color_from_depth = calibration->registered ? POSE_IDENTITY : calibration->color_from_depth;
    struct pose rest_from_color[BONE_COUNT];
    for (int b = 0; b < BONE_COUNT; b++)
        rest_from_color[b] = pose_inverse(posture->bone[b]);
    int margin = SIGHT_INWARD_PX + 1;
    for (int i = sight->top * sight->width; i < (sight->bottom + 1) * sight->width; i += EVERY_PX) {
        int x = i % sight->width, y = i / sight->width;
        if (x < margin || y < margin || x >= sight->width - margin || y >= sight->height - margin ||
            sight->part[i] != SIGHT_ROOM)
            continue;
        for (int s = 0; s < 4; s++) {
            const int inside = sight_inside(sight, i, steps[s][1] * sight->width + steps[s][0]);
            if (inside < 0)
                continue;
            double out = 0.5 - SIGHT_RIM_PX; // from the room's pixel inwards
            struct pixel px = {x + out * steps[s][0], y + out * steps[s][1]};
            struct vec3 shown = source_rays_point(sight->rays, inside, sight->depth[inside]);
            int bone = rest_bone(volume_rest(v), (enum part)sight->part[inside], shown, rest_from_color);
            struct pose rest_from_depth = pose_multiply(rest_from_color[bone], color_from_depth);
            double gap = passing(v, &calibration->depth, rest_from_depth, px, sight->depth[inside] * 1e-3);
            if (isnan(gap))
                continue;
            gaps->sum[bone] += gap;
            gaps->count[bone]++;
        }
    }
}

void outline_meet(struct volume *v, const struct outline_gaps *gaps)
{
    double out_m[BONE_COUNT];
    for (int p = 0; p < BONE_COUNT; p++)
        out_m[p] = gaps->sum[p] / (gaps->count[p] + SURE);
    volume_grow(v, out_m);
}
