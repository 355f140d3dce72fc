#include "surround/alignment/depth_alignment.h"

#include "base/depth_noise.h"
#include "base/linear_algebra.h"
#include "base/memory.h"
#include "base/portable_math.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- depth points

void depth_points_free(struct depth_points *points)
{
    free(points->xyz);
    free(points->sigma);
    *points = (struct depth_points){0};
}

static bool on_surface(const uint16_t *depth, int width, int height, int u, int v)
{
    const uint16_t *at = depth + (size_t)v * (size_t)width + (size_t)u;
    const double z = *at * 1e-3;
    if (z < 0.05)
        return false;
    // Noise of both samples, and a slope of 80 degrees over a pixel at f = 285
    const double max_mm = 1e3 * (depth_difference_m(z) + 0.02 * z);
    const int steps[4] = {u > 0 ? -1 : 0, u + 1 < width ? 1 : 0, v > 0 ? -width : 0, v + 1 < height ? width : 0};
    for (int i = 0; i < 4; i++)
        if (at[steps[i]] && fabs((double)at[steps[i]] - *at) > max_mm)
            return false;
    return true;
}

enum status depth_points_add(struct depth_points *points, const uint16_t *depth, const struct lens *lens,
                             struct pose body_from_camera, int step)
{
    const int more = ((lens->width + step - 1) / step) * ((lens->height + step - 1) / step);
    if (points->count + more > points->capacity) {
        const int capacity = points->count + more;
        float(*xyz)[3] = realloc(points->xyz, (size_t)capacity * sizeof *xyz);
        if (xyz)
            points->xyz = xyz;
        float *sigma = realloc(points->sigma, (size_t)capacity * sizeof *sigma);
        if (sigma)
            points->sigma = sigma;
        if (!xyz || !sigma)
            return fail(ERR_MEMORY, "no memory for the points of a capture");
        points->capacity = capacity;
    }
    double m[3][3];
    quat_to_matrix(body_from_camera.rotation, m);
    const struct vec3 t = body_from_camera.translation;
    for (int v = 0; v < lens->height; v += step)
        for (int u = 0; u < lens->width; u += step) {
            if (!on_surface(depth, lens->width, lens->height, u, v))
                continue;
            const double z = depth[(size_t)v * (size_t)lens->width + (size_t)u] * 1e-3;
            const double x = (u - lens->cx) / lens->fx * z, y = (v - lens->cy) / lens->fy * z;
            float *out = points->xyz[points->count];
            out[0] = (float)(m[0][0] * x + m[0][1] * y + m[0][2] * z + t.x);
            out[1] = (float)(m[1][0] * x + m[1][1] * y + m[1][2] * z + t.y);
            out[2] = (float)(m[2][0] * x + m[2][1] * y + m[2][2] * z + t.z);
            points->sigma[points->count++] = (float)depth_absolute_sigma_m(z);
        }
    return OK;
}

// ---------------------------------------------------------------- voxel map

enum { FIRST_SIZE = 4096 };
#define MAX_VOXELS 1048576 // on each side of the origin: 21 bits a coordinate

static bool voxel_corner(const struct voxel_map *map, const double p[3], int64_t cell[3])
{
    for (int i = 0; i < 3; i++) {
        const double c = floor(p[i] * map->per_m);
        if (!(fabs(c) < MAX_VOXELS))
            return false;
        cell[i] = (int64_t)c;
    }
    return true;
}

static int64_t key_of(const int64_t cell[3])
{
    // The top bit keeps every key from 0
    return (int64_t)(((uint64_t)(cell[0] + MAX_VOXELS) << 42 | (uint64_t)(cell[1] + MAX_VOXELS) << 21 |
                      (uint64_t)(cell[2] + MAX_VOXELS)) +
                     1);
}

// Fibonacci hashing (Knuth 6.4), twice: a product's lower bits know nothing of the key's upper ones, which hold x.
static size_t home_of(const struct voxel_map *map, int64_t key)
{
    uint64_t h = (uint64_t)key * 0x9E3779B97F4A7C15u;
    h = (h ^ h >> 32) * 0x9E3779B97F4A7C15u;
    return (size_t)(h >> 32) & (map->size - 1);
}

static size_t slot_of(const struct voxel_map *map, int64_t key)
{
    size_t slot = home_of(map, key);
    while (map->table[slot].key && map->table[slot].key != key)
        slot = (slot + 1) & (map->size - 1);
    return slot;
}

