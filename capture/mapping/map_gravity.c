// World axes of a new map: up from the tags or from the surfaces in the depth, also of a sensor that hung upside down;
// the floor as a robust plane fit.
#include "base/linear_algebra.h"
#include "capture/mapping/map_internal.h"

#include <stdlib.h>

// All chosen by hand.
static const double ALIGNED_COS = 0.985; // 10 degrees: how parallel tags hung by hand are
static const double FLAT_COS = 0.94;     // 20 degrees: a surface that may be floor
static const double TILT_RAD = 0.14;     // 8 degrees: the largest correction of the tags' up by the floor
enum { STEP_PX = 8, REACH_PX = 6, BINS = 800, MAX_SURFACE_POINTS = 200000, MAX_UP_CANDIDATES = 3000 };
static const double MAX_CAMERA_TILT_COS = 0.64;           // 50 degrees: a camera is seldom tilted more
static const double LEVEL_COS = 0.99, UPRIGHT_COS = 0.14; // 8 degrees
static const double BIN_M = 0.01;
// The camera hung upside down where so many times as much surface faces the other way, also without the lowest plane's.
// Of two sweeps that it was settled on (dance, tum-rpy) and one that was left out (kitchen) 0.2 to 0.4 times as much
// does, and upside down 2.3 times and more.
static const double OTHER_WAY = 2, OTHER_WAY_M2 = 0.5;

// A tag's axis that may point up: 0..3 are +y, -y, +x, -x (on a wall, in any quarter turn; tags printed by OpenCV 4 are
// upside down), 4 is +z (lying).
static struct vec3 tag_direction(const struct map_tag *tag, int which)
{
    static const struct vec3 own[5] = {{0, 1, 0}, {0, -1, 0}, {1, 0, 0}, {-1, 0, 0}, {0, 0, 1}};
    return quat_rotate(tag->world_from_tag.rotation, own[which]);
}

struct surface_samples {
    struct vec3 *points, *normals; // world
    double *weights, *areas;
    int32_t count;
};

static bool depth_point(const struct map *map, const struct map_frame *frame, int x, int y, struct vec3 *out)
{
    const struct lens *lens = &map->calibration.color;
    if (x < 0 || y < 0 || x >= lens->width || y >= lens->height)
        return false;
    double z = frame->depth[(size_t)y * (size_t)lens->width + (size_t)x] * 1e-3 * map->depth_scale;
    if (!(z > 0.3) || z > 6)
        return false;
    *out = v3_scale(lens_ray(lens, (struct pixel){x, y}), z);
    return true;
}

// Adds the depth sample at (x, y) with its surface normal, from the neighbours REACH_PX away; nothing where one is
// missing or the surface is seen at a grazing angle.
static void add_surface_sample(const struct map *map, const struct map_frame *frame, struct pixel at, int step,
                               struct surface_samples *samples)
{
    const struct lens *lens = &map->calibration.color;
    const struct pose world_from_camera = pose_inverse(frame->camera_from_world);
    const int x = (int)at.x, y = (int)at.y;
    struct vec3 p, l, r, t, b;
    if (samples->count == MAX_SURFACE_POINTS || !depth_point(map, frame, x, y, &p) ||
        !depth_point(map, frame, x - REACH_PX, y, &l) || !depth_point(map, frame, x + REACH_PX, y, &r) ||
        !depth_point(map, frame, x, y - REACH_PX, &t) || !depth_point(map, frame, x, y + REACH_PX, &b))
        return;
    struct vec3 normal = v3_unit(v3_cross(v3_sub(r, l), v3_sub(t, b))); // towards the camera
    double facing = -v3_dot(normal, v3_unit(p));
    if (facing < 0.1)
        return;
    samples->points[samples->count] = pose_apply(world_from_camera, p);
    samples->normals[samples->count] = quat_rotate(world_from_camera.rotation, normal);
    samples->weights[samples->count] = 1 / (depth_absolute_sigma_m(p.z) * depth_absolute_sigma_m(p.z));
    samples->areas[samples->count++] = p.z * p.z * step * step / (lens->fx * lens->fy * facing);
}

