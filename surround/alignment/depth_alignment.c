#include "surround/alignment/depth_alignment.h"

#include "surround/alignment/plane_refinement.h"
#include "base/portable_math.h"

#include <stdlib.h>
#include <string.h>

#define OUTLINE_M  0.02
#define PLANES_M   0.1
#define LOW_M      0.08 // heights above the floor whose points are compared
#define HIGH_M     0.85
#define LEAST_HITS 0.5 // share of a capture's points that must fit; below, the search is widened
enum { REFINED_POINTS = 12000, WIDENED = 4, FEWEST_POINTS = 30, MOST_OUTLINE = 1500 };
enum { AHEAD = 16 }; // points whose voxels are fetched while earlier ones are added

enum status depth_alignment_open(struct depth_alignment *a, double surface_m)
{
    *a = (struct depth_alignment){.world_from_body = POSE_IDENTITY, .odometry = POSE_IDENTITY};
    enum status status = voxel_map_open(&a->surface, surface_m);
    if (status == OK)
        status = voxel_map_open(&a->planes, PLANES_M);
    if (status == OK)
        status = voxel_map_open(&a->outline, OUTLINE_M);
    if (status != OK)
        depth_alignment_close(a);
    return status;
}

void depth_alignment_close(struct depth_alignment *a)
{
    voxel_map_close(&a->surface);
    voxel_map_close(&a->planes);
    voxel_map_close(&a->outline);
    *a = (struct depth_alignment){0};
}

struct pose depth_alignment_bridge(const struct depth_alignment *a, struct pose odometry)
{
    return pose_multiply(a->world_from_body, pose_multiply(pose_inverse(a->odometry), odometry));
}

static bool is_compared(double height) { return height >= LOW_M && height <= HIGH_M; }

// One point for each 2 cm cell of the floor that a capture's compared points cover, in the body's axes.
static enum status outline_of(const struct depth_points *points, double (**out)[2], int *count)
{
    struct voxel_map cells;
    enum status status = voxel_map_open(&cells, OUTLINE_M);
    for (int i = 0; status == OK && i < points->count; i++) {
        const double flat[3] = {points->xyz[i][0], points->xyz[i][1], 0};
        if (is_compared(points->xyz[i][2]))
            status = voxel_map_add(&cells, flat, points->sigma[i], 0);
    }
    double(*list)[2] = status == OK ? malloc((cells.used + 1) * sizeof *list) : NULL;
    if (status == OK && !list)
        status = fail(ERR_MEMORY, "out of memory");
    int n = 0;
    for (size_t i = 0; status == OK && i < cells.size; i++)
        if (cells.table[i].key && cells.table[i].count >= 2) { // a single sample may be a flying pixel
            double mean[3];
            voxel_mean(&cells, &cells.table[i], mean);
            list[n][0] = mean[0];
            list[n++][1] = mean[1];
        }
    voxel_map_close(&cells);
    const int stride = n / MOST_OUTLINE + 1;
    for (int i = 0; i * stride < n; i++)
        memcpy(list[i], list[i * stride], sizeof *list);
    *out = list;
    *count = (n + stride - 1) / stride;
    return status;
}

static enum status make_grid(const struct depth_alignment *a, const double (*points)[2], int count,
                             const double guess[3], const struct search_options *how, struct search_grid *grid)
{
    double low[2] = {guess[0], guess[1]}, high[2] = {guess[0], guess[1]};
    const double c = portable_cos(guess[2]), s = portable_sin(guess[2]);
    double farthest = 0;
    for (int i = 0; i < count; i++) {
        const double p[2] = {c * points[i][0] - s * points[i][1] + guess[0],
                             s * points[i][0] + c * points[i][1] + guess[1]};
        for (int k = 0; k < 2; k++) {
            low[k] = p[k] < low[k] ? p[k] : low[k];
            high[k] = p[k] > high[k] ? p[k] : high[k];
        }
        farthest = fmax(farthest, points[i][0] * points[i][0] + points[i][1] * points[i][1]);
    }
    const double margin =
        how->reach * SEARCH_CELL_M + SEARCH_EPSILON_M + sqrt(farthest) * how->turns * SEARCH_TURN_STEP;
    for (int k = 0; k < 2; k++) {
        low[k] -= margin;
        high[k] += margin;
    }
    const enum status status = search_grid_make(grid, low, high);
    for (size_t i = 0; status == OK && i < a->outline.size; i++)
        if (a->outline.table[i].key && a->outline.table[i].count >= 2) {
            double mean[3];
            voxel_mean(&a->outline, &a->outline.table[i], mean);
            search_grid_mark(grid, mean[0], mean[1]);
        }
    if (status == OK)
        search_grid_finish(grid);
    return status;
}

