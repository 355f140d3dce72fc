#include "capture/mapping/map_internal.h"

#include "base/linear_algebra.h"

#include <stdlib.h>
#include <string.h>

// Beside what the picture's noise explains: print, paper that is not flat, lens.
static const double PRINT_PX = 0.05;
// Sensors are off by about so much; by more is no error of scale.
static const double DEPTH_TIMES_SIGMA = 0.01, DEPTH_TIMES_MOST = 0.05;

// What is adjusted, and how.
struct how {
    int rounds;
    bool hold_frames;
    double loose_px;        // points are less sure by this
    const bool *joins;      // which points; NULL: all
    double *cost;           // NULL: not asked for
    double *depth_times;    // NULL: depth is true
    double *tag_covariance; // NULL: not asked for
};

struct sizes {
    int32_t corners, depths, sightings;
};

// joins: for each point whether it does; NULL: all do.
static bool takes_part(const struct map_feature *s, const bool *joins)
{
    return s->point >= 0 && (!joins || joins[s->point]);
}

static struct sizes count_all(const struct map *m, const bool *joins)
{
    struct sizes n = {0};
    for (int32_t i = 0; i < m->frame_count; i++) {
        const struct map_frame *f = &m->frames[i];
        if (!f->placed)
            continue;
        for (int32_t k = 0; k < f->seen_count; k++) {
            if (m->tags[f->which[k]].mapped) {
                n.corners++;
                n.depths += f->depths[k].count;
            }
        }
        for (int32_t k = 0; k < f->feature_count; k++)
            n.sightings += takes_part(&f->features[k], joins);
    }
    return n;
}

// The upper factor U of the information, U^T U = information.
static void whiten(const struct sighting *seen, double out[8][8])
{
    double covariance[64], information[64];
    memset(out, 0, 64 * sizeof(double));
    if (invert_symmetric(&seen->information[0][0], 8, covariance)) {
        for (int i = 0; i < 8; i++)
            covariance[i * 8 + i] += PRINT_PX * PRINT_PX;
        if (invert_symmetric(covariance, 8, information) && cholesky(information, 8)) {
            for (int i = 0; i < 8; i++)
                for (int j = 0; j <= i; j++)
                    out[j][i] = information[i * 8 + j];
            return;
        }
    }
    for (int i = 0; i < 8; i++)
        out[i][i] = 2;
}

static void fill_frame(const struct map *m, int32_t i, const struct how *how, struct adjust_corners *corners,
                       struct adjust_plane_depth *depths, struct adjust_sighting *sightings, struct sizes *n)
{
    const struct map_frame *f = &m->frames[i];
    const struct lens *lens = &m->calibration.color;
    for (int32_t k = 0; k < f->seen_count; k++) {
        if (!m->tags[f->which[k]].mapped)
            continue;
        struct adjust_corners *c = &corners[n->corners++];
        c->camera = i;
        c->square = f->which[k];
        for (int j = 0; j < 4; j++) {
            c->observed[2 * j] = lens->fx * f->seen[k].ray[j].x;
            c->observed[2 * j + 1] = lens->fy * f->seen[k].ray[j].y;
        }
        whiten(&f->seen[k], c->whiten);
        for (int32_t d = 0; d < f->depths[k].count; d++) {
            const struct depth_sample *s = &f->depths[k].sample[d];
            depths[n->depths++] = (struct adjust_plane_depth){
                i, f->which[k], s->x, s->y, s->z, depth_sigma(s->z) / sqrt(f->depths[k].share)};
        }
    }
    for (int32_t k = 0; k < f->feature_count; k++) {
        const struct map_feature *s = &f->features[k];
        if (!takes_part(s, how->joins))
            continue;
        struct vec3 ray = lens_ray(lens, s->feature.at);
        double sigma_m = s->depth > 0 ? hypot(depth_sigma(s->depth), how->loose_px / lens->fx * s->depth) : 1;
        struct adjust_sighting *seen = &sightings[n->sightings++];
        *seen = (struct adjust_sighting){i, s->point, ray.x, ray.y, {0}, s->depth, sigma_m};
        sighting_covariance(&m->points[s->point], &s->feature, seen->covariance);
        seen->covariance[0] += how->loose_px * how->loose_px;
        seen->covariance[2] += how->loose_px * how->loose_px;
    }
}