static struct voxel *allocate_table(size_t size)
{
    struct voxel *table = alloc_cache_aligned(size * sizeof *table);
    if (table)
        memset(table, 0, size * sizeof *table);
    return table;
}

// side_m > 0. ERR_MEMORY.
static enum status voxel_map_open(struct voxel_map *map, double side_m)
{
    *map = (struct voxel_map){
        .side_m = side_m, .per_m = 1 / side_m, .size = FIRST_SIZE, .table = allocate_table(FIRST_SIZE)};
    return map->table ? OK : fail(ERR_MEMORY, "no memory for the map of voxels");
}

// what was zeroed, too
static void voxel_map_close(struct voxel_map *map)
{
    free(map->table);
    *map = (struct voxel_map){0};
}

static enum status grow_map(struct voxel_map *map)
{
    struct voxel_map larger = *map;
    larger.size = map->size * 2;
    larger.table = allocate_table(larger.size);
    if (!larger.table)
        return fail(ERR_MEMORY, "no memory for the map of voxels");
    for (size_t i = 0; i < map->size; i++)
        if (map->table[i].key)
            larger.table[slot_of(&larger, map->table[i].key)] = map->table[i];
    free(map->table);
    *map = larger;
    return OK;
}

// A world point with its standard deviation, seen by capture number `capture` (from 0, rising). Points more than 2^20
// voxels from the origin are left out. ERR_MEMORY: the map is as before.
static enum status voxel_map_add(struct voxel_map *map, const double world[3], double sigma_m, int capture)
{
    int64_t cell[3];
    if (!voxel_corner(map, world, cell))
        return OK;
    if (map->used * 2 >= map->size) {
        const enum status status = grow_map(map);
        if (status != OK)
            return status;
    }
    const int64_t key = key_of(cell);
    struct voxel *v = &map->table[slot_of(map, key)];
    if (!v->key) {
        *v = (struct voxel){.key = key, .last = -1};
        map->used++;
    }
    const float w = (float)(1 / (sigma_m * sigma_m));
    float d[3];
    for (int i = 0; i < 3; i++)
        d[i] = (float)(world[i] - (double)cell[i] * map->side_m);
    for (int i = 0, k = 0; i < 3; i++) {
        v->sum[i] += w * d[i];
        for (int j = i; j < 3; j++)
            v->square[k++] += w * d[i] * d[j];
    }
    v->weight += w;
    v->count++;
    v->captures += v->last != capture;
    v->last = capture;
    return OK;
}

// A point that will be added soon: its voxel is fetched from memory meanwhile.
static void voxel_map_expect(const struct voxel_map *map, const double world[3])
{
    int64_t cell[3];
    if (voxel_corner(map, world, cell))
        __builtin_prefetch(&map->table[home_of(map, key_of(cell))], 1);
}

// The voxel that holds a point; NULL: empty.
static const struct voxel *voxel_map_at(const struct voxel_map *map, const double world[3])
{
    int64_t cell[3];
    if (!voxel_corner(map, world, cell))
        return NULL;
    const struct voxel *v = &map->table[slot_of(map, key_of(cell))];
    return v->key ? v : NULL;
}

void voxel_mean(const struct voxel_map *map, const struct voxel *voxel, double mean[3])
{
    const uint64_t key = (uint64_t)voxel->key - 1;
    for (int i = 0; i < 3; i++) {
        const int64_t cell = (int64_t)(key >> (42 - 21 * i) & (2 * MAX_VOXELS - 1)) - MAX_VOXELS;
        mean[i] = (double)cell * map->side_m + (double)voxel->sum[i] / (double)voxel->weight;
    }
}

