// The rolling shutter of a sweep: undone in the observations, and its read-out time found where nobody gave it.
#include "base/linear_algebra.h"
#include "capture/mapping/map_internal.h"
#include "locate/rolling_shutter.h"

#include <string.h>

// ---------------------------------------------------------------- undoing it

// Moves each observation to where the camera at the middle row's time would have
// seen it. Inputs are the raw observation, the camera path through the neighbouring frames, and the depth of what was
// seen in the present map, so the correction improves as the map does. Depth is assumed to be exposed with the colour
// of its pixel.

static const double MAX_GAP_S = 0.5; // between frames whose poses give a velocity. Chosen by hand

enum { NEIGHBOURS = 2, MAX_PATH_SAMPLES = 2 * NEIGHBOURS + 1 };

// The camera's motion around one frame: middle_from_camera at the times of the neighbouring frames; 6-vectors of
// rotation vector (rad), then translation (m), in the axes of the middle row's camera.
struct camera_path {
    double time_s[MAX_PATH_SAMPLES]; // since the frame; the first is the frame itself, at 0
    double at[MAX_PATH_SAMPLES][6];
    int count;
};

static void add_path_sample(struct camera_path *path, const struct map_frame *frame, const struct map_frame *other)
{
    struct pose p = pose_multiply(frame->camera_from_world, pose_inverse(other->camera_from_world));
    struct vec3 rotation = quat_to_rotation_vector(p.rotation);
    const double at[6] = {rotation.x, rotation.y, rotation.z, p.translation.x, p.translation.y, p.translation.z};
    path->time_s[path->count] = (double)(other->time_ns - frame->time_ns) * 1e-9;
    memcpy(path->at[path->count++], at, sizeof at);
}

// A hand-held camera that reverses within a few frames does not move uniformly while one of them is read out, so two
// frames on each side are used. False: no usable neighbour.
static bool camera_path_around(const struct map *map, int32_t i, struct camera_path *out)
{
    const struct map_frame *f = &map->frames[i];
    out->count = 1;
    out->time_s[0] = 0;
    memset(out->at[0], 0, sizeof out->at[0]);
    for (int side = -1; side <= 1; side += 2)
        for (int n = 1; n <= NEIGHBOURS; n++) {
            int32_t k = i + side * n;
            if (k < 0 || k >= map->frame_count || !map->frames[k].placed)
                break;
            double gap_s = side * (double)(map->frames[k].time_ns - map->frames[k - side].time_ns) * 1e-9;
            if (gap_s < map->calibration.color.readout_s / 2 || gap_s > MAX_GAP_S) // the first: a wrong time stamp
                break;
            add_path_sample(out, f, &map->frames[k]);
        }
    return out->count > 1;
}

// Lagrange polynomial through all samples.
static void interpolate_path(const struct camera_path *path, double time_s, double out[6])
{
    memset(out, 0, 6 * sizeof *out);
    for (int i = 1; i < path->count; i++) {
        double share = 1;
        for (int k = 0; k < path->count; k++)
            if (k != i)
                share *= (time_s - path->time_s[k]) / (path->time_s[i] - path->time_s[k]);
        for (int j = 0; j < 6; j++)
            out[j] += share * path->at[i][j];
    }
}

// The point p, axes of the camera at the time of row `row`, in the axes of the camera at the middle row.
static struct vec3 to_middle_row(const struct lens *lens, const struct camera_path *path, double row, struct vec3 p)
{
    double motion[6];
    interpolate_path(path, shutter_row_time(lens, row), motion);
    return v3_add(quat_rotate(quat_from_rotation_vector(v3(motion[0], motion[1], motion[2])), p),
                  v3(motion[3], motion[4], motion[5]));
}

