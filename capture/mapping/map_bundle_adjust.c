// Sets up bundle adjustment problems from the map and writes their solutions back; residuals of the result.
#include "capture/mapping/map_internal.h"

#include "base/linear_algebra.h"

#include <stdlib.h>
#include <string.h>

// Standard deviation of a tag corner beyond image noise: print, paper that is not flat, lens. Chosen by hand.
static const double PRINT_PX = 0.05;
// Prior of the sensor's depth scale error, and the error above which a result is not believed. Chosen by hand.
static const double DEPTH_SCALE_SIGMA = 0.01, MAX_DEPTH_SCALE_ERROR = 0.05;
// Beside a free lens, depth would bend it: its errors are not independent from sample to sample. Chosen on the tests'
// small world, where the fitted focal length is 0.9 % short with 1 and 0.4 % with 10.
static const double LOOSE_DEPTH = 10;

// What is adjusted, and how.
struct adjust_options {
    int rounds;
    bool fix_frames;
    double extra_sigma_px;  // added to the standard deviation of landmark observations
    const bool *included;   // which landmarks; NULL: all
    double *cost;           // NULL: not asked for
    double *depth_scale;    // NULL: the depth scale is held at 1
    double *tag_covariance; // NULL: not asked for
    struct ba_lens *lens;   // fitted, and nothing of the map is changed; NULL: it is held as given
    double loose_depth;     // the standard deviation of depth is so many times as large; 0: once
};

struct residual_counts {
    int32_t corners, depths, observations;
};

static bool is_included(const struct map_feature *s, const bool *included)
{
    return s->point >= 0 && (!included || included[s->point]);
}

static struct residual_counts count_residuals(const struct map *m, const bool *included)
{
    struct residual_counts n = {0};
    for (int32_t i = 0; i < m->frame_count; i++) {
        const struct map_frame *f = &m->frames[i];
        if (!f->placed)
            continue;
        for (int32_t k = 0; k < f->seen_count; k++) {
            if (m->tags[f->tag_index[k]].mapped) {
                n.corners++;
                n.depths += f->depths[k].count;
            }
        }
        for (int32_t k = 0; k < f->feature_count; k++)
            n.observations += is_included(&f->features[k], included);
    }
    return n;
}

// The upper factor U of the information of a tag's eight corner coordinates, U^T U = information; where it is singular,
// a standard deviation of half a pixel.
static void whiten(const struct tag_observation *seen, double out[8][8])
{
    double covariance[64], information[64];
    memset(out, 0, 64 * sizeof(double));
    if (invert_symmetric(&seen->information[0][0], 8, covariance)) {
        for (int i = 0; i < 8; i++)
            covariance[i * 8 + i] += PRINT_PX * PRINT_PX;
        if (invert_symmetric(covariance, 8, information) && cholesky_factor(information, 8)) {
            for (int i = 0; i < 8; i++)
                for (int j = 0; j <= i; j++)
                    out[j][i] = information[i * 8 + j];
            return;
        }
    }
    for (int i = 0; i < 8; i++)
        out[i][i] = 2;
}

// The arrays of one adjustment.
struct adjust_arrays {
    struct ba_camera *cameras;
    struct ba_square *squares;
    struct vec3 *points;
    struct ba_corners *corners;
    struct ba_plane_depth *depths;
    struct ba_observation *observations;
    bool *moved;                 // for move_excluded_points
    struct residual_counts used; // of corners, depths, observations
};

static void adjust_arrays_free(struct adjust_arrays *a)
{
    free(a->cameras);
    free(a->squares);
    free(a->points);
    free(a->corners);
    free(a->depths);
    free(a->observations);
    free(a->moved);
}

static enum status adjust_arrays_alloc(struct adjust_arrays *a, const struct map *m, struct residual_counts n)
{
    *a = (struct adjust_arrays){
        .cameras = calloc((size_t)m->frame_count + 1, sizeof *a->cameras),
        .squares = calloc((size_t)m->tag_count + 1, sizeof *a->squares),
        .points = calloc((size_t)m->point_count + 1, sizeof *a->points),
        .corners = calloc((size_t)n.corners + 1, sizeof *a->corners),
        .depths = calloc((size_t)n.depths + 1, sizeof *a->depths),
        .observations = calloc((size_t)n.observations + 1, sizeof *a->observations),
        .moved = calloc((size_t)m->point_count + 1, sizeof *a->moved),
    };
    if (a->cameras && a->squares && a->points && a->corners && a->depths && a->observations && a->moved)
        return OK;
    adjust_arrays_free(a);
    return fail(ERR_MEMORY, "no memory to adjust the map");
}