// Eigenvalues and vectors (columns) of a symmetric matrix, by cyclic Jacobi rotations.
static void diagonalize_symmetric(double a[3][3], double vectors[3][3])
{
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            vectors[i][j] = i == j;
    for (int sweep = 0; sweep < 8; sweep++)
        for (int p = 0; p < 2; p++)
            for (int q = p + 1; q < 3; q++) {
                if (fabs(a[p][q]) < 1e-30)
                    continue;
                const double tau = (a[q][q] - a[p][p]) / (2 * a[p][q]);
                const double t = (tau < 0 ? -1 : 1) / (fabs(tau) + sqrt(1 + tau * tau));
                const double c = 1 / sqrt(1 + t * t), s = t * c;
                for (int k = 0; k < 3; k++) {
                    const double x = a[k][p], y = a[k][q];
                    a[k][p] = c * x - s * y;
                    a[k][q] = s * x + c * y;
                }
                for (int k = 0; k < 3; k++) {
                    const double x = a[p][k], y = a[q][k];
                    a[p][k] = c * x - s * y;
                    a[q][k] = s * x + c * y;
                }
                for (int k = 0; k < 3; k++) {
                    const double x = vectors[k][p], y = vectors[k][q];
                    vectors[k][p] = c * x - s * y;
                    vectors[k][q] = s * x + c * y;
                }
            }
}

// The plane of a voxel's points: unit normal (its sign is free) and standard deviation across it. False: fewer than 6
// points, or not flat (thicker than a third of its second-longest extent).
static bool voxel_plane(const struct voxel *voxel, double normal[3], double *thickness_m)
{
    if (voxel->count < 6)
        return false;
    const double weight = voxel->weight;
    double a[3][3], vectors[3][3];
    for (int i = 0, k = 0; i < 3; i++)
        for (int j = i; j < 3; j++, k++)
            a[i][j] = a[j][i] =
                (double)voxel->square[k] / weight - (double)voxel->sum[i] * (double)voxel->sum[j] / (weight * weight);
    diagonalize_symmetric(a, vectors);
    int min = 0;
    for (int i = 1; i < 3; i++)
        if (a[i][i] < a[min][min])
            min = i;
    const double other = fmin(a[(min + 1) % 3][(min + 1) % 3], a[(min + 2) % 3][(min + 2) % 3]);
    const double across = a[min][min] > 0 ? a[min][min] : 0;
    for (int i = 0; i < 3; i++)
        normal[i] = vectors[i][min];
    *thickness_m = sqrt(across);
    return across * 9 < other;
}

// ---------------------------------------------------------------- plane refinement

enum { ITERATIONS = 6 };
#define REFINED_SHIFT_M 0.05
#define REFINED_TURN    0.017
#define HUBER           1.5 // standard deviations
// Errors of neighbouring samples are alike, and a voxel's plane is no truth either: all samples of a capture count as
// so many independent ones, and so many of a voxel as one.
#define INDEPENDENT 200
#define VOXEL_ALIKE 20
#define MAX_OFF_M   0.08 // a point farther from the voxel's plane belongs to something else

// A voxel's plane, kept: voxels are asked for again and again. A later voxel in the same slot replaces it.
enum { KEPT_PLANES = 16384 };
struct kept_plane {
    const struct voxel *voxel; // NULL: empty
    bool flat;
    double normal[3], mean[3], variance;
};

static const struct kept_plane *plane_of(const struct voxel_map *planes, struct kept_plane *kept, const double p[3])
{
    const struct voxel *v = voxel_map_at(planes, p);
    if (!v)
        return NULL;
    struct kept_plane *slot = &kept[(size_t)(v - planes->table) % KEPT_PLANES];
    if (slot->voxel != v) {
        double thickness = 0;
        slot->voxel = v;
        slot->flat = voxel_plane(v, slot->normal, &thickness);
        voxel_mean(planes, v, slot->mean);
        slot->variance = thickness * thickness / v->count * VOXEL_ALIKE;
    }
    return slot->flat ? slot : NULL;
}

static void add_point(struct normal_equations *equations, const struct kept_plane *plane, const double p[3],
                      const double origin[3], double sigma, double share)
{
    double r = 0, arm[3];
    for (int i = 0; i < 3; i++) {
        r += plane->normal[i] * (p[i] - plane->mean[i]);
        arm[i] = p[i] - origin[i];
    }
    if (fabs(r) > MAX_OFF_M)
        return;
    const double s = sqrt(sigma * sigma + plane->variance) + 1e-3;
    const double huber = fabs(r) <= HUBER * s ? 1 : HUBER * s / fabs(r);
    normal_equations_add(equations, plane->normal, arm, r, share * huber / (s * s));
}