// A point that did not join goes with the first frame that shows it. moved: room for one of each point, false.
static void move_others(struct map *m, const struct adjust_problem *p, const bool *joins, bool *moved)
{
    for (int32_t i = 0; i < m->frame_count; i++) {
        const struct map_frame *f = &m->frames[i];
        struct pose new_from_old = pose_multiply(pose_inverse(p->cameras[i].camera_from_world), f->camera_from_world);
        for (int32_t k = 0; f->placed && k < f->feature_count; k++) {
            int32_t point = f->features[k].point;
            if (point < m->held_points || joins[point] || moved[point])
                continue;
            p->points[point] = pose_apply(new_from_old, p->points[point]);
            moved[point] = true;
        }
    }
}

static void take_over(struct map *m, const struct adjust_problem *p)
{
    for (int32_t i = 0; i < m->frame_count; i++)
        m->frames[i].camera_from_world = p->cameras[i].camera_from_world;
    for (int32_t i = 0; i < m->tag_count; i++)
        m->tags[i].world_from_tag = p->squares[i].world_from_square;
    for (int32_t i = 0; i < m->point_count; i++)
        m->points[i].world = p->points[i];
}

static enum status adjust_all(struct map *m, const struct how *how)
{
    const bool *joins = how->joins;
    map_unroll(m);
    struct sizes n = count_all(m, joins), filled = {0};
    struct adjust_camera *cameras = calloc((size_t)m->frame_count + 1, sizeof *cameras);
    struct adjust_square *squares = calloc((size_t)m->tag_count + 1, sizeof *squares);
    struct vec3 *points = calloc((size_t)m->point_count + 1, sizeof *points);
    struct adjust_corners *corners = calloc((size_t)n.corners + 1, sizeof *corners);
    struct adjust_plane_depth *depths = calloc((size_t)n.depths + 1, sizeof *depths);
    struct adjust_sighting *sightings = calloc((size_t)n.sightings + 1, sizeof *sightings);
    bool *moved = calloc((size_t)m->point_count + 1, sizeof *moved);
    enum status status = ERR_MEMORY;
    if (cameras && squares && points && corners && depths && sightings && moved) {
        for (int32_t i = 0; i < m->frame_count; i++) {
            cameras[i].camera_from_world = m->frames[i].camera_from_world;
            if (m->frames[i].placed)
                fill_frame(m, i, how, corners, depths, sightings, &filled);
        }
        for (int32_t i = 0; i < m->tag_count; i++)
            squares[i] = (struct adjust_square){m->tags[i].world_from_tag, m->tags[i].side_m, m->tags[i].held};
        for (int32_t i = 0; i < m->point_count; i++)
            points[i] = m->points[i].world;
        struct adjust_problem problem = {
            .fx = m->calibration.color.fx,
            .fy = m->calibration.color.fy,
            .cameras = cameras,
            .squares = squares,
            .points = points,
            .corners = corners,
            .plane_depths = depths,
            .sightings = sightings,
            .camera_count = m->frame_count,
            .square_count = m->tag_count,
            .point_count = m->point_count,
            .corner_count = filled.corners,
            .plane_depth_count = filled.depths,
            .sighting_count = how->hold_frames ? 0 : filled.sightings,
            .held_camera = m->held_frame,
            .held_points = m->held_points,
            .hold_cameras = how->hold_frames,
            .most_rounds = how->rounds,
            .cost = how->cost,
            .depth_times = how->depth_times,
            .depth_times_sigma = DEPTH_TIMES_SIGMA,
            .square_covariance = how->tag_covariance,
        };
        status = adjust(&problem);
        if (status == OK && joins)
            move_others(m, &problem, joins, moved);
        if (status == OK)
            take_over(m, &problem);
    } else {
        (void)fail(ERR_MEMORY, "no memory to adjust the map");
    }
    free(cameras);
    free(squares);
    free(points);
    free(corners);
    free(depths);
    free(sightings);
    free(moved);
    return status;
}

enum status map_adjust(struct map *m, int rounds, bool hold_frames, double *cost)
{
    return adjust_all(m, &(struct how){.rounds = rounds, .hold_frames = hold_frames, .cost = cost});
}

enum status map_adjust_loosely(struct map *m, int rounds, double loose_px)
{
    return adjust_all(m, &(struct how){.rounds = rounds, .loose_px = loose_px});
}

