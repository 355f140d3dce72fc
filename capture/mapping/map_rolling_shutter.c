// A sweep by a rolling shutter: what each picture shows, put where its middle row's camera would have seen it. From
// what was read, the camera's way through the pictures beside it, and how far what it saw is from it as the map stands;
// so it gets better as the map does. Depth is taken to be read with the colour of its pixel.
#include "capture/mapping/map_internal.h"
#include "locate/rolling_shutter.h"

#include <string.h>

static const double LONGEST_GAP_S = 0.5; // between pictures that tell a speed

enum { BESIDE = 2, MOST_KNOTS = 2 * BESIDE + 1 };

// How the camera moved about one picture: middle_from_camera at the times of the pictures beside it, as turn (rotation
// vector) and shift.
struct course {
    double time_s[MOST_KNOTS], at[MOST_KNOTS][6]; // since the picture; the first is the picture itself, at 0
    int count;
};

static void add_knot(struct course *c, const struct map_frame *f, const struct map_frame *other)
{
    struct pose p = pose_multiply(f->camera_from_world, pose_inverse(other->camera_from_world));
    struct vec3 turn = quat_to_rotation_vector(p.rotation);
    const double at[6] = {turn.x, turn.y, turn.z, p.translation.x, p.translation.y, p.translation.z};
    c->time_s[c->count] = (double)(other->time_ns - f->time_ns) * 1e-9;
    memcpy(c->at[c->count++], at, sizeof at);
}

// A swing that turns back within a few pictures has no even speed while one of them is read: two pictures on each side
// tell how it changes. False: nothing does.
static bool course_of(const struct map *m, int32_t i, struct course *out)
{
    const struct map_frame *f = &m->frames[i];
    out->count = 1;
    out->time_s[0] = 0;
    memset(out->at[0], 0, sizeof out->at[0]);
    for (int side = -1; side <= 1; side += 2)
        for (int n = 1; n <= BESIDE; n++) {
            int32_t k = i + side * n;
            if (k < 0 || k >= m->frame_count || !m->frames[k].placed)
                break;
            double gap_s = side * (double)(m->frames[k].time_ns - m->frames[k - side].time_ns) * 1e-9;
            if (gap_s < m->calibration.color.readout_s / 2 || gap_s > LONGEST_GAP_S) // the first: a clock gone wrong
                break;
            add_knot(out, f, &m->frames[k]);
        }
    return out->count > 1;
}

// The polynomial through all of them (Lagrange).
static void follow_course(const struct course *c, double time_s, double out[6])
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

// Where what row `row` shows at p, camera axes, is for the middle row's camera.
static struct vec3 when_middle(const struct lens *lens, const struct course *course, double row, struct vec3 p)
{
    double by[6];
    follow_course(course, shutter_time(lens, row), by);
    return v3_add(quat_rotate(quat_from_rotation_vector(v3(by[0], by[1], by[2])), p), v3(by[3], by[4], by[5]));
}

static void unroll_tag(const struct map *m, struct map_frame *f, int32_t k, const struct course *course)
{
    const struct lens *lens = &m->calibration.color;
    const struct map_tag *tag = &m->tags[f->which[k]];
    const struct place_tag own = {.side_m = tag->side_m, .world_from_tag = tag->world_from_tag};
    struct vec3 corner[4];
    place_tag_corners(&own, corner);
    for (int c = 0; c < 4 && tag->mapped; c++) {
        struct vec3 ray = f->seen_as_read[k].ray[c];
        double z = pose_apply(f->camera_from_world, corner[c]).z;
        struct vec3 p = when_middle(lens, course, lens_project(lens, ray).y, v3_scale(ray, z));
        if (z > 0 && p.z > 0)
            f->seen[k].ray[c] = v3_scale(p, 1 / p.z);
    }
    for (int i = 0; i < f->depths[k].count; i++) {
        struct depth_sample s = f->depths_as_read[k].sample[i];
        struct vec3 ray = v3(s.x, s.y, 1);
        struct vec3 p = when_middle(lens, course, lens_project(lens, ray).y, v3_scale(ray, s.z));
        if (p.z > 0)
            f->depths[k].sample[i] = (struct depth_sample){p.x / p.z, p.y / p.z, p.z};
    }
}

static void unroll_feature(const struct map *m, const struct map_frame *f, struct map_feature *s,
                           const struct course *course)
{
    static const double FAR_M = 1e6; // where only the turn counts
    const struct lens *lens = &m->calibration.color;
    double z = s->depth_as_read;
    if (!(z > 0))
        z = s->point >= 0 ? pose_apply(f->camera_from_world, m->points[s->point].world).z : FAR_M;
    struct vec3 p = when_middle(lens, course, s->read_at.y, v3_scale(lens_ray(lens, s->read_at), z));
    if (!(z > 0) || !(p.z > 0))
        return;
    s->feature.at = lens_project(lens, p);
    s->depth = s->depth_as_read > 0 ? p.z : 0;
}

void map_unroll(struct map *m)
{
    for (int32_t i = 0; m->calibration.color.readout_s > 0 && i < m->frame_count; i++) {
        struct map_frame *f = &m->frames[i];
        struct course course;
        if (!f->placed || !course_of(m, i, &course))
            continue;
        for (int32_t k = 0; k < f->seen_count; k++)
            unroll_tag(m, f, k, &course);
        for (int32_t k = 0; k < f->feature_count; k++)
            unroll_feature(m, f, &f->features[k], &course);
    }
}