// Adds the prior and holds the degrees that leave the floor; then the step.
static void solve_step(struct normal_equations *equations, const struct pose *now, const struct pose *prior,
                       double step[6])
{
    const struct quat turned = quat_multiply(prior->rotation, quat_conjugate(now->rotation));
    const struct vec3 back = quat_to_rotation_vector(turned), away = v3_sub(prior->translation, now->translation);
    const double to_prior[6] = {back.x, back.y, back.z, away.x, away.y, away.z};
    for (int a = 0; a < 6; a++) {
        const double sigma = a < 3 ? REFINED_TURN : REFINED_SHIFT_M;
        const bool held = a == 0 || a == 1 || a == 5;
        const double information = held ? 1e15 : 1 / (sigma * sigma);
        equations->h[7 * a] += information;
        equations->g[a] += information * (held ? 0 : to_prior[a]);
        step[a] = equations->g[a];
    }
    if (cholesky_factor(equations->h, 6))
        cholesky_solve(equations->h, 6, step);
    else
        memset(step, 0, 6 * sizeof *step);
}

struct refinement {
    const struct voxel_map *planes;
    const struct depth_points *points;
    int stride;
    struct kept_plane *kept;
};

static void add_points(const struct refinement *refinement, const struct pose *now, struct normal_equations *equations)
{
    const double origin[3] = {now->translation.x, now->translation.y, now->translation.z};
    const double share = fmin(1, (double)INDEPENDENT * refinement->stride / (refinement->points->count + 1));
    double m[3][3];
    quat_to_matrix(now->rotation, m);
    for (int i = 0; i < refinement->points->count; i += refinement->stride) {
        const float *b = refinement->points->xyz[i];
        double p[3];
        for (int k = 0; k < 3; k++)
            p[k] = m[k][0] * (double)b[0] + m[k][1] * (double)b[1] + m[k][2] * (double)b[2] + origin[k];
        const struct kept_plane *plane = plane_of(refinement->planes, refinement->kept, p);
        if (plane)
            add_point(equations, plane, p, origin, refinement->points->sigma[i], share);
    }
}

// Moves *world_from_body so that the points lie on the map's planes: about the floor's normal and along the floor.
// The pose given is a soft prior (5 cm, 1 degree), for directions that the points leave open. At most about `max`
// points are used. more: further evidence; NULL: none. ERR_MEMORY.
static enum status plane_refine(const struct voxel_map *planes, const struct depth_points *points, int max,
                                const struct pose_evidence *more, struct pose *world_from_body)
{
    const struct pose prior = *world_from_body;
    struct refinement r = {planes, points, points->count > max ? points->count / max : 1,
                           calloc(KEPT_PLANES, sizeof *r.kept)};
    if (!r.kept)
        return fail(ERR_MEMORY, "no memory for refining an alignment");
    for (int it = 0; it < ITERATIONS; it++) {
        struct normal_equations e = {0};
        const struct pose now = *world_from_body;
        double step[6];
        add_points(&r, &now, &e);
        if (more && more->add)
            more->add(more->self, &now, &e);
        solve_step(&e, &now, &prior, step);
        const struct quat turn = quat_from_rotation_vector(v3(step[0], step[1], step[2]));
        world_from_body->rotation = quat_unit(quat_multiply(turn, now.rotation));
        world_from_body->translation = v3_add(now.translation, v3(step[3], step[4], step[5]));
        if (fabs(step[2]) < 1e-5 && fabs(step[3]) < 5e-5 && fabs(step[4]) < 5e-5)
            break;
    }
    free(r.kept);
    return OK;
}

// ---------------------------------------------------------------- branch and bound

static const double PRIOR_SHIFT_M = 0.05, PRIOR_TURN = 0.02;

struct search_options search_default_options(void)
{
    return (struct search_options){.reach = 32, .turns = 16, .prior = 1};
}

enum status search_grid_make(struct search_grid *grid, const double low[2], const double high[2])
{
    *grid = (struct search_grid){.x0 = low[0], .y0 = low[1]};
    const double w = ceil((high[0] - low[0]) / SEARCH_CELL_M), h = ceil((high[1] - low[1]) / SEARCH_CELL_M);
    assert(w > 0 && h > 0);
    if (w > 8192 || h > 8192)
        return fail(ERR_INPUT, "a capture's points spread over more than %d m; is the depth in millimetres?",
                    (int)(8192 * SEARCH_CELL_M));
    grid->width = (int)w;
    grid->height = (int)h;
    for (int l = 0; l <= SEARCH_LEVELS; l++)
        if (!(grid->levels[l] = calloc((size_t)grid->width * (size_t)grid->height, 1))) {
            search_grid_free(grid);
            return fail(ERR_MEMORY, "no memory for aligning captures");
        }
    return OK;
}

