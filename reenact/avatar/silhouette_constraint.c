#include "reenact/avatar/silhouette_constraint.h"

// All chosen by hand.
enum { EVERY_PX = 2 };
static const float PRIOR_WEIGHT = 50;      // contacts: of no change, against a bone's mean gap
static const float LOCAL_PRIOR_WEIGHT = 5; // contacts: of the bone's mean gap, against the local one

// The part of the viewing ray that is searched, relative to the depth seen beside the silhouette.
static const double SEARCH_BEFORE_M = 0.05, SEARCH_BEHIND_M = 0.12, STEP_M = 0.01;
static const double MIN_GRADIENT = 0.3; // without unit; where it is less the distance field has no clear normal

// ---------------------------------------------------------------- points

static int find_at_pixel(const struct depth_frame *frame, int x, int y, struct silhouette_point *points, int capacity)
{
    static const int8_t steps[4][2] = {{1, 0}, {-1, 0}, {0, 1}, {0, -1}};
    const float out = 0.5F - (float)DEPTH_FRAME_RIM_PX; // from the background pixel inwards
    int count = 0;
    for (int k = 0; k < 4 && count < capacity; k++) {
        const int inside =
            depth_frame_step_inside(frame, y * frame->width + x, steps[k][1] * frame->width + steps[k][0]);
        if (inside >= 0)
            points[count++] =
                (struct silhouette_point){(float)x + out * (float)steps[k][0], (float)y + out * (float)steps[k][1],
                                          inside, steps[k][0], steps[k][1]};
    }
    return count;
}

// Stops when SILHOUETTE_POINTS_MAX are found.
static int find_with_stride(const struct depth_frame *frame, int every,
                            struct silhouette_point points[SILHOUETTE_POINTS_MAX])
{
    enum { MARGIN = DEPTH_FRAME_INWARD_PX + 1 };
    const int left = frame->left - 1 > MARGIN ? frame->left - 1 : MARGIN,
              top = frame->top - 1 > MARGIN ? frame->top - 1 : MARGIN;
    int count = 0;
    for (int y = top; y <= frame->bottom + 1 && y < frame->height - MARGIN; y++)
        for (int x = left + y % every; x <= frame->right + 1 && x < frame->width - MARGIN; x += every)
            if (frame->part[y * frame->width + x] == DEPTH_FRAME_BACKGROUND)
                count += find_at_pixel(frame, x, y, points + count, SILHOUETTE_POINTS_MAX - count);
    return count;
}

int silhouette_find_points(const struct depth_frame *depth_frame, struct silhouette_point points[SILHOUETTE_POINTS_MAX])
{
    int every = EVERY_PX, count;
    while ((count = find_with_stride(depth_frame, every, points)) == SILHOUETTE_POINTS_MAX)
        every++;
    return count;
}

int silhouette_point_bone(const struct bind_pose *bind_pose, const struct depth_frame *depth_frame,
                          const struct silhouette_point *point, const struct pose bind_from_color[BONE_COUNT])
{
    const struct vec3 beside = source_rays_point(depth_frame->rays, point->inside, depth_frame->depth[point->inside]);
    return bind_pose_bone_at(bind_pose, (enum part)depth_frame->part[point->inside], beside, bind_from_color);
}

bool silhouette_find_contact(const struct tsdf *tsdf, const struct calibration *calibration,
                             const struct depth_frame *depth_frame, const struct silhouette_point *point,
                             struct pose bind_from_color, struct silhouette_contact *out)
{
    const struct pose color_from_depth = calibration->color_from_depth;
    const struct pose bind_from_depth = pose_multiply(bind_from_color, color_from_depth);
    const struct vec3 ray = lens_ray(&calibration->depth, (struct pixel){(double)point->x, (double)point->y});
    const struct vec3 along = quat_rotate(bind_from_depth.rotation, ray);
    const double z = depth_frame->depth[point->inside] * 1e-3;
    double min = NAN, min_z = 0;
    struct vec3 normal = {0, 0, 0};
    for (double at = z - SEARCH_BEFORE_M; at <= z + SEARCH_BEHIND_M; at += STEP_M) {
        double distance, seen;
        struct vec3 gradient;
        if (tsdf_sample(tsdf, v3_add(bind_from_depth.translation, v3_scale(along, at)), &distance, &gradient, &seen) &&
            !(distance >= min))
            min = distance, min_z = at, normal = gradient;
    }
    if (isnan(min) || v3_length(normal) < MIN_GRADIENT)
        return false;
    *out =
        (struct silhouette_contact){.gap = min,
                                    .at = pose_apply(color_from_depth, v3_scale(ray, min_z)),
                                    .normal = v3_unit(normal),
                                    .inward = quat_rotate(color_from_depth.rotation, v3(point->in_x, point->in_y, 0))};
    return true;
}

// ---------------------------------------------------------------- thickness

void silhouette_measure(const struct tsdf *tsdf, const struct calibration *calibration,
                        const struct depth_frame *depth_frame, const struct bone_transforms *transforms,
                        struct silhouette_gaps *gaps)
{
    struct silhouette_point points[SILHOUETTE_POINTS_MAX];
    struct pose bind_from_color[BONE_COUNT];
    for (int b = 0; b < BONE_COUNT; b++)
        bind_from_color[b] = pose_inverse(transforms->bone[b]);
    const int count = silhouette_find_points(depth_frame, points);
    for (int i = 0; i < count; i++) {
        const int bone = silhouette_point_bone(tsdf_bind_pose(tsdf), depth_frame, &points[i], bind_from_color);
        struct silhouette_contact contact;
        if (!tsdf_bind_pose(tsdf)->known[bone] ||
            !silhouette_find_contact(tsdf, calibration, depth_frame, &points[i], bind_from_color[bone], &contact))
            continue;
        const struct vec3 in_bind_pose = pose_apply(bind_from_color[bone], contact.at);
        const struct chart_sample here = chart_sample_at(&tsdf_bind_pose(tsdf)->frame[bone], in_bind_pose);
        bone_chart_add(&gaps->sum[bone], &here, (float)contact.gap);
        bone_chart_add(&gaps->count[bone], &here, 1);
    }
}

void silhouette_gaps_add(struct silhouette_gaps *to, const struct silhouette_gaps *gaps)
{
    for (int b = 0; b < BONE_COUNT; b++)
        for (int i = 0; i < CHART_HEIGHTS * CHART_ANGLES; i++) {
            to->sum[b].at[i] += gaps->sum[b].at[i];
            to->count[b].at[i] += gaps->count[b].at[i];
        }
}

void tsdf_match_silhouettes(struct tsdf *tsdf, const struct silhouette_gaps *gaps)
{
    struct bone_chart out_m[BONE_COUNT];
    for (int b = 0; b < BONE_COUNT; b++) {
        struct bone_chart sum = gaps->sum[b], count = gaps->count[b];
        const float whole = (float)bone_chart_sum(&sum) / ((float)bone_chart_sum(&count) + PRIOR_WEIGHT);
        bone_chart_smooth(&sum);
        bone_chart_smooth(&count);
        for (int i = 0; i < CHART_HEIGHTS * CHART_ANGLES; i++)
            out_m[b].at[i] = (sum.at[i] + LOCAL_PRIOR_WEIGHT * whole) / (count.at[i] + LOCAL_PRIOR_WEIGHT);
    }
    tsdf_offset(tsdf, out_m);
}
