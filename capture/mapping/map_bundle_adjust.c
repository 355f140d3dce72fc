// Sets up bundle adjustment problems from the map and writes their solutions back; residuals of the result.
#include "base/linear_algebra.h"
#include "capture/mapping/map_internal.h"

#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- map covariance

// Covariances of landmarks and tags, and the mean viewing direction of landmarks. A landmark's covariance is the
// inverse of the information of its own observations and depth samples, weighted as in the adjustment, with the cameras
// constant. Tags are about ten times more accurate, so theirs come from the joint information of the whole adjustment.
// 6-vectors of tags: rotation (rad), then translation (m), in the tag's axes; of the world's motion: the same, in world
// axes.

static const double ROBUST_SIGMAS = 3; // scale of the robust kernel, as in the adjustment

struct landmark_information {
    double information[9], cost, numbers;
    struct vec3 from; // sum of unit vectors to the cameras, world axes
    int32_t observations;
};

// Adds one observation of a landmark: whitened residuals and their Jacobian by its position.
static void add_observation(struct landmark_information *information, const struct lens *lens,
                            const struct map_frame *frame, const struct map_feature *feature,
                            const struct place_landmark *point)
{
    struct vec3 p = pose_apply(frame->camera_from_world, point->world), ray = lens_ray(lens, feature->feature.at);
    double rotation[3][3], c[3], rows[3][3], e[3] = {0};
    quat_to_matrix(frame->camera_from_world.rotation, rotation);
    match_covariance(point, &feature->feature, c);
    double a = 1 / sqrt(c[0]), d = 1 / sqrt(c[2] - c[1] * c[1] / c[0]), b = -d * c[1] / c[0];
    double x = p.x / p.z, y = p.y / p.z, depth = feature->depth > 0 ? 1 / depth_absolute_sigma_m(feature->depth) : 0;
    double off_x = lens->fx * (x - ray.x), off_y = lens->fy * (y - ray.y);
    for (int i = 0; i < 3; i++) {
        double by_x = lens->fx / p.z * (rotation[0][i] - x * rotation[2][i]);
        double by_y = lens->fy / p.z * (rotation[1][i] - y * rotation[2][i]);
        rows[0][i] = a * by_x;
        rows[1][i] = b * by_x + d * by_y;
        rows[2][i] = depth * rotation[2][i];
    }
    e[0] = a * off_x;
    e[1] = b * off_x + d * off_y;
    e[2] = depth * (p.z - feature->depth);
    double chi2 = e[0] * e[0] + e[1] * e[1] + e[2] * e[2], slope = 1 / (1 + chi2 / (ROBUST_SIGMAS * ROBUST_SIGMAS));
    for (int r = 0; r < 3; r++)
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 3; j++)
                information->information[i * 3 + j] += slope * rows[r][i] * rows[r][j];
    information->cost += slope * chi2;
    information->numbers += feature->depth > 0 ? 3 : 2;
    information->from =
        v3_add(information->from, v3_unit(v3_sub(pose_inverse(frame->camera_from_world).translation, point->world)));
    information->observations++;
}

static void set_covariance(const struct landmark_information *information, struct place_landmark *point)
{
    static const int ROW[6] = {0, 0, 0, 1, 1, 2}, COLUMN[6] = {0, 1, 2, 1, 2, 2};
    double covariance[9], spare = information->numbers - 3;
    struct vec3 from = v3_scale(information->from, 1.0 / (information->observations ? information->observations : 1));
    point->seen_from[0] = (float)from.x, point->seen_from[1] = (float)from.y, point->seen_from[2] = (float)from.z;
    memset(point->covariance, 0, sizeof point->covariance);
    if (!invert_symmetric(information->information, 3, covariance))
        return;
    // Residuals larger than one standard deviation of chi-square above its mean enlarge the covariance.
    double grow = spare > 0 ? fmax(1, information->cost / (spare + sqrt(2 * spare))) : 1;
    for (int i = 0; i < 6; i++)
        point->covariance[i] = (float)(grow * covariance[ROW[i] * 3 + COLUMN[i]]);
}

enum status map_landmark_covariances(struct map *map)
{
    struct landmark_information *sums = calloc((size_t)map->point_count + 1, sizeof *sums);
    if (!sums)
        return fail(ERR_MEMORY, "no memory for the covariances of %d points", (int)map->point_count);
    for (int32_t i = 0; i < map->frame_count; i++) {
        const struct map_frame *f = &map->frames[i];
        for (int32_t n = 0; f->placed && n < f->feature_count; n++) {
            const struct map_feature *s = &f->features[n];
            if (s->point >= map->held_points)
                add_observation(&sums[s->point], &map->calibration.color, f, s, &map->points[s->point]);
        }
    }
    for (int32_t i = map->held_points; i < map->point_count; i++)
        set_covariance(&sums[i], &map->points[i]);
    free(sums);
    return OK;
}