void search_grid_free(struct search_grid *grid)
{
    for (int l = 0; l <= SEARCH_LEVELS; l++)
        free(grid->levels[l]);
    *grid = (struct search_grid){0};
}

void search_grid_mark(struct search_grid *grid, double x, double y)
{
    const double u = (x - grid->x0) / SEARCH_CELL_M, v = (y - grid->y0) / SEARCH_CELL_M;
    const double r = SEARCH_EPSILON_M / SEARCH_CELL_M;
    if (!(u > -r - 1 && v > -r - 1 && u < grid->width + r + 1 && v < grid->height + r + 1))
        return;
    for (int j = (int)floor(v - r); j <= (int)floor(v + r); j++)
        for (int i = (int)floor(u - r); i <= (int)floor(u + r); i++) {
            const double dx = i + 0.5 - u, dy = j + 0.5 - v;
            if (i >= 0 && j >= 0 && i < grid->width && j < grid->height && dx * dx + dy * dy <= r * r)
                grid->levels[0][(size_t)j * (size_t)grid->width + (size_t)i] = 1;
        }
}

// level l + 1 at (x, y): maximum of level l at (x, y), (x + s, y), (x, y + s), (x + s, y + s) with s = 2^l.
void search_grid_finish(struct search_grid *grid)
{
    const int w = grid->width, h = grid->height;
    for (int l = 0; l < SEARCH_LEVELS; l++) {
        const int s = 1 << l;
        for (int y = 0; y < h; y++) {
            const uint8_t *here = grid->levels[l] + (size_t)y * (size_t)w;
            const uint8_t *below = grid->levels[l] + (size_t)(y + s < h ? y + s : h - 1) * (size_t)w;
            uint8_t *out = grid->levels[l + 1] + (size_t)y * (size_t)w;
            const uint8_t keep = y + s < h ? 1 : 0;
            for (int x = 0; x + s < w; x++)
                out[x] = (uint8_t)(here[x] | here[x + s] | (keep & (below[x] | below[x + s])));
            for (int x = w - s < 0 ? 0 : w - s; x < w; x++)
                out[x] = (uint8_t)(here[x] | (keep & below[x]));
        }
    }
}

struct search {
    const struct search_grid *grid;
    const struct search_options *options;
    int count;
    int32_t (*cells)[2];         // of each turn's turned points, turn-major
    int64_t per_shift, per_turn; // cost of a squared step, 2^-16 points
    struct search_result best;
};

static int64_t cost_of(const struct search *search, int turn, int64_t x, int64_t y)
{
    return search->per_shift * (x * x + y * y) + search->per_turn * turn * turn;
}

static enum status start_search(struct search *search, const double (*points)[2], const double guess[3])
{
    const struct search_options *options = search->options;
    const int turns = 2 * options->turns + 1;
    search->cells = malloc(((size_t)turns * (size_t)search->count + 1) * sizeof *search->cells);
    if (!search->cells)
        return fail(ERR_MEMORY, "no memory for aligning captures");
    for (int t = 0; t < turns; t++) {
        const double angle = guess[2] + (t - options->turns) * SEARCH_TURN_STEP;
        const double c = portable_cos(angle), n = portable_sin(angle);
        int32_t(*out)[2] = search->cells + (size_t)t * (size_t)search->count;
        for (int i = 0; i < search->count; i++) {
            const double x = c * points[i][0] - n * points[i][1] + guess[0];
            const double y = n * points[i][0] + c * points[i][1] + guess[1];
            out[i][0] = (int32_t)floor((x - search->grid->x0) / SEARCH_CELL_M);
            out[i][1] = (int32_t)floor((y - search->grid->y0) / SEARCH_CELL_M);
        }
    }
    const double share = 65536.0 * 0.01 * search->count;
    const double shift = SEARCH_CELL_M / (PRIOR_SHIFT_M * options->prior),
                 turn = SEARCH_TURN_STEP / (PRIOR_TURN * options->prior);
    search->per_shift = (int64_t)(share * shift * shift) + 1; // at least 1: of equal answers the nearest
    search->per_turn = (int64_t)(share * turn * turn) + 1;
    search->best = (struct search_result){.score = INT64_MIN};
    return OK;
}