static void correct_tag(const struct map *map, struct map_frame *frame, int32_t k, const struct camera_path *path)
{
    const struct lens *lens = &map->calibration.color;
    const struct map_tag *tag = &map->tags[frame->tag_index[k]];
    const struct place_tag own = {.side_m = tag->side_m, .world_from_tag = tag->world_from_tag};
    struct vec3 corner[4];
    place_tag_corners(&own, corner);
    for (int c = 0; c < 4 && tag->mapped; c++) {
        struct vec3 ray = frame->raw_seen[k].ray[c];
        double z = pose_apply(frame->camera_from_world, corner[c]).z;
        struct vec3 p = to_middle_row(lens, path, lens_project(lens, ray).y, v3_scale(ray, z));
        if (z > 0 && p.z > 0)
            frame->seen[k].ray[c] = v3_scale(p, 1 / p.z);
    }
    for (int i = 0; i < frame->depths[k].count; i++) {
        struct depth_sample s = frame->raw_depths[k].sample[i];
        struct vec3 ray = v3(s.x, s.y, 1);
        struct vec3 p = to_middle_row(lens, path, lens_project(lens, ray).y, v3_scale(ray, s.z));
        if (p.z > 0)
            frame->depths[k].sample[i] = (struct depth_sample){p.x / p.z, p.y / p.z, p.z};
    }
}

static void correct_feature(const struct map *map, const struct map_frame *frame, struct map_feature *feature,
                            const struct camera_path *path)
{
    static const double FAR_M = 1e6; // where only the rotation counts
    const struct lens *lens = &map->calibration.color;
    double z = feature->raw_depth;
    if (!(z > 0))
        z = feature->point >= 0 ? pose_apply(frame->camera_from_world, map->points[feature->point].world).z : FAR_M;
    struct vec3 p = to_middle_row(lens, path, feature->raw_pixel.y, v3_scale(lens_ray(lens, feature->raw_pixel), z));
    if (!(z > 0) || !(p.z > 0))
        return;
    feature->feature.at = lens_project(lens, p);
    feature->depth = feature->raw_depth > 0 ? p.z : 0;
}

void map_undo_rolling_shutter(struct map *map)
{
    for (int32_t i = 0; map->calibration.color.readout_s > 0 && i < map->frame_count; i++) {
        struct map_frame *f = &map->frames[i];
        struct camera_path path;
        if (!f->placed || !camera_path_around(map, i, &path))
            continue;
        for (int32_t k = 0; k < f->seen_count; k++)
            correct_tag(map, f, k, &path);
        for (int32_t k = 0; k < f->feature_count; k++)
            correct_feature(map, f, &f->features[k], &path);
    }
}

// ---------------------------------------------------------------- noticing it

// Whether a longer read-out time would fit better: the sign and the significance of the change by one Gauss-Newton
// step. A row that is read later has to be moved farther along the camera's path. The pose of each frame is eliminated
// from its own equations (Schur complement), since it takes up what all rows have in common; landmarks are held, which
// makes the step too small where they have taken up the shutter, but leaves its sign. Errors within a frame are alike,
// so that the standard deviation is by frames (White 1980, clustered).

static const double STEP_S = 1e-3;   // of the derivative by the read-out time
static const double ROBUST_PX = 3;   // scale of the Cauchy kernel, of features of the finest level
static const double SURE_SIGMAS = 3; // chosen by hand: what is noticed is then judged by the adjusted map's cost
enum { POSE = 6, READOUT_FRAMES_MIN = 10, READOUT_FEATURES_MIN = 20 };

// Normal equations of one frame: pose, then read-out time.
struct readout_equations {
    double information[POSE + 1][POSE + 1], gradient[POSE + 1];
    int count;
};

// Where the feature is seen once the shutter is undone at this read-out time. False: it cannot be told.
static bool undone_pixel(const struct lens *lens, const struct camera_path *path, const struct map_feature *feature,
                         double z, struct pixel *out)
{
    const struct vec3 p =
        to_middle_row(lens, path, feature->raw_pixel.y, v3_scale(lens_ray(lens, feature->raw_pixel), z));
    if (!(p.z > 0))
        return false;
    *out = (struct pixel){lens->fx * p.x / p.z, lens->fy * p.y / p.z}; // without distortion
    return true;
}

