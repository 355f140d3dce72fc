// Starting and dropping the locator's tracks.
#include "locate/locator_internal.h"

#include <string.h>

struct vec3 locator_point_in_camera(const struct locator *l, const struct pose *camera_from_world, struct vec3 world,
                                    double time_s)
{
    return shutter_apply_motion(l->motion, time_s, pose_apply(*camera_from_world, world));
}

void locator_add_track(struct locator *l, int32_t point, struct vec3 world, const double seen[3], struct pixel at,
                       const struct pose *camera_from_world)
{
    if (l->track_count == LOCATOR_MAX_TRACKS)
        return;
    struct point_track *t = &l->tracks[l->track_count];
    double time_s = shutter_row_time(&l->lens, at.y);
    struct vec3 p = locator_point_in_camera(l, camera_from_world, world, time_s), ray = lens_ray(&l->lens, at);
    *t = (struct point_track){.point = point, .world = world, .at = at, .ray = ray, .time_s = time_s};
    memcpy(t->seen, seen, sizeof t->seen);
    t->bias[0] = point < 0 ? 0 : l->lens.fx * (ray.x - p.x / p.z);
    t->bias[1] = point < 0 ? 0 : l->lens.fy * (ray.y - p.y / p.z);
    t->bias_variance = point < 0 ? LOCATOR_CORNER_PX * LOCATOR_CORNER_PX : LOCATOR_TRACKING_PX * LOCATOR_TRACKING_PX;
    t->noise[0] = t->noise[2] = LOCATOR_TRACKING_PX * LOCATOR_TRACKING_PX;
    t->template_view = v3_sub(pose_inverse(*camera_from_world).translation, world);
    l->track_count += klt_patch_extract(&l->pyramid, at, &t->patch);
}

void locator_drop_track(struct locator *l, int i)
{
    l->track_count--;
    if (i < l->track_count)
        l->tracks[i] = l->tracks[l->track_count];
}