// Points on marked cells when shifted by any of the block's shifts: an upper bound of each one's hits; at level 0
// exact.
static int hits_of(struct search *search, int turn, int x, int y, int level)
{
    const struct search_grid *g = search->grid;
    const uint8_t *map = g->levels[level];
    int32_t(*cells)[2] = search->cells + (size_t)(turn + search->options->turns) * (size_t)search->count;
    const int side = 1 << level;
    int hits = 0;
    for (int i = 0; i < search->count; i++) {
        int u = cells[i][0] + x, v = cells[i][1] + y;
        if (u < 0 && u + side > 0) // a block that begins left of the grid
            u = 0;
        if (v < 0 && v + side > 0)
            v = 0;
        if (u >= 0 && v >= 0 && u < g->width && v < g->height)
            hits += map[(size_t)v * (size_t)g->width + (size_t)u];
    }
    search->best.lookups += search->count;
    return hits;
}

// Whether (turn, x, y) comes before the best in the order that ends every tie.
static bool is_earlier(const struct search_result *best, int turn, int x, int y)
{
    if (turn != best->turn)
        return turn < best->turn;
    return y != best->y ? y < best->y : x < best->x;
}

static void offer_result(struct search *search, int turn, int x, int y, int hits)
{
    const int64_t score = (int64_t)hits * 65536 - cost_of(search, turn, x, y);
    if (score < search->best.score || (score == search->best.score && !is_earlier(&search->best, turn, x, y)))
        return;
    search->best = (struct search_result){turn, x, y, hits, score, search->best.lookups};
}

struct node {
    int turn, x, y, level;
    int64_t bound;
};

static int64_t least_square(int from, int side, int reach)
{
    const int to = from + side - 1 < reach ? from + side - 1 : reach;
    if (from <= 0 && to >= 0)
        return 0;
    const int64_t near = from > 0 ? from : -to;
    return near * near;
}

static struct node bounded_node(struct search *search, int turn, int x, int y, int level)
{
    const int side = 1 << level, reach = search->options->reach;
    const int64_t cost = search->per_shift * (least_square(x, side, reach) + least_square(y, side, reach)) +
                         search->per_turn * turn * turn;
    return (struct node){turn, x, y, level, (int64_t)hits_of(search, turn, x, y, level) * 65536 - cost};
}

static int by_bound(const void *a, const void *b)
{
    const struct node *x = a, *y = b;
    if (x->bound != y->bound)
        return x->bound > y->bound ? -1 : 1;
    if (x->turn != y->turn)
        return x->turn < y->turn ? -1 : 1;
    if (x->y != y->y)
        return x->y < y->y ? -1 : 1;
    return (x->x > y->x) - (x->x < y->x);
}

// Depth first, the better child first. At most 6 levels deep.
static void visit_node(struct search *search, const struct node *node)
{
    if (node->bound < search->best.score)
        return;
    if (node->level == 0) {
        offer_result(search, node->turn, node->x, node->y,
                     (int)((node->bound + cost_of(search, node->turn, node->x, node->y)) / 65536));
        return;
    }
    struct node children[4];
    int count = 0;
    const int half = 1 << (node->level - 1), reach = search->options->reach;
    for (int i = 0; i < 4; i++) {
        const int x = node->x + (i & 1) * half, y = node->y + (i >> 1) * half;
        if (x <= reach && y <= reach)
            children[count++] = bounded_node(search, node->turn, x, y, node->level - 1);
    }
    qsort(children, (size_t)count, sizeof *children, by_bound);
    for (int i = 0; i < count; i++)
        visit_node(search, &children[i]);
}

enum status search_branch_and_bound(const struct search_grid *grid, const double (*points)[2], int count,
                                    const double guess[3], const struct search_options *how, struct search_result *out)
{
    struct search s = {.grid = grid, .options = how, .count = count};
    enum status status = start_search(&s, points, guess);
    if (status != OK)
        return status;
    const int side = 1 << SEARCH_LEVELS, blocks = (2 * how->reach + side) / side;
    const int roots = blocks * blocks * (2 * how->turns + 1);
    struct node *nodes = malloc((size_t)roots * sizeof *nodes);
    if (!nodes) {
        free(s.cells);
        return fail(ERR_MEMORY, "no memory for aligning captures");
    }
    int n = 0;
    for (int turn = -how->turns; turn <= how->turns; turn++)
        for (int j = 0; j < blocks; j++)
            for (int i = 0; i < blocks; i++)
                nodes[n++] = bounded_node(&s, turn, i * side - how->reach, j * side - how->reach, SEARCH_LEVELS);
    qsort(nodes, (size_t)n, sizeof *nodes, by_bound);
    for (int i = 0; i < n; i++)
        visit_node(&s, &nodes[i]);
    free(nodes);
    free(s.cells);
    *out = s.best;
    return OK;
}