// Jacobian of a small motion of a tag, in its own axes, by a small motion of the whole world. 6 x 6, row-major.
static void tag_motion_by_world(const struct map_tag *tag, double out[36])
{
    double r[3][3];
    const struct vec3 t = tag->world_from_tag.translation;
    const double skew[3][3] = {{0, t.z, -t.y}, {-t.z, 0, t.x}, {t.y, -t.x, 0}}; // translation by rotation
    quat_to_matrix(tag->world_from_tag.rotation, r);
    memset(out, 0, 36 * sizeof *out);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            out[i * 6 + j] = out[(3 + i) * 6 + 3 + j] = r[j][i];
            for (int k = 0; k < 3; k++)
                out[(3 + i) * 6 + j] += r[k][i] * skew[k][j];
        }
}

// Weight of a tag's k-th number in the fit of a common motion: rotations count as far as they move its corners.
static double common_motion_weight(const struct map_tag *tag, int k)
{
    const double lever = tag->side_m / 2;
    return k < 3 ? lever * lever : 1;
}

// normal += J^T W J of one tag.
static void add_common_normal(const struct map_tag *tag, double normal[36])
{
    double jacobian[36];
    tag_motion_by_world(tag, jacobian);
    for (int k = 0; k < 6; k++)
        for (int i = 0; i < 6; i++)
            for (int j = 0; j < 6; j++) {
                double weighted = common_motion_weight(tag, k) * jacobian[k * 6 + j];
                normal[i * 6 + j] += jacobian[k * 6 + i] * weighted;
            }
}

// The six columns of one tag: by = inverse J^T W. by: its first column; `stride` numbers to a row.
static void set_common_columns(const struct map_tag *tag, const double inverse[36], double *by, int stride)
{
    double jacobian[36];
    tag_motion_by_world(tag, jacobian);
    for (int k = 0; k < 6; k++)
        for (int i = 0; i < 6; i++)
            for (int j = 0; j < 6; j++) {
                double weighted = common_motion_weight(tag, k) * jacobian[k * 6 + j];
                by[i * stride + k] += inverse[i * 6 + j] * weighted;
            }
}

// Weighted least squares: the motion of the whole world that fits small motions of all tags best, as a matrix of 6 rows
// and one column for each of the tags' numbers. False: no tag is mapped.
static bool fit_common_motion(const struct map *map, double *by)
{
    const int n = 6 * map->tag_count;
    double normal[36] = {0}, inverse[36];
    memset(by, 0, 6 * (size_t)n * sizeof *by);
    for (int32_t t = 0; t < map->tag_count; t++)
        if (map->tags[t].mapped)
            add_common_normal(&map->tags[t], normal);
    if (!invert_symmetric(normal, 6, inverse))
        return false;
    for (int32_t t = 0; t < map->tag_count; t++)
        if (map->tags[t].mapped)
            set_common_columns(&map->tags[t], inverse, by + (ptrdiff_t)6 * t, n);
    return true;
}

// Covariances of the common motion: with each tag's numbers (6 rows of n), and its own.
struct common_covariance {
    const double *with_tags;
    double own[36];
    int n;
};

// Element (a, b) of tag t's covariance `c` after the common motion is projected out:
// c - J_a H_b - J_b H_a + J_a C J_b^T, H = with_tags, C = own, J the tag's Jacobian.
static double without_common_motion(double c, const struct common_covariance *covariance, const double jacobian[36],
                                    int column, int a, int b)
{
    for (int i = 0; i < 6; i++) {
        const double *h = &covariance->with_tags[i * covariance->n + column];
        c -= jacobian[a * 6 + i] * h[b] + jacobian[b * 6 + i] * h[a];
        for (int j = 0; j < 6; j++)
            c += jacobian[a * 6 + i] * covariance->own[i * 6 + j] * jacobian[b * 6 + j];
    }
    return c;
}