static void add_frame_residuals(const struct map *m, int32_t i, const struct adjust_options *options,
                                struct adjust_arrays *a)
{
    const struct map_frame *f = &m->frames[i];
    const struct lens *lens = &m->calibration.color;
    const double loose = options->loose_depth > 0 ? options->loose_depth : 1;
    for (int32_t k = 0; k < f->seen_count; k++) {
        if (!m->tags[f->tag_index[k]].mapped)
            continue;
        struct ba_corners *c = &a->corners[a->used.corners++];
        c->camera = i;
        c->square = f->tag_index[k];
        for (int j = 0; j < 4; j++) {
            c->observed[2 * j] = lens->fx * f->seen[k].ray[j].x;
            c->observed[2 * j + 1] = lens->fy * f->seen[k].ray[j].y;
        }
        whiten(&f->seen[k], c->whiten);
        for (int32_t d = 0; d < f->depths[k].count; d++) {
            const struct depth_sample *s = &f->depths[k].sample[d];
            a->depths[a->used.depths++] = (struct ba_plane_depth){
                i, f->tag_index[k], s->x, s->y, s->z, loose * depth_absolute_sigma_m(s->z) / sqrt(f->depths[k].share)};
        }
    }
    for (int32_t k = 0; k < f->feature_count; k++) {
        const struct map_feature *s = &f->features[k];
        if (!is_included(s, options->included))
            continue;
        struct vec3 ray = lens_ray(lens, s->feature.at);
        double sigma_m =
            s->depth > 0 ? hypot(depth_absolute_sigma_m(s->depth), options->extra_sigma_px / lens->fx * s->depth) : 1;
        struct ba_observation *seen = &a->observations[a->used.observations++];
        *seen = (struct ba_observation){i, s->point, ray.x, ray.y, {0}, s->depth, loose * sigma_m};
        match_covariance(&m->points[s->point], &s->feature, seen->covariance);
        seen->covariance[0] += options->extra_sigma_px * options->extra_sigma_px;
        seen->covariance[2] += options->extra_sigma_px * options->extra_sigma_px;
    }
}

// A landmark that was not included moves rigidly with the first frame that shows it. moved: point_count times false.
static void move_excluded_points(struct map *m, const struct ba_problem *p, const bool *included, bool *moved)
{
    for (int32_t i = 0; i < m->frame_count; i++) {
        const struct map_frame *f = &m->frames[i];
        struct pose new_from_old = pose_multiply(pose_inverse(p->cameras[i].camera_from_world), f->camera_from_world);
        for (int32_t k = 0; f->placed && k < f->feature_count; k++) {
            int32_t point = f->features[k].point;
            if (point < m->held_points || included[point] || moved[point])
                continue;
            p->points[point] = pose_apply(new_from_old, p->points[point]);
            moved[point] = true;
        }
    }
}

static void apply_solution(struct map *m, const struct ba_problem *p)
{
    for (int32_t i = 0; i < m->frame_count; i++)
        m->frames[i].camera_from_world = p->cameras[i].camera_from_world;
    for (int32_t i = 0; i < m->tag_count; i++)
        m->tags[i].world_from_tag = p->squares[i].world_from_square;
    for (int32_t i = 0; i < m->point_count; i++)
        m->points[i].world = p->points[i];
}

static enum status adjust_all(struct map *m, const struct adjust_options *options)
{
    const bool *included = options->included;
    if (m->on_step)
        m->on_step(m->self);
    map_undo_rolling_shutter(m);
    struct adjust_arrays a;
    enum status status = adjust_arrays_alloc(&a, m, count_residuals(m, included));
    if (status != OK)
        return status;
    for (int32_t i = 0; i < m->frame_count; i++) {
        a.cameras[i].camera_from_world = m->frames[i].camera_from_world;
        if (m->frames[i].placed)
            add_frame_residuals(m, i, options, &a);
    }
    for (int32_t i = 0; i < m->tag_count; i++)
        a.squares[i] = (struct ba_square){m->tags[i].world_from_tag, m->tags[i].side_m, m->tags[i].fixed};
    for (int32_t i = 0; i < m->point_count; i++)
        a.points[i] = m->points[i].world;
    struct ba_problem problem = {
        .fx = m->calibration.color.fx,
        .fy = m->calibration.color.fy,
        .cameras = a.cameras,
        .squares = a.squares,
        .points = a.points,
        .corners = a.corners,
        .plane_depths = a.depths,
        .observations = a.observations,
        .camera_count = m->frame_count,
        .square_count = m->tag_count,
        .point_count = m->point_count,
        .corner_count = a.used.corners,
        .plane_depth_count = a.used.depths,
        .observation_count = options->fix_frames ? 0 : a.used.observations,
        .held_camera = m->fixed_frame,
        .held_points = m->held_points,
        .hold_cameras = options->fix_frames,
        .max_iterations = options->rounds,
        .cost = options->cost,
        .depth_scale = options->depth_scale,
        .depth_scale_sigma = DEPTH_SCALE_SIGMA,
        .square_covariance = options->tag_covariance,
        .lens = options->lens,
    };
    status = bundle_adjust(&problem);
    if (options->lens) {
        adjust_arrays_free(&a);
        return status;
    }
    if (status == OK && included)
        move_excluded_points(m, &problem, included, a.moved);
    if (status == OK)
        apply_solution(m, &problem);
    adjust_arrays_free(&a);
    return status;
}
enum status map_bundle_adjust(struct map *m, int rounds, bool fix_frames, double *cost)
{
    return adjust_all(m, &(struct adjust_options){.rounds = rounds, .fix_frames = fix_frames, .cost = cost});
}