static void add_equation(const struct lens *lens, struct vec3 p, const double error[2], const double by_readout[2],
                         struct readout_equations *out)
{
    const double x = p.x / p.z, y = p.y / p.z, squares = error[0] * error[0] + error[1] * error[1],
                 weight = 1 / (1 + squares / (ROBUST_PX * ROBUST_PX));
    // Of the projection: by a rotation of the camera's axes, then by a shift.
    const double rows[2][POSE + 1] = {{-lens->fx * x * y, lens->fx * (1 + x * x), -lens->fx * y, lens->fx / p.z, 0,
                                       -lens->fx * x / p.z, -by_readout[0]},
                                      {-lens->fy * (1 + y * y), lens->fy * x * y, lens->fy * x, 0, lens->fy / p.z,
                                       -lens->fy * y / p.z, -by_readout[1]}};
    for (int r = 0; r < 2; r++)
        for (int a = 0; a <= POSE; a++) {
            out->gradient[a] -= weight * rows[r][a] * error[r];
            for (int b = 0; b <= POSE; b++)
                out->information[a][b] += weight * rows[r][a] * rows[r][b];
        }
    out->count++;
}

static void add_feature(const struct map *map, const struct map_frame *frame, const struct map_feature *feature,
                        const struct camera_path *path, struct readout_equations *out)
{
    struct lens later = map->calibration.color;
    const struct vec3 p = pose_apply(frame->camera_from_world, map->points[feature->point].world);
    const double z = feature->raw_depth > 0 ? feature->raw_depth : p.z;
    struct pixel now, then;
    later.readout_s += STEP_S;
    if (!(p.z > 0) || !undone_pixel(&map->calibration.color, path, feature, z, &now) ||
        !undone_pixel(&later, path, feature, z, &then))
        return;
    const double error[2] = {later.fx * p.x / p.z - now.x, later.fy * p.y / p.z - now.y},
                 by_readout[2] = {(then.x - now.x) / STEP_S, (then.y - now.y) / STEP_S};
    add_equation(&later, p, error, by_readout, out);
}

// What the frame says of the read-out time alone: information, and that times the change. False: nothing.
static bool eliminate_pose(const struct readout_equations *equations, double *information, double *gradient)
{
    double pose[POSE * POSE], inverse[POSE * POSE];
    *information = equations->information[POSE][POSE];
    *gradient = equations->gradient[POSE];
    for (int a = 0; a < POSE; a++)
        memcpy(pose + a * POSE, equations->information[a], sizeof *pose * POSE);
    if (equations->count < READOUT_FEATURES_MIN || !invert_symmetric(pose, POSE, inverse))
        return false;
    for (int a = 0; a < POSE; a++)
        for (int b = 0; b < POSE; b++) {
            const double share = equations->information[POSE][a] * inverse[a * POSE + b];
            *information -= share * equations->information[b][POSE];
            *gradient -= share * equations->gradient[b];
        }
    return *information > 0;
}

// The change of the read-out time and its standard deviation. False: too few frames tell.
static bool estimate_change(const struct map *map, double *change_s, double *sigma_s)
{
    double information[MAP_MAX_FRAMES], gradient[MAP_MAX_FRAMES], sum = 0, of_change = 0, spread = 0;
    int count = 0;
    for (int32_t i = 0; i < map->frame_count && count < MAP_MAX_FRAMES; i++) {
        const struct map_frame *frame = &map->frames[i];
        struct readout_equations equations = {.count = 0};
        struct camera_path path;
        if (!frame->placed || !camera_path_around(map, i, &path))
            continue;
        for (int32_t k = 0; k < frame->feature_count; k++)
            if (frame->features[k].point >= 0)
                add_feature(map, frame, &frame->features[k], &path, &equations);
        if (!eliminate_pose(&equations, &information[count], &gradient[count]))
            continue;
        sum += information[count];
        of_change += gradient[count++];
    }
    if (count < READOUT_FRAMES_MIN || !(sum > 0))
        return false;
    *change_s = of_change / sum;
    for (int i = 0; i < count; i++) {
        const double off = gradient[i] - information[i] * *change_s;
        spread += off * off;
    }
    *sigma_s = sqrt(spread) / sum;
    return true;
}

bool map_shows_longer_readout(const struct map *map)
{
    double change_s, sigma_s;
    return estimate_change(map, &change_s, &sigma_s) && change_s > SURE_SIGMAS * sigma_s;
}