// Depth samples of all frames on a grid, with normals; the grid is coarse enough for MAX_SURFACE_POINTS.
static void collect_surface(const struct map *map, struct surface_samples *samples)
{
    const struct lens *lens = &map->calibration.color;
    int32_t images = 0;
    for (int32_t i = 0; i < map->frame_count; i++)
        images += map->frames[i].placed && map->frames[i].depth;
    int step = STEP_PX;
    while ((int64_t)images * (lens->width / step) * (lens->height / step) > MAX_SURFACE_POINTS)
        step += 2;
    for (int32_t i = 0; i < map->frame_count; i++) {
        const struct map_frame *f = &map->frames[i];
        if (!f->placed || !f->depth)
            continue;
        for (int y = step; y < lens->height - step; y += step)
            for (int x = step; x < lens->width - step; x += step)
                add_surface_sample(map, f, (struct pixel){x, y}, step, samples);
    }
}

// The samples of `all` whose normal points up, without their normals. flat: as many elements as all.
static void select_horizontal(const struct surface_samples *all, struct vec3 up, struct surface_samples *flat)
{
    flat->count = 0;
    for (int32_t i = 0; i < all->count; i++) {
        if (v3_dot(all->normals[i], up) < FLAT_COS)
            continue;
        flat->points[flat->count] = all->points[i];
        flat->weights[flat->count] = all->weights[i];
        flat->areas[flat->count++] = all->areas[i];
    }
}

// The mean up direction of the image, world axes.
static struct vec3 mean_camera_up(const struct map *map)
{
    struct vec3 held = v3(0, 0, 0);
    for (int32_t i = 0; i < map->frame_count; i++)
        if (map->frames[i].placed)
            held = v3_add(held, quat_rotate(quat_conjugate(map->frames[i].camera_from_world.rotation), v3(0, -1, 0)));
    return v3_unit(held);
}

// Up by gravity, which odometry knows: the mean over the placed frames that have it. False: none has.
static bool up_from_odometry(const struct map *map, struct vec3 *up)
{
    struct vec3 sum = v3(0, 0, 0);
    for (int32_t i = 0; i < map->frame_count; i++) {
        const struct map_frame *f = &map->frames[i];
        const struct vec3 in_camera = quat_rotate(quat_conjugate(f->odometry_from_camera.rotation), v3(0, 0, 1));
        if (f->placed && f->has_odometry)
            sum = v3_add(sum, quat_rotate(quat_conjugate(f->camera_from_world.rotation), in_camera));
    }
    if (!(v3_length(sum) > 0))
        return false;
    *up = v3_unit(sum);
    return true;
}

// Votes of all tags for direction d: each votes with its first axis that is parallel to d. *sum: the sum of those axes.
static double count_votes(const struct map *map, struct vec3 d, struct vec3 *sum)
{
    double votes = 0;
    *sum = v3(0, 0, 0);
    for (int32_t k = 0; k < map->tag_count; k++)
        for (int v = 0; v < 5 && map->tags[k].mapped; v++) {
            struct vec3 other = tag_direction(&map->tags[k], v);
            if (v3_dot(other, d) > ALIGNED_COS) {
                *sum = v3_add(*sum, other);
                votes += v < 2 || v == 4 ? 1 : 0.8; // few hang tags sideways
                break;
            }
        }
    return votes;
}

// Up by a vote of the tags; where that is ambiguous (all tags on one wall), the direction nearest to the camera's mean
// up direction `held`.
static struct vec3 up_from_tags(const struct map *map, struct vec3 held)
{
    struct vec3 best = v3(0, 0, 0);
    double max = -1e9;
    for (int32_t i = 0; i < map->tag_count; i++) {
        for (int w = 0; w < 5 && map->tags[i].mapped; w++) {
            struct vec3 d = tag_direction(&map->tags[i], w), sum;
            double votes = count_votes(map, d, &sum);
            double score = votes + 2 * v3_dot(d, held);
            if (score > max) {
                max = score;
                best = v3_unit(sum);
            }
        }
    }
    return best;
}