static enum status search_once(struct depth_alignment *a, const double (*points)[2], int count, const double guess[3],
                               const struct search_options *how)
{
    struct search_grid grid;
    enum status status = make_grid(a, points, count, guess, how, &grid);
    if (status != OK)
        return status;
    status = search_branch_and_bound(&grid, points, count, guess, how, &a->search);
    search_grid_free(&grid);
    return status;
}

// The pose after the search, from the guess. NOTHING: it does not fit.
static enum status search_pose(struct depth_alignment *a, const struct depth_points *points, struct pose *pose)
{
    double(*outline)[2];
    int count;
    enum status status = outline_of(points, &outline, &count);
    const struct vec3 ahead = quat_rotate(pose->rotation, v3(1, 0, 0));
    const double guess[3] = {pose->translation.x, pose->translation.y, portable_atan2(ahead.y, ahead.x)};
    struct search_options how = search_default_options();
    if (status == OK && count >= FEWEST_POINTS) {
        status = search_once(a, (const double(*)[2])outline, count, guess, &how);
        if (status == OK && a->search.hits < LEAST_HITS * count) { // the odometry may have jumped
            how.reach *= WIDENED;
            how.turns *= WIDENED;
            how.prior *= WIDENED;
            status = search_once(a, (const double(*)[2])outline, count, guess, &how);
            if (status == OK && a->search.hits < LEAST_HITS * count)
                status = NOTHING;
        }
    } else if (status == OK)
        a->search = (struct search_result){0}; // nothing to compare: the guess stands
    free(outline);
    if (status != OK)
        return status;
    const struct quat turn = quat_from_rotation_vector(v3(0, 0, a->search.turn * SEARCH_TURN_STEP));
    pose->rotation = quat_unit(quat_multiply(turn, pose->rotation));
    pose->translation.x += a->search.x * SEARCH_CELL_M;
    pose->translation.y += a->search.y * SEARCH_CELL_M;
    return OK;
}

static void world_point(const double m[3][3], const struct vec3 *t, const float b[3], double p[3])
{
    const double shift[3] = {t->x, t->y, t->z};
    for (int k = 0; k < 3; k++)
        p[k] = m[k][0] * (double)b[0] + m[k][1] * (double)b[1] + m[k][2] * (double)b[2] + shift[k];
}

static void expect_point(const struct depth_alignment *a, const double p[3], bool outline)
{
    const double flat[3] = {p[0], p[1], 0};
    voxel_map_expect(&a->surface, p);
    voxel_map_expect(&a->planes, p);
    if (outline)
        voxel_map_expect(&a->outline, flat);
}

static enum status unify(struct depth_alignment *a, const struct depth_points *points, const struct pose *pose)
{
    double m[3][3];
    quat_to_matrix(pose->rotation, m);
    enum status status = OK;
    double ahead[AHEAD][3] = {{0}};
    for (int i = 0; status == OK && i < points->count + AHEAD; i++) {
        double *slot = ahead[i % AHEAD], p[3] = {slot[0], slot[1], slot[2]};
        if (i < points->count) {
            world_point((const double(*)[3])m, &pose->translation, points->xyz[i], slot);
            expect_point(a, slot, is_compared(points->xyz[i][2]));
        }
        const int now = i - AHEAD;
        if (now < 0)
            continue;
        const double sigma = points->sigma[now];
        status = voxel_map_add(&a->surface, p, sigma, a->capture_count);
        if (status == OK && now % 2 == 0)
            status = voxel_map_add(&a->planes, p, sigma, a->capture_count);
        if (status == OK && is_compared(points->xyz[now][2])) {
            p[2] = 0;
            status = voxel_map_add(&a->outline, p, sigma, a->capture_count);
        }
    }
    return status;
}

enum status depth_alignment_unify(struct depth_alignment *a, const struct depth_points *points,
                                  struct pose world_from_body)
{
    const enum status status = unify(a, points, &world_from_body);
    if (status == OK)
        a->capture_count++;
    return status;
}

enum status depth_alignment_add(struct depth_alignment *a, const struct depth_points *points, struct pose odometry,
                                struct pose *world_from_body)
{
    struct pose pose = a->capture_count ? depth_alignment_bridge(a, odometry) : POSE_IDENTITY;
    *world_from_body = pose;
    enum status status = OK;
    if (a->capture_count) {
        status = search_pose(a, points, &pose);
        if (status != OK)
            return status;
        status = plane_refine(&a->planes, points, REFINED_POINTS, &a->more, &pose);
        if (status != OK)
            return status;
    }
    status = unify(a, points, &pose);
    if (status != OK)
        return status;
    a->odometry = odometry;
    a->world_from_body = *world_from_body = pose;
    a->capture_count++;
    return OK;
}