// ---------------------------------------------------------------- depth alignment

#define OUTLINE_M 0.02
#define PLANES_M  0.1
#define LOW_M     0.08 // heights above the floor whose points are compared
#define HIGH_M    0.85
#define MIN_HITS  0.5 // share of a capture's points that must fit; below, the search is widened
enum { REFINED_POINTS = 12000, WIDENED = 4, FEWEST_POINTS = 30, MAX_OUTLINE = 1500 };
enum { AHEAD = 16 }; // points whose voxels are fetched while earlier ones are added

enum status depth_alignment_open(struct depth_alignment *alignment, double surface_m)
{
    *alignment = (struct depth_alignment){.world_from_body = POSE_IDENTITY, .odometry = POSE_IDENTITY};
    enum status status = voxel_map_open(&alignment->surface, surface_m);
    if (status == OK)
        status = voxel_map_open(&alignment->planes, PLANES_M);
    if (status == OK)
        status = voxel_map_open(&alignment->outline, OUTLINE_M);
    if (status != OK)
        depth_alignment_close(alignment);
    return status;
}

void depth_alignment_close(struct depth_alignment *alignment)
{
    voxel_map_close(&alignment->surface);
    voxel_map_close(&alignment->planes);
    voxel_map_close(&alignment->outline);
    *alignment = (struct depth_alignment){0};
}

// The body's pose at a time between captures or before the newest has arrived: the last aligned pose, moved on by the
// odometry since.
static struct pose depth_alignment_bridge(const struct depth_alignment *alignment, struct pose odometry)
{
    return pose_multiply(alignment->world_from_body, pose_multiply(pose_inverse(alignment->odometry), odometry));
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
        status = fail(ERR_MEMORY, "no memory for aligning captures");
    int n = 0;
    for (size_t i = 0; status == OK && i < cells.size; i++)
        if (cells.table[i].key && cells.table[i].count >= 2) { // a single sample may be a flying pixel
            double mean[3];
            voxel_mean(&cells, &cells.table[i], mean);
            list[n][0] = mean[0];
            list[n++][1] = mean[1];
        }
    voxel_map_close(&cells);
    const int stride = n / MAX_OUTLINE + 1;
    for (int i = 0; i * stride < n; i++)
        memcpy(list[i], list[i * stride], sizeof *list);
    *out = list;
    *count = (n + stride - 1) / stride;
    return status;
}

static enum status make_grid(const struct depth_alignment *alignment, const double (*points)[2], int count,
                             const double guess[3], const struct search_options *options, struct search_grid *grid)
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
        options->reach * SEARCH_CELL_M + SEARCH_EPSILON_M + sqrt(farthest) * options->turns * SEARCH_TURN_STEP;
    for (int k = 0; k < 2; k++) {
        low[k] -= margin;
        high[k] += margin;
    }
    const enum status status = search_grid_make(grid, low, high);
    for (size_t i = 0; status == OK && i < alignment->outline.size; i++)
        if (alignment->outline.table[i].key && alignment->outline.table[i].count >= 2) {
            double mean[3];
            voxel_mean(&alignment->outline, &alignment->outline.table[i], mean);
            search_grid_mark(grid, mean[0], mean[1]);
        }
    if (status == OK)
        search_grid_finish(grid);
    return status;
}

static enum status search_once(struct depth_alignment *alignment, const double (*points)[2], int count,
                               const double guess[3], const struct search_options *options)
{
    struct search_grid grid;
    enum status status = make_grid(alignment, points, count, guess, options, &grid);
    if (status != OK)
        return status;
    status = search_branch_and_bound(&grid, points, count, guess, options, &alignment->search);
    search_grid_free(&grid);
    return status;
}