// Up from surfaces (Manhattan-world assumption): most surfaces in a room are horizontal or vertical. Among the normals
// near the camera's mean up direction, the one with most surface area parallel or perpendicular to it.
static struct vec3 up_from_surfaces(const struct surface_samples *samples, struct vec3 held)
{
    struct vec3 best = held;
    double max = 0;
    int32_t step = samples->count / MAX_UP_CANDIDATES + 1;
    for (int32_t i = 0; i < samples->count; i += step) {
        struct vec3 d = samples->normals[i], sum = v3(0, 0, 0);
        double area = 0;
        if (v3_dot(d, held) < MAX_CAMERA_TILT_COS)
            continue;
        for (int32_t k = 0; k < samples->count; k += step) {
            double along = v3_dot(samples->normals[k], d);
            if (along > LEVEL_COS)
                sum = v3_add(sum, v3_scale(samples->normals[k], samples->areas[k]));
            if (along > LEVEL_COS || fabs(along) < UPRIGHT_COS)
                area += samples->areas[k];
        }
        if (area > max) {
            max = area;
            best = v3_unit(sum);
        }
    }
    return best;
}

// The lowest height with much horizontal surface: the lowest large peak of a histogram of area by height. False: none.
static bool lowest_plane_height(const struct surface_samples *samples, struct vec3 up, double *height)
{
    double area[BINS] = {0}, low = 1e9, max = 0;
    for (int32_t i = 0; i < samples->count; i++)
        low = fmin(low, v3_dot(up, samples->points[i]));
    for (int32_t i = 0; i < samples->count; i++) {
        int bin = (int)((v3_dot(up, samples->points[i]) - low) / BIN_M);
        if (bin >= 0 && bin < BINS)
            area[bin] += samples->areas[i];
    }
    double level[BINS] = {0};
    for (int i = 0; i < BINS; i++) {
        for (int k = -3; k <= 3; k++)
            level[i] += i + k >= 0 && i + k < BINS ? area[i + k] : 0;
        max = fmax(max, level[i]);
    }
    if (max < 0.5) // square metres; the same floor counts once for each frame
        return false;
    for (int i = 0; i < BINS; i++) {
        bool peak = level[i] > 0.3 * max;
        for (int k = -5; k <= 5; k++)
            peak = peak && (i + k < 0 || i + k >= BINS || level[i] >= level[i + k]);
        if (peak) {
            *height = low + (i + 0.5) * BIN_M;
            return true;
        }
    }
    return false;
}

// Fits the plane up . p = height to the samples near it: iteratively reweighted least squares with a Geman-McClure
// kernel. False: too few samples, less than 0.2 m of spread in one direction, or a tilt above TILT_RAD.
static bool fit_floor(const struct surface_samples *samples, struct vec3 *up, double *height)
{
    struct vec3 u = *up, x = v3_perpendicular(u), y = v3_cross(u, x);
    double a = 0, b = 0, c = *height;
    for (int round = 0; round < 6; round++) {
        double n[9] = {0}, g[3] = {0};
        for (int32_t i = 0; i < samples->count; i++) {
            double px = v3_dot(x, samples->points[i]), py = v3_dot(y, samples->points[i]);
            double error = v3_dot(u, samples->points[i]) - (a * px + b * py + c), sigma = 1 / sqrt(samples->weights[i]);
            double bound = fmax(2 * sigma, round ? 0.01 : 0.03), weight = samples->weights[i];
            weight /= (1 + error * error / (bound * bound)) * (1 + error * error / (bound * bound));
            const double q[3] = {px, py, 1};
            for (int k = 0; k < 3; k++) {
                g[k] += weight * q[k] * (error + a * px + b * py + c);
                for (int l = 0; l < 3; l++)
                    n[k * 3 + l] += weight * q[k] * q[l];
            }
        }
        double total = n[8], mx = n[6] / total, my = n[7] / total;
        double xx = n[0] / total - mx * mx, yy = n[4] / total - my * my, xy = n[3] / total - mx * my;
        double narrow = (xx + yy) / 2 - sqrt((xx - yy) * (xx - yy) / 4 + xy * xy);
        if (!(narrow > 0.2 * 0.2) || !cholesky_factor(n, 3))
            return false;
        cholesky_solve(n, 3, g);
        a = g[0], b = g[1], c = g[2];
    }
    if (!(atan(hypot(a, b)) < TILT_RAD))
        return false;
    struct vec3 normal = v3_sub(u, v3_add(v3_scale(x, a), v3_scale(y, b)));
    double length = v3_length(normal);
    *up = v3_scale(normal, 1 / length);
    *height = c / length;
    return true;
}

