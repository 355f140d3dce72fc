// Undoes the rolling shutter of a sweep: moves each observation to where the camera at the middle row's time would have
// seen it. Inputs are the raw observation, the camera path through the neighbouring frames, and the depth of what was
// seen in the present map, so the correction improves as the map does. Depth is assumed to be exposed with the colour
// of its pixel.
#include "capture/mapping/map_internal.h"
#include "locate/rolling_shutter.h"

#include <string.h>

static const double MAX_GAP_S = 0.5; // between frames whose poses give a velocity. Chosen by hand

enum { NEIGHBOURS = 2, MAX_PATH_SAMPLES = 2 * NEIGHBOURS + 1 };

// The camera's motion around one frame: middle_from_camera at the times of the neighbouring frames; 6-vectors of
// rotation vector (rad), then translation (m), in the axes of the middle row's camera.
struct camera_path {
    double time_s[MAX_PATH_SAMPLES]; // since the frame; the first is the frame itself, at 0
    double at[MAX_PATH_SAMPLES][6];
    int count;
};

static void add_path_sample(struct camera_path *c, const struct map_frame *f, const struct map_frame *other)
{
    struct pose p = pose_multiply(f->camera_from_world, pose_inverse(other->camera_from_world));
    struct vec3 rotation = quat_to_rotation_vector(p.rotation);
    const double at[6] = {rotation.x, rotation.y, rotation.z, p.translation.x, p.translation.y, p.translation.z};
    c->time_s[c->count] = (double)(other->time_ns - f->time_ns) * 1e-9;
    memcpy(c->at[c->count++], at, sizeof at);
}

// A hand-held camera that reverses within a few frames does not move uniformly while one of them is read out, so two
// frames on each side are used. False: no usable neighbour.
static bool camera_path_around(const struct map *m, int32_t i, struct camera_path *out)
{
    const struct map_frame *f = &m->frames[i];
    out->count = 1;
    out->time_s[0] = 0;
    memset(out->at[0], 0, sizeof out->at[0]);
    for (int side = -1; side <= 1; side += 2)
        for (int n = 1; n <= NEIGHBOURS; n++) {
            int32_t k = i + side * n;
            if (k < 0 || k >= m->frame_count || !m->frames[k].placed)
                break;
            double gap_s = side * (double)(m->frames[k].time_ns - m->frames[k - side].time_ns) * 1e-9;
            if (gap_s < m->calibration.color.readout_s / 2 || gap_s > MAX_GAP_S) // the first: a wrong time stamp
                break;
            add_path_sample(out, f, &m->frames[k]);
        }
    return out->count > 1;
}

// Lagrange polynomial through all samples.
static void interpolate_path(const struct camera_path *c, double time_s, double out[6])
{
    memset(out, 0, 6 * sizeof *out);
    for (int i = 1; i < c->count; i++) {
        double share = 1;
        for (int k = 0; k < c->count; k++)
            if (k != i)
                share *= (time_s - c->time_s[k]) / (c->time_s[i] - c->time_s[k]);
        for (int j = 0; j < 6; j++)
            out[j] += share * c->at[i][j];
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

static void correct_tag(const struct map *m, struct map_frame *f, int32_t k, const struct camera_path *path)
{
    const struct lens *lens = &m->calibration.color;
    const struct map_tag *tag = &m->tags[f->tag_index[k]];
    const struct place_tag own = {.side_m = tag->side_m, .world_from_tag = tag->world_from_tag};
    struct vec3 corner[4];
    place_tag_corners(&own, corner);
    for (int c = 0; c < 4 && tag->mapped; c++) {
        struct vec3 ray = f->raw_seen[k].ray[c];
        double z = pose_apply(f->camera_from_world, corner[c]).z;
        struct vec3 p = to_middle_row(lens, path, lens_project(lens, ray).y, v3_scale(ray, z));
        if (z > 0 && p.z > 0)
            f->seen[k].ray[c] = v3_scale(p, 1 / p.z);
    }
    for (int i = 0; i < f->depths[k].count; i++) {
        struct depth_sample s = f->raw_depths[k].sample[i];
        struct vec3 ray = v3(s.x, s.y, 1);
        struct vec3 p = to_middle_row(lens, path, lens_project(lens, ray).y, v3_scale(ray, s.z));
        if (p.z > 0)
            f->depths[k].sample[i] = (struct depth_sample){p.x / p.z, p.y / p.z, p.z};
    }
}

static void correct_feature(const struct map *m, const struct map_frame *f, struct map_feature *s,
                            const struct camera_path *path)
{
    static const double FAR_M = 1e6; // where only the rotation counts
    const struct lens *lens = &m->calibration.color;
    double z = s->raw_depth;
    if (!(z > 0))
        z = s->point >= 0 ? pose_apply(f->camera_from_world, m->points[s->point].world).z : FAR_M;
    struct vec3 p = to_middle_row(lens, path, s->raw_pixel.y, v3_scale(lens_ray(lens, s->raw_pixel), z));
    if (!(z > 0) || !(p.z > 0))
        return;
    s->feature.at = lens_project(lens, p);
    s->depth = s->raw_depth > 0 ? p.z : 0;
}

void map_undo_rolling_shutter(struct map *m)
{
    for (int32_t i = 0; m->calibration.color.readout_s > 0 && i < m->frame_count; i++) {
        struct map_frame *f = &m->frames[i];
        struct camera_path path;
        if (!f->placed || !camera_path_around(m, i, &path))
            continue;
        for (int32_t k = 0; k < f->seen_count; k++)
            correct_tag(m, f, k, &path);
        for (int32_t k = 0; k < f->feature_count; k++)
            correct_feature(m, f, &f->features[k], &path);
    }
}