static void scale_depth(struct map *m, double times)
{
    m->depth_times *= times;
    for (int32_t i = 0; i < m->frame_count; i++) {
        struct map_frame *f = &m->frames[i];
        for (int32_t k = 0; k < f->feature_count; k++) {
            f->features[k].depth *= times;
            f->features[k].depth_as_read *= times;
        }
        for (int32_t k = 0; k < f->seen_count; k++)
            for (int32_t d = 0; d < f->depths[k].count; d++) {
                f->depths[k].sample[d].z *= times;
                f->depths_as_read[k].sample[d].z *= times;
            }
    }
}

enum status map_adjust_depth(struct map *m, int rounds)
{
    double times = 1;
    bool tags = false;
    for (int32_t i = 0; i < m->tag_count; i++)
        tags = tags || m->tags[i].mapped;
    enum status status = adjust_all(m, &(struct how){.rounds = rounds, .depth_times = tags ? &times : NULL});
    if (status == OK && fabs(times - 1) < DEPTH_TIMES_MOST)
        scale_depth(m, times);
    return status;
}

enum status map_adjust_by(struct map *m, int rounds, const bool *joins)
{
    return adjust_all(m, &(struct how){.rounds = rounds, .joins = joins});
}

enum status map_covariance(struct map *m, double *tags) { return adjust_all(m, &(struct how){.tag_covariance = tags}); }

struct sum {
    double squares;
    int64_t count;
};

static void add(struct sum *sum, double error)
{
    if (isfinite(error)) {
        sum->squares += error * error;
        sum->count++;
    }
}

static double rms(struct sum sum) { return sum.count ? sqrt(sum.squares / (double)sum.count) : 0; }

static void measure_tag(const struct map *m, const struct map_frame *f, int32_t k, struct sum *px, struct sum *metres)
{
    struct map_tag *tag = &m->tags[f->which[k]];
    struct fit_tag fit = {
        .seen = &f->seen[k], .world_from_tag = tag->world_from_tag, .side_m = tag->side_m, .used = true};
    double error = fit_tag_rms(&fit, NULL, &f->camera_from_world, m->calibration.color.fx, m->calibration.color.fy);
    if (!tag->mapped || error > 10) // lost its weight in the adjustment
        return;
    tag->rms_px += error * error;
    tag->sightings++;
    add(px, error);
    struct pose camera_from_tag = pose_multiply(f->camera_from_world, tag->world_from_tag);
    struct vec3 normal = quat_rotate(camera_from_tag.rotation, v3(0, 0, 1));
    for (int32_t d = 0; d < f->depths[k].count; d++) {
        const struct depth_sample *s = &f->depths[k].sample[d];
        double slant = normal.x * s->x + normal.y * s->y + normal.z;
        add(metres, v3_dot(normal, camera_from_tag.translation) / slant - s->z);
    }
}

static void measure_points(const struct map *m, const struct map_frame *f, struct sum *px, struct sum *metres)
{
    const struct lens *lens = &m->calibration.color;
    for (int32_t k = 0; k < f->feature_count; k++) {
        const struct map_feature *s = &f->features[k];
        if (s->point < 0)
            continue;
        struct vec3 p = pose_apply(f->camera_from_world, m->points[s->point].world);
        struct vec3 ray = lens_ray(lens, s->feature.at);
        add(px, hypot(lens->fx * (p.x / p.z - ray.x), lens->fy * (p.y / p.z - ray.y)));
        if (s->depth > 0)
            add(metres, p.z - s->depth);
    }
}

void map_measure(struct map *m)
{
    struct sum px = {0}, metres = {0};
    for (int32_t i = 0; i < m->tag_count; i++) {
        m->tags[i].rms_px = 0;
        m->tags[i].sightings = 0;
    }
    for (int32_t i = 0; i < m->frame_count; i++) {
        const struct map_frame *f = &m->frames[i];
        if (!f->placed)
            continue;
        for (int32_t k = 0; k < f->seen_count; k++)
            measure_tag(m, f, k, &px, &metres);
        if (!m->tag_count)
            measure_points(m, f, &px, &metres);
    }
    for (int32_t i = 0; i < m->tag_count; i++)
        if (m->tags[i].sightings)
            m->tags[i].rms_px = sqrt(m->tags[i].rms_px / m->tags[i].sightings);
    m->rms_px = rms(px);
    m->rms_m = rms(metres);
}