// Removes the gauge freedom: the part of the tags' covariance that moves all of them together, because the tags
// themselves define the world. all: 6 tag_count on a side; its diagonal blocks change. common, half: 6 rows of
// 6 tag_count, scratch.
static void remove_gauge_freedom(const struct map *map, double *all, double *common, double *half)
{
    const int n = 6 * map->tag_count;
    struct common_covariance g = {.with_tags = half, .n = n};
    if (!fit_common_motion(map, common))
        return;
    memset(half, 0, 6 * (size_t)n * sizeof *half);
    for (int i = 0; i < 6; i++)
        for (int k = 0; k < n; k++)
            for (int j = 0; j < n; j++)
                half[i * n + j] += common[i * n + k] * all[k * n + j];
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < 6; j++)
            for (int k = 0; k < n; k++)
                g.own[i * 6 + j] += half[i * n + k] * common[j * n + k];
    for (int32_t t = 0; t < map->tag_count; t++) {
        double jacobian[36];
        tag_motion_by_world(&map->tags[t], jacobian);
        for (int a = 0; a < 6; a++)
            for (int b = 0; b < 6; b++) {
                double *c = &all[(6 * t + a) * n + 6 * t + b];
                *c = without_common_motion(*c, &g, jacobian, 6 * t, a, b);
            }
    }
}

enum status map_tag_covariances(struct map *map)
{
    if (!map->tag_count)
        return OK;
    const int n = 6 * map->tag_count;
    double *all = calloc((size_t)n * (size_t)n + 1, sizeof *all);
    double *common = calloc(6 * (size_t)n + 1, sizeof *common), *half = calloc(6 * (size_t)n + 1, sizeof *half);
    enum status status = all && common && half
                             ? map_joint_tag_covariance(map, all)
                             : fail(ERR_MEMORY, "no memory for the covariances of %d tags", (int)map->tag_count);
    if (status == OK && !map->has_prior)
        remove_gauge_freedom(map, all, common, half);
    for (int32_t t = 0; t < map->tag_count && status == OK; t++) {
        float *out = map->tags[t].covariance;
        for (int a = 0; a < 6 && !(map->has_prior && map->tags[t].fixed); a++)
            for (int b = a; b < 6; b++)
                *out++ = (float)all[(6 * t + a) * n + 6 * t + b];
    }
    free(all);
    free(common);
    free(half);
    return status;
}

// ---------------------------------------------------------------- map bundle adjust

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

static bool is_included(const struct map_feature *feature, const bool *included)
{
    return feature->point >= 0 && (!included || included[feature->point]);
}

