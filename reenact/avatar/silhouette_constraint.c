#include "reenact/avatar/silhouette_constraint.h"

enum { EVERY_PX = 2 };
static const float SURE = 50;     // places; a bone with fewer keeps nearer to what it is
static const float SURE_HERE = 5; // and a place of a bone with fewer nearer to the whole bone

static const double BEFORE_M = 0.05, BEHIND_M = 0.12, STEP_M = 0.01; // along the line of sight, about what is seen
static const double LEAST_GRADIENT = 0.3;                            // of a distance that means something

// ---------------------------------------------------------------- places

static int find_beside(const struct sight *s, int x, int y, struct outline_place *places, int room)
{
    static const int8_t steps[4][2] = {{1, 0}, {-1, 0}, {0, 1}, {0, -1}};
    const float out = 0.5F - (float)SIGHT_RIM_PX; // from the room's pixel inwards
    int count = 0;
    for (int k = 0; k < 4 && count < room; k++) {
        const int inside = sight_inside(s, y * s->width + x, steps[k][1] * s->width + steps[k][0]);
        if (inside >= 0)
            places[count++] =
                (struct outline_place){(float)x + out * (float)steps[k][0], (float)y + out * (float)steps[k][1], inside,
                                       steps[k][0], steps[k][1]};
    }
    return count;
}

// Stops where there is no more room for them.
static int find_every(const struct sight *s, int every, struct outline_place places[OUTLINE_MOST])
{
    enum { MARGIN = SIGHT_INWARD_PX + 1 };
    const int left = s->left - 1 > MARGIN ? s->left - 1 : MARGIN, top = s->top - 1 > MARGIN ? s->top - 1 : MARGIN;
    int count = 0;
    for (int y = top; y <= s->bottom + 1 && y < s->height - MARGIN; y++)
        for (int x = left + y % every; x <= s->right + 1 && x < s->width - MARGIN; x += every)
            if (s->part[y * s->width + x] == SIGHT_ROOM)
                count += find_beside(s, x, y, places + count, OUTLINE_MOST - count);
    return count;
}

int outline_find(const struct sight *sight, struct outline_place places[OUTLINE_MOST])
{
    int every = EVERY_PX, count;
    while ((count = find_every(sight, every, places)) == OUTLINE_MOST)
        every++;
    return count;
}

int outline_bone(const struct rest *rest, const struct sight *sight, const struct outline_place *place,
                 const struct pose rest_from_color[BONE_COUNT])
{
    const struct vec3 beside = source_rays_point(sight->rays, place->inside, sight->depth[place->inside]);
    return rest_bone(rest, (enum part)sight->part[place->inside], beside, rest_from_color);
}

bool outline_touches(const struct volume *v, const struct calibration *calibration, const struct sight *sight,
                     const struct outline_place *place, struct pose rest_from_color, struct outline_touch *out)
{
    const struct pose color_from_depth = calibration->registered ? POSE_IDENTITY : calibration->color_from_depth;
    const struct pose rest_from_depth = pose_multiply(rest_from_color, color_from_depth);
    const struct vec3 ray = lens_ray(&calibration->depth, (struct pixel){(double)place->x, (double)place->y});
    const struct vec3 along = quat_rotate(rest_from_depth.rotation, ray);
    const double z = sight->depth[place->inside] * 1e-3;
    double least = NAN, least_z = 0;
    struct vec3 normal = {0, 0, 0};
    for (double at = z - BEFORE_M; at <= z + BEHIND_M; at += STEP_M) {
        double distance, seen;
        struct vec3 gradient;
        if (volume_at(v, v3_add(rest_from_depth.translation, v3_scale(along, at)), &distance, &gradient, &seen) &&
            !(distance >= least))
            least = distance, least_z = at, normal = gradient;
    }
    if (isnan(least) || v3_length(normal) < LEAST_GRADIENT)
        return false;
    *out = (struct outline_touch){.gap = least,
                                  .at = pose_apply(color_from_depth, v3_scale(ray, least_z)),
                                  .normal = v3_unit(normal),
                                  .inward = quat_rotate(color_from_depth.rotation, v3(place->in_x, place->in_y, 0))};
    return true;
}

// ---------------------------------------------------------------- how thick it is

void outline_measure(const struct volume *v, const struct calibration *calibration, const struct sight *sight,
                     const struct posture *posture, struct outline_gaps *gaps)
{
    struct outline_place places[OUTLINE_MOST];
    struct pose rest_from_color[BONE_COUNT];
    for (int b = 0; b < BONE_COUNT; b++)
        rest_from_color[b] = pose_inverse(posture->bone[b]);
    const int count = outline_find(sight, places);
    for (int i = 0; i < count; i++) {
        const int bone = outline_bone(volume_rest(v), sight, &places[i], rest_from_color);
        struct outline_touch touch;
        if (!volume_rest(v)->known[bone] ||
            !outline_touches(v, calibration, sight, &places[i], rest_from_color[bone], &touch))
            continue;
        const struct vec3 in_rest = pose_apply(rest_from_color[bone], touch.at);
        const struct chart_place here = chart_place_of(&volume_rest(v)->frame[bone], in_rest);
        bone_chart_add(&gaps->sum[bone], &here, (float)touch.gap);
        bone_chart_add(&gaps->count[bone], &here, 1);
    }
}

void outline_add(struct outline_gaps *to, const struct outline_gaps *gaps)
{
    for (int b = 0; b < BONE_COUNT; b++)
        for (int i = 0; i < CHART_HEIGHTS * CHART_ANGLES; i++) {
            to->sum[b].at[i] += gaps->sum[b].at[i];
            to->count[b].at[i] += gaps->count[b].at[i];
        }
}

void outline_meet(struct volume *v, const struct outline_gaps *gaps)
{
    struct bone_chart out_m[BONE_COUNT];
    for (int b = 0; b < BONE_COUNT; b++) {
        struct bone_chart sum = gaps->sum[b], count = gaps->count[b];
        const float whole = (float)bone_chart_sum(&sum) / ((float)bone_chart_sum(&count) + SURE);
        bone_chart_even(&sum);
        bone_chart_even(&count);
        for (int i = 0; i < CHART_HEIGHTS * CHART_ANGLES; i++)
            out_m[b].at[i] = (sum.at[i] + SURE_HERE * whole) / (count.at[i] + SURE_HERE);
    }
    volume_grow(v, out_m);
}