enum status map_bundle_adjust_relaxed(struct map *m, int rounds, double extra_sigma_px)
{
    return adjust_all(m, &(struct adjust_options){.rounds = rounds, .extra_sigma_px = extra_sigma_px});
}

void map_scale_depth(struct map *m, double times)
{
    m->depth_scale *= times;
    for (int32_t i = 0; i < m->frame_count; i++) {
        struct map_frame *f = &m->frames[i];
        for (int32_t k = 0; k < f->feature_count; k++) {
            f->features[k].depth *= times;
            f->features[k].raw_depth *= times;
        }
        for (int32_t k = 0; k < f->seen_count; k++)
            for (int32_t d = 0; d < f->depths[k].count; d++) {
                f->depths[k].sample[d].z *= times;
                f->raw_depths[k].sample[d].z *= times;
            }
    }
}

enum status map_bundle_adjust_depth_scale(struct map *m, int rounds)
{
    double times = 1;
    bool tags = false;
    for (int32_t i = 0; i < m->tag_count; i++)
        tags = tags || m->tags[i].mapped;
    enum status status = adjust_all(m, &(struct adjust_options){.rounds = rounds, .depth_scale = tags ? &times : NULL});
    if (status == OK && fabs(times - 1) < MAX_DEPTH_SCALE_ERROR)
        map_scale_depth(m, times);
    return status;
}

enum status map_fit_lens(struct map *m, int rounds, struct ba_lens *lens)
{
    double scale = 1;
    *lens = (struct ba_lens){.focal = {1, 1}};
    struct adjust_options options = {.rounds = rounds, .lens = lens};
    if (map_most_observed_tag(m, true) >= 0) { // else depth alone gives the scale
        options.depth_scale = &scale;
        options.loose_depth = LOOSE_DEPTH;
    }
    return adjust_all(m, &options);
}

enum status map_bundle_adjust_subset(struct map *m, int rounds, const bool *included)
{
    return adjust_all(m, &(struct adjust_options){.rounds = rounds, .included = included});
}

enum status map_joint_tag_covariance(struct map *m, double *tags)
{
    return adjust_all(m, &(struct adjust_options){.tag_covariance = tags});
}

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

static void measure_tag(const struct map *m, const struct map_frame *f, int32_t k, struct sum *px, struct sum *metres,
                        struct sum *expected)
{
    struct map_tag *tag = &m->tags[f->tag_index[k]];
    struct pnp_tag fit = {
        .seen = &f->seen[k], .world_from_tag = tag->world_from_tag, .side_m = tag->side_m, .used = true};
    double error = pnp_tag_rms(&fit, NULL, &f->camera_from_world, m->calibration.color.fx, m->calibration.color.fy);
    if (!tag->mapped || error > 10) // an outlier to the adjustment
        return;
    tag->rms_px += error * error;
    tag->observations++;
    add(px, error);
    struct pose camera_from_tag = pose_multiply(f->camera_from_world, tag->world_from_tag);
    struct vec3 normal = quat_rotate(camera_from_tag.rotation, v3(0, 0, 1));
    for (int32_t d = 0; d < f->depths[k].count; d++) {
        const struct depth_sample *s = &f->depths[k].sample[d];
        double slant = normal.x * s->x + normal.y * s->y + normal.z;
        add(metres, v3_dot(normal, camera_from_tag.translation) / slant - s->z);
        add(expected, depth_absolute_sigma_m(s->z));
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
        add(px, map_reprojection_px(lens, p, &s->feature));
        if (s->depth > 0)
            add(metres, p.z - s->depth);
    }
}

void map_compute_residuals(struct map *m)
{
    struct sum px = {0}, metres = {0}, expected = {0};
    for (int32_t i = 0; i < m->tag_count; i++) {
        m->tags[i].rms_px = 0;
        m->tags[i].observations = 0;
    }
    for (int32_t i = 0; i < m->frame_count; i++) {
        const struct map_frame *f = &m->frames[i];
        if (!f->placed)
            continue;
        for (int32_t k = 0; k < f->seen_count; k++)
            measure_tag(m, f, k, &px, &metres, &expected);
        if (!m->tag_count)
            measure_points(m, f, &px, &metres);
    }
    for (int32_t i = 0; i < m->tag_count; i++)
        if (m->tags[i].observations)
            m->tags[i].rms_px = sqrt(m->tags[i].rms_px / m->tags[i].observations);
    m->rms_px = rms(px);
    m->rms_m = rms(metres);
    m->expected_m = rms(expected);
}