static struct residual_counts count_residuals(const struct map *map, const bool *included)
{
    struct residual_counts n = {0};
    for (int32_t i = 0; i < map->frame_count; i++) {
        const struct map_frame *f = &map->frames[i];
        if (!f->placed)
            continue;
        for (int32_t k = 0; k < f->seen_count; k++) {
            if (map->tags[f->tag_index[k]].mapped) {
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
static void compute_whitening(const struct tag_observation *seen, double out[8][8])
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

static void adjust_arrays_free(struct adjust_arrays *arrays)
{
    free(arrays->cameras);
    free(arrays->squares);
    free(arrays->points);
    free(arrays->corners);
    free(arrays->depths);
    free(arrays->observations);
    free(arrays->moved);
}

static enum status adjust_arrays_alloc(struct adjust_arrays *arrays, const struct map *map,
                                       struct residual_counts counts)
{
    *arrays = (struct adjust_arrays){
        .cameras = calloc((size_t)map->frame_count + 1, sizeof *arrays->cameras),
        .squares = calloc((size_t)map->tag_count + 1, sizeof *arrays->squares),
        .points = calloc((size_t)map->point_count + 1, sizeof *arrays->points),
        .corners = calloc((size_t)counts.corners + 1, sizeof *arrays->corners),
        .depths = calloc((size_t)counts.depths + 1, sizeof *arrays->depths),
        .observations = calloc((size_t)counts.observations + 1, sizeof *arrays->observations),
        .moved = calloc((size_t)map->point_count + 1, sizeof *arrays->moved),
    };
    if (arrays->cameras && arrays->squares && arrays->points && arrays->corners && arrays->depths &&
        arrays->observations && arrays->moved)
        return OK;
    adjust_arrays_free(arrays);
    return fail(ERR_MEMORY, "no memory to adjust the map");
}

static void add_frame_residuals(const struct map *map, int32_t i, const struct adjust_options *options,
                                struct adjust_arrays *arrays)
{
    const struct map_frame *f = &map->frames[i];
    const struct lens *lens = &map->calibration.color;
    const double loose = options->loose_depth > 0 ? options->loose_depth : 1;
    for (int32_t k = 0; k < f->seen_count; k++) {
        if (!map->tags[f->tag_index[k]].mapped)
            continue;
        struct ba_corners *c = &arrays->corners[arrays->used.corners++];
        c->camera = i;
        c->square = f->tag_index[k];
        for (int j = 0; j < 4; j++) {
            c->observed[2 * j] = lens->fx * f->seen[k].ray[j].x;
            c->observed[2 * j + 1] = lens->fy * f->seen[k].ray[j].y;
        }
        compute_whitening(&f->seen[k], c->whiten);
        for (int32_t d = 0; d < f->depths[k].count; d++) {
            const struct depth_sample *s = &f->depths[k].sample[d];
            arrays->depths[arrays->used.depths++] = (struct ba_plane_depth){
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
        struct ba_observation *seen = &arrays->observations[arrays->used.observations++];
        *seen = (struct ba_observation){i, s->point, ray.x, ray.y, {0}, s->depth, loose * sigma_m};
        match_covariance(&map->points[s->point], &s->feature, seen->covariance);
        seen->covariance[0] += options->extra_sigma_px * options->extra_sigma_px;
        seen->covariance[2] += options->extra_sigma_px * options->extra_sigma_px;
    }
}

// A landmark that was not included moves rigidly with the first frame that shows it. moved: point_count times false.
static void move_excluded_points(struct map *map, const struct ba_problem *problem, const bool *included, bool *moved)
{
    for (int32_t i = 0; i < map->frame_count; i++) {
        const struct map_frame *f = &map->frames[i];
        struct pose new_from_old =
            pose_multiply(pose_inverse(problem->cameras[i].camera_from_world), f->camera_from_world);
        for (int32_t k = 0; f->placed && k < f->feature_count; k++) {
            int32_t point = f->features[k].point;
            if (point < map->held_points || included[point] || moved[point])
                continue;
            problem->points[point] = pose_apply(new_from_old, problem->points[point]);
            moved[point] = true;
        }
    }
}

static void apply_solution(struct map *map, const struct ba_problem *problem)
{
    for (int32_t i = 0; i < map->frame_count; i++)
        map->frames[i].camera_from_world = problem->cameras[i].camera_from_world;
    for (int32_t i = 0; i < map->tag_count; i++)
        map->tags[i].world_from_tag = problem->squares[i].world_from_square;
    for (int32_t i = 0; i < map->point_count; i++)
        map->points[i].world = problem->points[i];
}

static enum status adjust_all(struct map *map, const struct adjust_options *options)
{
    const bool *included = options->included;
    if (map->on_step)
        map->on_step(map->self);
    map_undo_rolling_shutter(map);
    struct adjust_arrays a;
    enum status status = adjust_arrays_alloc(&a, map, count_residuals(map, included));
    if (status != OK)
        return status;
    for (int32_t i = 0; i < map->frame_count; i++) {
        a.cameras[i].camera_from_world = map->frames[i].camera_from_world;
        if (map->frames[i].placed)
            add_frame_residuals(map, i, options, &a);
    }
    for (int32_t i = 0; i < map->tag_count; i++)
        a.squares[i] = (struct ba_square){map->tags[i].world_from_tag, map->tags[i].side_m, map->tags[i].fixed};
    for (int32_t i = 0; i < map->point_count; i++)
        a.points[i] = map->points[i].world;
    struct ba_problem problem = {
        .fx = map->calibration.color.fx,
        .fy = map->calibration.color.fy,
        .cameras = a.cameras,
        .squares = a.squares,
        .points = a.points,
        .corners = a.corners,
        .plane_depths = a.depths,
        .observations = a.observations,
        .camera_count = map->frame_count,
        .square_count = map->tag_count,
        .point_count = map->point_count,
        .corner_count = a.used.corners,
        .plane_depth_count = a.used.depths,
        .observation_count = options->fix_frames ? 0 : a.used.observations,
        .held_camera = map->fixed_frame,
        .held_points = map->held_points,
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
        move_excluded_points(map, &problem, included, a.moved);
    if (status == OK)
        apply_solution(map, &problem);
    adjust_arrays_free(&a);
    return status;
}
enum status map_bundle_adjust(struct map *map, int rounds, bool fix_frames, double *cost)
{
    return adjust_all(map, &(struct adjust_options){.rounds = rounds, .fix_frames = fix_frames, .cost = cost});
}

enum status map_bundle_adjust_relaxed(struct map *map, int rounds, double extra_sigma_px)
{
    return adjust_all(map, &(struct adjust_options){.rounds = rounds, .extra_sigma_px = extra_sigma_px});
}

void map_scale_depth(struct map *map, double times)
{
    map->depth_scale *= times;
    for (int32_t i = 0; i < map->frame_count; i++) {
        struct map_frame *f = &map->frames[i];
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

enum status map_bundle_adjust_depth_scale(struct map *map, int rounds)
{
    double times = 1;
    bool tags = false;
    for (int32_t i = 0; i < map->tag_count; i++)
        tags = tags || map->tags[i].mapped;
    enum status status =
        adjust_all(map, &(struct adjust_options){.rounds = rounds, .depth_scale = tags ? &times : NULL});
    if (status == OK && fabs(times - 1) < MAX_DEPTH_SCALE_ERROR)
        map_scale_depth(map, times);
    return status;
}

enum status map_fit_lens(struct map *map, int rounds, struct ba_lens *lens)
{
    double scale = 1;
    *lens = (struct ba_lens){.focal = {1, 1}};
    struct adjust_options options = {.rounds = rounds, .lens = lens};
    if (map_most_observed_tag(map, true) >= 0) { // else depth alone gives the scale
        options.depth_scale = &scale;
        options.loose_depth = LOOSE_DEPTH;
    }
    return adjust_all(map, &options);
}

enum status map_bundle_adjust_subset(struct map *map, int rounds, const bool *included)
{
    return adjust_all(map, &(struct adjust_options){.rounds = rounds, .included = included});
}

enum status map_joint_tag_covariance(struct map *map, double *tags)
{
    return adjust_all(map, &(struct adjust_options){.tag_covariance = tags});
}

struct sum {
    double squares;
    int64_t count;
};

static void add_error(struct sum *sum, double error)
{
    if (isfinite(error)) {
        sum->squares += error * error;
        sum->count++;
    }
}

static double root_mean_square(struct sum sum) { return sum.count ? sqrt(sum.squares / (double)sum.count) : 0; }

static void measure_tag(const struct map *map, const struct map_frame *frame, int32_t k, struct sum *px,
                        struct sum *metres, struct sum *expected)
{
    struct map_tag *tag = &map->tags[frame->tag_index[k]];
    struct pnp_tag fit = {
        .seen = &frame->seen[k], .world_from_tag = tag->world_from_tag, .side_m = tag->side_m, .used = true};
    double error =
        pnp_tag_rms(&fit, NULL, &frame->camera_from_world, map->calibration.color.fx, map->calibration.color.fy);
    if (!tag->mapped || error > 10) // an outlier to the adjustment
        return;
    tag->rms_px += error * error;
    tag->observations++;
    add_error(px, error);
    struct pose camera_from_tag = pose_multiply(frame->camera_from_world, tag->world_from_tag);
    struct vec3 normal = quat_rotate(camera_from_tag.rotation, v3(0, 0, 1));
    for (int32_t d = 0; d < frame->depths[k].count; d++) {
        const struct depth_sample *s = &frame->depths[k].sample[d];
        double slant = normal.x * s->x + normal.y * s->y + normal.z;
        add_error(metres, v3_dot(normal, camera_from_tag.translation) / slant - s->z);
        add_error(expected, depth_absolute_sigma_m(s->z));
    }
}

static void measure_points(const struct map *map, const struct map_frame *frame, struct sum *px, struct sum *metres)
{
    const struct lens *lens = &map->calibration.color;
    for (int32_t k = 0; k < frame->feature_count; k++) {
        const struct map_feature *feature = &frame->features[k];
        if (feature->point < 0)
            continue;
        struct vec3 p = pose_apply(frame->camera_from_world, map->points[feature->point].world);
        add_error(px, map_reprojection_px(lens, p, &feature->feature));
        if (feature->depth > 0)
            add_error(metres, p.z - feature->depth);
    }
}

void map_compute_residuals(struct map *map)
{
    struct sum px = {0}, metres = {0}, expected = {0};
    for (int32_t i = 0; i < map->tag_count; i++) {
        map->tags[i].rms_px = 0;
        map->tags[i].observations = 0;
    }
    for (int32_t i = 0; i < map->frame_count; i++) {
        const struct map_frame *f = &map->frames[i];
        if (!f->placed)
            continue;
        for (int32_t k = 0; k < f->seen_count; k++)
            measure_tag(map, f, k, &px, &metres, &expected);
        if (!map->tag_count)
            measure_points(map, f, &px, &metres);
    }
    for (int32_t i = 0; i < map->tag_count; i++)
        if (map->tags[i].observations)
            map->tags[i].rms_px = sqrt(map->tags[i].rms_px / map->tags[i].observations);
    map->rms_px = root_mean_square(px);
    map->rms_m = root_mean_square(metres);
    map->expected_m = root_mean_square(expected);
}