static void surface_samples_free(struct surface_samples *samples)
{
    free(samples->points);
    free(samples->normals);
    free(samples->weights);
    free(samples->areas);
}

static bool surface_samples_alloc(struct surface_samples *samples)
{
    *samples = (struct surface_samples){
        malloc(MAX_SURFACE_POINTS * sizeof(struct vec3)), malloc(MAX_SURFACE_POINTS * sizeof(struct vec3)),
        malloc(MAX_SURFACE_POINTS * sizeof(double)), malloc(MAX_SURFACE_POINTS * sizeof(double)), 0};
    return samples->points && samples->normals && samples->weights && samples->areas;
}

// What faces up: all of it, and what is not the lowest plane, as tables and seats are.
struct facing {
    double all_m2, higher_m2;
};

static struct facing area_facing(const struct surface_samples *all, struct vec3 up, struct surface_samples *flat)
{
    const double thick_m = 0.15;
    struct facing f = {0, 0};
    double lowest = 0;
    select_horizontal(all, up, flat);
    if (!lowest_plane_height(flat, up, &lowest))
        return f;
    for (int32_t i = 0; i < flat->count; i++) {
        f.all_m2 += flat->areas[i];
        f.higher_m2 += v3_dot(up, flat->points[i]) > lowest + thick_m ? flat->areas[i] : 0;
    }
    return f;
}

// Up if the camera was held with its own up as `held`.
static struct vec3 up_for(const struct map *map, const struct surface_samples *all, struct vec3 held)
{
    return map->tag_count ? up_from_tags(map, held) : up_from_surfaces(all, held);
}

// Up: by odometry; else by tags or surfaces, both of which leave open which way round: as the camera was held, unless
// what it saw stands on its head. A room has floor, seats and tables that face up, and little but the ceiling faces
// down. A tag tells nothing: some print theirs upside down, and some hang them on the ceiling.
static struct vec3 find_up(const struct map *map, const struct surface_samples *all, struct surface_samples *flat)
{
    struct vec3 by_gravity;
    if (up_from_odometry(map, &by_gravity))
        return by_gravity;
    const struct vec3 held = mean_camera_up(map), up = up_for(map, all, held),
                      other = up_for(map, all, v3_scale(held, -1));
    const struct facing as_held = area_facing(all, up, flat), turned = area_facing(all, other, flat);
    const bool hung =
        turned.all_m2 > OTHER_WAY * as_held.all_m2 && turned.higher_m2 > OTHER_WAY * as_held.higher_m2 + OTHER_WAY_M2;
    return hung ? other : up;
}

// Up, by odometry, by tags where there are some, else by surfaces, and the floor's height along
// it where it was seen in depth: OK, else NOTHING and *height unchanged.
static enum status find_floor(const struct map *map, struct vec3 *up, double *height)
{
    struct surface_samples all = {0}, flat = {0};
    enum status status = NOTHING;
    bool allocated = surface_samples_alloc(&all) && surface_samples_alloc(&flat);
    if (allocated && map->calibration.registered && map->calibration.depth.width)
        collect_surface(map, &all);
    if (allocated) {
        *up = find_up(map, &all, &flat);
        select_horizontal(&all, *up, &flat);
        // Twice: the first time `up` is only as accurate as the tags hang.
        for (int round = 0; round < 2; round++)
            if (lowest_plane_height(&flat, *up, height) && fit_floor(&flat, up, height))
                status = OK;
    } else {
        status = fail(ERR_MEMORY, "no memory to look for the floor");
    }
    surface_samples_free(&all);
    surface_samples_free(&flat);
    return status;
}