// The pose after the search, from the guess. NOTHING: it does not fit.
static enum status search_pose(struct depth_alignment *alignment, const struct depth_points *points, struct pose *pose)
{
    double(*outline)[2];
    int count;
    enum status status = outline_of(points, &outline, &count);
    const struct vec3 ahead = quat_rotate(pose->rotation, v3(1, 0, 0));
    const double guess[3] = {pose->translation.x, pose->translation.y, portable_atan2(ahead.y, ahead.x)};
    struct search_options options = search_default_options();
    if (status == OK && count >= FEWEST_POINTS) {
        status = search_once(alignment, (const double(*)[2])outline, count, guess, &options);
        if (status == OK && alignment->search.hits < MIN_HITS * count) { // the odometry may have jumped
            options.reach *= WIDENED;
            options.turns *= WIDENED;
            options.prior *= WIDENED;
            status = search_once(alignment, (const double(*)[2])outline, count, guess, &options);
            if (status == OK && alignment->search.hits < MIN_HITS * count)
                status = NOTHING;
        }
    } else if (status == OK)
        alignment->search = (struct search_result){0}; // nothing to compare: the guess stands
    free(outline);
    if (status != OK)
        return status;
    const struct quat turn = quat_from_rotation_vector(v3(0, 0, alignment->search.turn * SEARCH_TURN_STEP));
    pose->rotation = quat_unit(quat_multiply(turn, pose->rotation));
    pose->translation.x += alignment->search.x * SEARCH_CELL_M;
    pose->translation.y += alignment->search.y * SEARCH_CELL_M;
    return OK;
}

static void world_point(const double m[3][3], const struct vec3 *t, const float b[3], double p[3])
{
    const double shift[3] = {t->x, t->y, t->z};
    for (int k = 0; k < 3; k++)
        p[k] = m[k][0] * (double)b[0] + m[k][1] * (double)b[1] + m[k][2] * (double)b[2] + shift[k];
}

static void expect_point(const struct depth_alignment *alignment, const double p[3], bool outline)
{
    const double flat[3] = {p[0], p[1], 0};
    voxel_map_expect(&alignment->surface, p);
    voxel_map_expect(&alignment->planes, p);
    if (outline)
        voxel_map_expect(&alignment->outline, flat);
}

static enum status merge_points(struct depth_alignment *alignment, const struct depth_points *points,
                                const struct pose *pose)
{
    double m[3][3];
    quat_to_matrix(pose->rotation, m);
    enum status status = OK;
    double ahead[AHEAD][3] = {{0}};
    for (int i = 0; status == OK && i < points->count + AHEAD; i++) {
        double *slot = ahead[i % AHEAD], p[3] = {slot[0], slot[1], slot[2]};
        if (i < points->count) {
            world_point((const double(*)[3])m, &pose->translation, points->xyz[i], slot);
            expect_point(alignment, slot, is_compared(points->xyz[i][2]));
        }
        const int now = i - AHEAD;
        if (now < 0)
            continue;
        const double sigma = points->sigma[now];
        status = voxel_map_add(&alignment->surface, p, sigma, alignment->capture_count);
        if (status == OK && now % 2 == 0)
            status = voxel_map_add(&alignment->planes, p, sigma, alignment->capture_count);
        if (status == OK && is_compared(points->xyz[now][2])) {
            p[2] = 0;
            status = voxel_map_add(&alignment->outline, p, sigma, alignment->capture_count);
        }
    }
    return status;
}

enum status depth_alignment_unify(struct depth_alignment *alignment, const struct depth_points *points,
                                  struct pose world_from_body)
{
    const enum status status = merge_points(alignment, points, &world_from_body);
    if (status == OK)
        alignment->capture_count++;
    return status;
}

enum status depth_alignment_add(struct depth_alignment *alignment, const struct depth_points *points,
                                struct pose odometry, struct pose *world_from_body)
{
    struct pose pose = alignment->capture_count ? depth_alignment_bridge(alignment, odometry) : POSE_IDENTITY;
    *world_from_body = pose;
    enum status status = OK;
    if (alignment->capture_count) {
        status = search_pose(alignment, points, &pose);
        if (status != OK)
            return status;
        status = plane_refine(&alignment->planes, points, REFINED_POINTS, &alignment->more, &pose);
        if (status != OK)
            return status;
    }
    status = merge_points(alignment, points, &pose);
    if (status != OK)
        return status;
    alignment->odometry = odometry;
    alignment->world_from_body = *world_from_body = pose;
    alignment->capture_count++;
    return OK;
}
