// A sweep by a rolling shutter: what each picture shows, put where its middle row's camera would have seen it. From what
// was read, the camera's speed between the pictures beside it, and how far what it saw is from it as the map stands;
// so it gets better as the map does. Depth is taken to be read with the colour of its pixel.
#include "capture/map_internal.h"
#include "locate/shutter.h"

#include <string.h>

static const double LONGEST_GAP_S = 0.5; // between pictures that tell a speed

// From camera a to camera b, per second, in the axes of `own`, one of both. False: they tell nothing.
static bool add_speed(const struct map_frame *a, const struct map_frame *b, const struct map_frame *own, double share,
                      double speed[6])
{
    double time_s = (double)(b->time_ns - a->time_ns) * 1e-9;
    if (!a->placed || !b->placed || !(time_s > 0) || time_s > LONGEST_GAP_S)
        return false;
    struct pose wa = pose_inverse(a->camera_from_world), wb = pose_inverse(b->camera_from_world);
    struct vec3 turn = quat_to_rotation_vector(quat_multiply(quat_conjugate(wa.rotation), wb.rotation));
    struct vec3 shift = quat_rotate(own->camera_from_world.rotation, v3_sub(wb.translation, wa.translation));
    const double step[6] = {turn.x, turn.y, turn.z, shift.x, shift.y, shift.z};
    for (int i = 0; i < 6; i++)
        speed[i] += share * step[i] / time_s;
    return true;
}

static bool speed_of(const struct map *m, int32_t i, struct shutter_motion *out)
{
    const struct map_frame *f = &m->frames[i];
    double before[6] = {0}, after[6] = {0};
    bool from = i > 0 && add_speed(f - 1, f, f, 1, before), on = i + 1 < m->frame_count && add_speed(f, f + 1, f, 1, after);
    double share = from && !on ? 1 : 0;
    if (from && on) // the nearer one tells more of this moment
        share = (double)(f[1].time_ns - f->time_ns) / (double)(f[1].time_ns - f[-1].time_ns);
    for (int k = 0; k < 6; k++)
        out->speed[k] = share * before[k] + (1 - share) * after[k];
    return from || on;
}

// Where what row `row` shows at p, camera axes, is for the middle row's camera.
static struct vec3 when_middle(const struct lens *lens, const struct shutter_motion *motion, double row, struct vec3 p)
{
    double time_s = shutter_time(lens, row);
    const double *v = motion->speed;
    struct quat turn = quat_from_rotation_vector(v3(v[0] * time_s, v[1] * time_s, v[2] * time_s));
    return v3_add(quat_rotate(turn, p), v3(v[3] * time_s, v[4] * time_s, v[5] * time_s));
}

static void unroll_tag(const struct map *m, struct map_frame *f, int32_t k, const struct shutter_motion *motion)
{
    const struct lens *lens = &m->calibration.color;
    const struct map_tag *tag = &m->tags[f->which[k]];
    const struct place_tag own = {.side_m = tag->side_m, .world_from_tag = tag->world_from_tag};
    struct vec3 corner[4];
    place_tag_corners(&own, corner);
    for (int c = 0; c < 4 && tag->mapped; c++) {
        struct vec3 ray = f->seen_as_read[k].ray[c];
        double z = pose_apply(f->camera_from_world, corner[c]).z;
        struct vec3 p = when_middle(lens, motion, lens_project(lens, ray).y, v3_scale(ray, z));
        if (z > 0 && p.z > 0)
            f->seen[k].ray[c] = v3_scale(p, 1 / p.z);
    }
    for (int i = 0; i < f->depths[k].count; i++) {
        struct depth_sample s = f->depths_as_read[k].sample[i];
        struct vec3 ray = v3(s.x, s.y, 1);
        struct vec3 p = when_middle(lens, motion, lens_project(lens, ray).y, v3_scale(ray, s.z));
        if (p.z > 0)
            f->depths[k].sample[i] = (struct depth_sample){p.x / p.z, p.y / p.z, p.z};
    }
}

static void unroll_feature(const struct map *m, const struct map_frame *f, struct map_feature *s,
                           const struct shutter_motion *motion)
{
    static const double FAR_M = 1e6; // where only the turn counts
    const struct lens *lens = &m->calibration.color;
    double z = s->depth_as_read;
    if (!(z > 0))
        z = s->point >= 0 ? pose_apply(f->camera_from_world, m->points[s->point].world).z : FAR_M;
    struct vec3 p = when_middle(lens, motion, s->read_at.y, v3_scale(lens_ray(lens, s->read_at), z));
    if (!(z > 0) || !(p.z > 0))
        return;
    s->feature.at = lens_project(lens, p);
    s->depth = s->depth_as_read > 0 ? p.z : 0;
}

void map_unroll(struct map *m)
{
    for (int32_t i = 0; m->calibration.color.readout_s > 0 && i < m->frame_count; i++) {
        struct map_frame *f = &m->frames[i];
        struct shutter_motion motion;
        if (!f->placed || !speed_of(m, i, &motion))
            continue;
        for (int32_t k = 0; k < f->seen_count; k++)
            unroll_tag(m, f, k, &motion);
        for (int32_t k = 0; k < f->feature_count; k++)
            unroll_feature(m, f, &f->features[k], &motion);
    }
}