static void transform_map(struct map *map, struct pose new_from_old)
{
    struct pose old_from_new = pose_inverse(new_from_old);
    for (int32_t i = 0; i < map->frame_count; i++)
        if (map->frames[i].placed)
            map->frames[i].camera_from_world = pose_multiply(map->frames[i].camera_from_world, old_from_new);
    for (int32_t i = 0; i < map->tag_count; i++)
        if (map->tags[i].mapped)
            map->tags[i].world_from_tag = pose_multiply(new_from_old, map->tags[i].world_from_tag);
    for (int32_t i = 0; i < map->point_count; i++)
        map->points[i].world = pose_apply(new_from_old, map->points[i].world);
}

// The tag with the lowest id, or NULL; *lowest: the least height of any corner.
static const struct map_tag *first_tag(const struct map *map, struct vec3 up, double *lowest)
{
    const struct map_tag *first = NULL;
    for (int32_t i = 0; i < map->tag_count; i++) {
        const struct map_tag *tag = &map->tags[i];
        if (!tag->mapped)
            continue;
        if (!first || tag->id < first->id)
            first = tag;
        struct place_tag own = {.side_m = tag->side_m, .world_from_tag = tag->world_from_tag};
        struct vec3 corner[4];
        place_tag_corners(&own, corner);
        for (int k = 0; k < 4; k++)
            *lowest = fmin(*lowest, v3_dot(up, corner[k]));
    }
    return first;
}

// The direction that x approximates, and the point where x = y = 0.
static void axes_from_tag(const struct map_tag *tag, struct vec3 up, struct vec3 *x, struct vec3 *origin)
{
    // The tag's own x; its y where it hangs sideways and x is steep.
    *x = quat_rotate(tag->world_from_tag.rotation, v3(1, 0, 0));
    if (fabs(v3_dot(*x, up)) > 0.8)
        *x = quat_rotate(tag->world_from_tag.rotation, v3(0, 1, 0));
    *origin = tag->world_from_tag.translation;
}

static void axes_from_frame(const struct map *map, struct vec3 up, struct vec3 *x, struct vec3 *origin)
{
    int32_t i = 0;
    while (!map->frames[i].placed)
        i++;
    struct pose world_from_camera = pose_inverse(map->frames[i].camera_from_world);
    struct vec3 ahead = quat_rotate(world_from_camera.rotation, v3(0, 0, 1));
    if (fabs(v3_dot(ahead, up)) > 0.9) // it was pointed at the floor or the ceiling
        ahead = quat_rotate(world_from_camera.rotation, v3(0, -1, 0));
    *x = v3_cross(ahead, up);
    *origin = world_from_camera.translation;
}

static double lowest_point(const struct map *map, struct vec3 up)
{
    double low = map->point_count ? 1e9 : 0;
    for (int32_t i = 0; i < map->point_count; i++)
        low = fmin(low, v3_dot(up, map->points[i].world));
    return low;
}

enum status map_align_gravity(struct map *map, bool *floor)
{
    struct vec3 up, x, origin;
    double height = 1e9, lowest = 1e9;
    enum status status = find_floor(map, &up, &height);
    if (status < 0)
        return status;
    *floor = status == OK;
    const struct map_tag *first = first_tag(map, up, &lowest);
    if (first)
        axes_from_tag(first, up, &x, &origin);
    else
        axes_from_frame(map, up, &x, &origin);
    if (!*floor)
        height = first ? lowest : lowest_point(map, up);
    x = v3_unit(v3_sub(x, v3_scale(up, v3_dot(x, up))));
    struct vec3 y = v3_cross(up, x);
    double rotation[3][3] = {{x.x, x.y, x.z}, {y.x, y.y, y.z}, {up.x, up.y, up.z}};
    struct pose new_from_old = {quat_from_matrix(rotation), {0, 0, 0}};
    struct vec3 centre = quat_rotate(new_from_old.rotation, origin);
    new_from_old.translation = v3(-centre.x, -centre.y, -height);
    transform_map(map, new_from_old);
    return OK;
}
