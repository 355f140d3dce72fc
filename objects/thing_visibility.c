#include "objects/thing_visibility.h"

// Chosen by hand, on the safe side of what is recognised. LEAST_PX: side of a square of as many pixels as it covers;
// LEAST_FACING: cosine of the angle at which it is seen; MARGIN_PX: from the image's edge.
#define LEAST_PX     60.0
#define LEAST_FACING 0.72
#define MARGIN_PX    6.0
#define NEAREST_M    0.25
// Depth: NEARER_M + NEARER_SHARE of the distance nearer than the thing is before it, so much farther is beyond it. Of
// the samples at most HIDDEN_SHARE may be before it, at least READ_SHARE must be there, and EMPTY_SHARE of those make
// the place empty.
#define NEARER_M     0.04
#define NEARER_SHARE 0.02
#define HIDDEN_SHARE 0.1
#define READ_SHARE   0.5
#define EMPTY_SHARE  0.7
enum { SIDE = 9 };

// The pixels that its front covers; 0: a corner is not well inside the image.
static double covered_px(const struct thing *t, const struct pose *camera_from_thing, const struct lens *lens)
{
    static const double corner[4][2] = {{-0.5, -0.5}, {0.5, -0.5}, {0.5, 0.5}, {-0.5, 0.5}};
    const double largest = lens_max_radius2(lens);
    struct pixel px[4];
    double area = 0;
    for (int i = 0; i < 4; i++) {
        const struct vec3 p =
            pose_apply(*camera_from_thing, v3(corner[i][0] * t->width_m, corner[i][1] * t->height_m, 0));
        if (!(p.z > NEAREST_M))
            return 0;
        px[i] = lens_project_clamped(lens, largest, p);
        if (px[i].x < MARGIN_PX || px[i].y < MARGIN_PX || px[i].x > lens->width - 1 - MARGIN_PX ||
            px[i].y > lens->height - 1 - MARGIN_PX)
            return 0;
    }
    for (int i = 0; i < 4; i++)
        area += px[i].x * px[(i + 1) % 4].y - px[(i + 1) % 4].x * px[i].y;
    return fabs(area) / 2;
}

// The depth sample at a point, over the point's own depth; 0: none.
static double depth_ratio(const struct depth_view *view, struct vec3 in_camera, double *z_m)
{
    const struct vec3 p = pose_apply(view->depth_from_color, in_camera);
    *z_m = p.z;
    if (!(p.z > 0.1))
        return 0;
    const struct pixel px = lens_project(&view->lens, p);
    const double x = floor(px.x + 0.5), y = floor(px.y + 0.5);
    if (!(x >= 0 && y >= 0 && x < view->lens.width && y < view->lens.height))
        return 0;
    return view->depth[(size_t)y * (size_t)view->lens.width + (size_t)x] * 1e-3 / p.z;
}

enum thing_sight thing_sight_of(const struct thing *thing, struct pose camera_from_thing, const struct lens *lens,
                                const struct depth_view *depth)
{
    const struct vec3 to_thing = camera_from_thing.translation;
    const double facing = v3_dot(quat_rotate(camera_from_thing.rotation, v3(0, 0, 1)), v3_unit(to_thing));
    if (!depth || !(to_thing.z > NEAREST_M) || facing < LEAST_FACING ||
        covered_px(thing, &camera_from_thing, lens) < LEAST_PX * LEAST_PX)
        return SIGHT_NONE;
    int read = 0, before = 0, beyond = 0;
    for (int i = 0; i < SIDE * SIDE; i++) {
        const double u = (double)(i % SIDE) / (SIDE - 1) - 0.5, v = (double)(i / SIDE) / (SIDE - 1) - 0.5;
        const struct vec3 at = v3(0.9 * u * thing->width_m, 0.9 * v * thing->height_m, 0);
        double z_m;
        const double ratio = depth_ratio(depth, pose_apply(camera_from_thing, at), &z_m);
        if (!(ratio > 0))
            continue;
        const double off_m = (ratio - 1) * z_m, clear_m = NEARER_M + NEARER_SHARE * z_m;
        read++;
        before += off_m < -clear_m;
        // A solid of revolution bends away from its front by half its width.
        beyond += off_m > clear_m + thing->width_m / 2;
    }
    if (read < READ_SHARE * SIDE * SIDE || before > HIDDEN_SHARE * read)
        return SIGHT_NONE;
    return beyond >= EMPTY_SHARE * read ? SIGHT_EMPTY : SIGHT_OCCUPIED;
}
