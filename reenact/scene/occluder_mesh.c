// Builds the occluder mesh: fuses a TSDF, extracts its surface, bounds it with spheres.
#include "reenact/scene/occluder_mesh.h"

#include "base/clamp.h"
#include "base/portable_math.h"
#include "base/threads.h"

#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- surface nets

// Naive surface nets of the occluder grid; allocation of its mesh.

static const float MIN_WEIGHT = 0.4F; // about two views from 2 m; chosen by hand

// The net's vertex in the cube from grid point `at`: the mean of the zero crossings on its edges. False: the cube has
// none, or a corner is unknown.
static bool surface_net_point(const struct occluder_grid *grid, size_t at, float out[3])
{
    const size_t step[3] = {1, (size_t)grid->size[0], (size_t)grid->size[0] * (size_t)grid->size[1]};
    float d[8], sum[3] = {0};
    int inside = 0, crossings = 0;
    for (int i = 0; i < 8; i++) {
        size_t corner = at + (i & 1) * step[0] + (size_t)(i >> 1 & 1) * step[1] + (size_t)(i >> 2) * step[2];
        if (!(grid->weight[corner] >= MIN_WEIGHT))
            return false;
        d[i] = grid->sum[corner] / grid->weight[corner];
        inside += d[i] < 0;
    }
    if (inside == 0 || inside == 8)
        return false;
    for (int i = 0; i < 8; i++)
        for (int axis = 0; axis < 3; axis++) {
            int j = i | 1 << axis;
            if (j == i || (d[i] < 0) == (d[j] < 0))
                continue;
            for (int k = 0; k < 3; k++)
                sum[k] += k == axis ? d[i] / (d[i] - d[j]) : (float)(i >> k & 1);
            crossings++;
        }
    const double corner[3] = {grid->corner.x, grid->corner.y, grid->corner.z};
    const size_t cell[3] = {at % step[1], at / step[1] % (size_t)grid->size[1], at / step[2]};
    for (int k = 0; k < 3; k++)
        out[k] = (float)(corner[k] + grid->step * ((double)cell[k] + (double)(sum[k] / (float)crossings)));
    return true;
}

// The quads about the three edges from grid point `at`: each crossed edge joins the vertices of its four cubes.
static void add_quads(const struct occluder_grid *grid, const int32_t *number, size_t at, const int cell[3],
                      struct occluder_mesh *out)
{
    const size_t step[3] = {1, (size_t)grid->size[0], (size_t)grid->size[0] * (size_t)grid->size[1]};
    for (int axis = 0; axis < 3; axis++) {
        int u = (axis + 1) % 3, v = (axis + 2) % 3;
        if (cell[axis] + 1 >= grid->size[axis] || cell[u] < 1 || cell[v] < 1)
            continue;
        size_t to = at + step[axis];
        if (!(grid->weight[at] > 0 && grid->weight[to] > 0) || (grid->sum[at] < 0) == (grid->sum[to] < 0))
            continue;
        const int32_t q[4] = {number[at], number[at - step[u]], number[at - step[u] - step[v]], number[at - step[v]]};
        if (q[0] < 0 || q[1] < 0 || q[2] < 0 || q[3] < 0)
            continue;
        const bool along = grid->sum[at] < 0; // the empty side lies along the axis
        const int32_t corners[6] = {q[0], q[along ? 1 : 3], q[2], q[along ? 0 : 2], q[along ? 2 : 1], q[along ? 3 : 0]};
        for (int i = 0; i < 6; i++)
            out->corners[out->corner_count++] = (uint16_t)corners[i];
    }
}

// Numbers the cubes' vertices; -1: no vertex. False: there are more than OCCLUDER_MAX_POINTS.
static bool add_points(const struct occluder_grid *grid, int32_t *number, struct occluder_mesh *out)
{
    for (int z = 0; z + 1 < grid->size[2]; z++)
        for (int y = 0; y + 1 < grid->size[1]; y++)
            for (int x = 0; x + 1 < grid->size[0]; x++) {
                const size_t at = occluder_grid_index(grid, x, y, z);
                float p[3];
                number[at] = surface_net_point(grid, at, p) ? out->point_count : -1;
                if (number[at] < 0)
                    continue;
                if (out->point_count == OCCLUDER_MAX_POINTS)
                    return false;
                memcpy(out->points[out->point_count++], p, sizeof p);
            }
    return true;
}

static void add_faces(const struct occluder_grid *grid, const int32_t *number, struct occluder_mesh *out)
{
    for (int z = 0; z + 1 < grid->size[2]; z++)
        for (int y = 0; y + 1 < grid->size[1]; y++)
            for (int x = 0; x + 1 < grid->size[0]; x++)
                add_quads(grid, number, occluder_grid_index(grid, x, y, z), (const int[3]){x, y, z}, out);
}

void occluder_mesh_free(struct occluder_mesh *mesh)
{
    free(mesh->points);
    free(mesh->corners);
    free(mesh->spheres);
    *mesh = (struct occluder_mesh){0};
}

enum status occluder_surface_nets(const struct occluder_grid *grid, struct occluder_mesh *out, bool *too_large)
{
    const size_t count = (size_t)grid->size[0] * (size_t)grid->size[1] * (size_t)grid->size[2];
    int32_t *number = malloc(sizeof *number * count);
    *out = (struct occluder_mesh){.points = malloc(sizeof *out->points * OCCLUDER_MAX_POINTS),
                                  .corners = malloc(sizeof *out->corners * 18 * OCCLUDER_MAX_POINTS)};
    *too_large = false;
    enum status status =
        number && out->points && out->corners ? OK : fail(ERR_MEMORY, "no memory for the room's surface");
    if (status == OK)
        *too_large = !add_points(grid, number, out);
    if (status == OK && !*too_large) {
        add_faces(grid, number, out);
        status = out->corner_count ? OK : NOTHING;
    }
    free(number);
    if (status != OK || *too_large)
        occluder_mesh_free(out);
    return status;
}

// ---------------------------------------------------------------- occlusion frustum

// Culling of the occluder mesh by an occlusion frustum.

void occlusion_frustum_add(struct occlusion_frustum *frustum, struct vec3 center, double radius_m)
{
    const double across[2] = {center.x, center.y}, steepest = 1.4; // radians; a side beyond is unbounded
    const bool first = !(frustum->farthest_m > 0);
    if (!(center.z + radius_m > 0))
        return; // behind the viewpoint
    frustum->farthest_m = fmax(frustum->farthest_m, center.z + radius_m);
    for (int i = 0; i < 2; i++) {
        const double away = portable_hypot(across[i], center.z),
                     half = away > radius_m ? portable_asin(radius_m / away) : INFINITY;
        const double to = portable_atan2(across[i], center.z), from_rad = to - half, to_rad = to + half;
        const double low = from_rad > -steepest ? portable_tan(fmin(from_rad, steepest)) : -INFINITY;
        const double high = to_rad < steepest ? portable_tan(fmax(to_rad, -steepest)) : INFINITY;
        frustum->low[i] = first ? low : fmin(frustum->low[i], low);
        frustum->high[i] = first ? high : fmax(frustum->high[i], high);
    }
}

struct occlusion_frustum occlusion_frustum_body(const struct skeleton *in_viewer)
{
    struct occlusion_frustum body = {0};
    for (int j = 0; j < JOINT_COUNT; j++)
        if (in_viewer->confidence[j] > 0)
            occlusion_frustum_add(&body, in_viewer->joint[j], OCCLUDER_BODY_RADIUS_M);
    return body;
}

static bool may_occlude(const struct occluder_sphere *sphere, const struct affine_map *viewer_from_room,
                        const struct occlusion_frustum *hidden)
{
    const struct vec3 *m = &sphere->middle;
    double p[3];
    for (int r = 0; r < 3; r++)
        p[r] = (double)viewer_from_room->row[r][0] * m->x + (double)viewer_from_room->row[r][1] * m->y +
               (double)viewer_from_room->row[r][2] * m->z + (double)viewer_from_room->row[r][3];
    bool may = hidden->farthest_m > 0 && p[2] > -sphere->radius_m && p[2] < hidden->farthest_m + sphere->radius_m;
    for (int i = 0; i < 2 && may; i++) { // distances of its centre beyond either side
        const double low = hidden->low[i], high = hidden->high[i];
        may = !(isfinite(low) && (low * p[2] - p[i]) / portable_hypot(low, 1) > sphere->radius_m) &&
              !(isfinite(high) && (p[i] - high * p[2]) / portable_hypot(high, 1) > sphere->radius_m);
    }
    return may;
}

int occluder_mesh_cull(const struct occluder_mesh *mesh, const struct affine_map *viewer_from_room,
                       const struct occlusion_frustum *hidden, uint16_t *corners)
{
    int count = 0;
    for (int i = 0; i < mesh->sphere_count; i++) { // none where there is no room
        const struct occluder_sphere *sphere = &mesh->spheres[i];
        if (!may_occlude(sphere, viewer_from_room, hidden))
            continue;
        memcpy(corners + count, mesh->corners + sphere->first, sizeof *corners * (size_t)sphere->count);
        count += sphere->count;
    }
    return count;
}

// ---------------------------------------------------------------- occluder mesh

// All chosen by hand.
static const double VOXEL_M = 0.04, COARSENING = 1.3; // first voxel size; its growth while the mesh is too large
static const double MARGIN_M = 3;                     // of the grid about the actor's positions, horizontally
static const double FLOOR_M = 0.08, HEADROOM_M = 0.3; // the grid begins above the floor, ends above the highest joint
static const double NEAR_M = 0.3, FAR_M = 5;          // range of depth samples; beyond they are too coarse
static const double CELL_M = 0.5;                     // of the bounding spheres' cells

enum { FRAMES = 8, FRAME_WEIGHT = 4, MAX_VOXELS = 8000000, BODY_FRAMES = 200 };

// One depth image to be fused.
struct depth_view {
    struct occluder_grid *grid;
    const uint16_t *depth;
    const uint8_t *mask; // of the actor, left out; NULL: none
    struct lens lens;
    struct affine_map camera_from_world;
    float weight; // at 1 m
};

// Shrinks the index range [*from, *to) to the indices for which at + index * step may be at least 0.
static void clip_range(double at, double step, int *from, int *to)
{
    if (step == 0) {
        *to = at < 0 ? *from : *to;
        return;
    }
    double zero = fmin(fmax(-at / step, *from - 2), *to + 2); // one more index on either side, for rounding
    if (step > 0)
        *from = *from > (int)floor(zero) - 1 ? *from : (int)floor(zero) - 1;
    else
        *to = *to < (int)ceil(zero) + 2 ? *to : (int)ceil(zero) + 2;
}

// The index range of a row that the camera may see. first: its first voxel, camera axes.
static void clip_row(const struct depth_view *view, bool ideal, const float first[3], int *from, int *to)
{
    const struct lens *l = &view->lens;
    const double step = view->grid->step, z = (double)first[2], dz = (double)view->camera_from_world.row[2][0] * step;
    clip_range(z - NEAR_M, dz, from, to);
    clip_range(FAR_M - z, -dz, from, to);
    const double f[2] = {l->fx, l->fy}, c[2] = {l->cx, l->cy}, size[2] = {l->width, l->height};
    for (int k = 0; k < 2 && ideal; k++) {
        double across = (double)first[k] * f[k], more = (double)view->camera_from_world.row[k][0] * step * f[k];
        clip_range(across + (c[k] + 0.5) * z, more + (c[k] + 0.5) * dz, from, to);
        clip_range((size[k] - c[k] - 0.5) * z - across, (size[k] - c[k] - 0.5) * dz - more, from, to);
    }
}

static void grid_to_camera(const struct depth_view *view, int x, int y, int z, float p[3])
{
    const struct occluder_grid *g = view->grid;
    const struct affine_map *m = &view->camera_from_world;
    const float w[3] = {(float)(g->corner.x + x * g->step), (float)(g->corner.y + y * g->step),
                        (float)(g->corner.z + z * g->step)};
    for (int r = 0; r < 3; r++)
        p[r] = m->row[r][0] * w[0] + m->row[r][1] * w[1] + m->row[r][2] * w[2] + m->row[r][3];
}

static void integrate_row(const struct depth_view *view, bool ideal, int y, int z)
{
    const struct occluder_grid *g = view->grid;
    const float truncation = (float)g->truncation;
    int from = 0, to = g->size[0];
    float p[3];
    grid_to_camera(view, 0, y, z, p);
    clip_row(view, ideal, p, &from, &to);
    for (int x = from; x < to; x++) {
        grid_to_camera(view, x, y, z, p);
        if (!(p[2] > (float)NEAR_M) || p[2] > (float)FAR_M)
            continue;
        double px = (double)(p[0] / p[2]) * view->lens.fx + view->lens.cx;
        double py = (double)(p[1] / p[2]) * view->lens.fy + view->lens.cy;
        if (!ideal) {
            struct pixel distorted = lens_project(&view->lens, v3((double)p[0], (double)p[1], (double)p[2]));
            px = distorted.x, py = distorted.y;
        }
        px += 0.5, py += 0.5;
        if (!(px >= 0 && py >= 0 && px < view->lens.width && py < view->lens.height))
            continue;
        int i = (int)py * view->lens.width + (int)px;
        if (!view->depth[i] || (view->mask && view->mask[i]))
            continue;
        float distance = (float)view->depth[i] * 1e-3F - p[2];
        if (distance < -truncation)
            continue;
        float weight = view->weight / (p[2] * p[2]);
        size_t at = occluder_grid_index(g, x, y, z);
        g->sum[at] += weight * (distance < truncation ? distance : truncation);
        g->weight[at] += weight;
    }
}

static void integrate_slice(void *context, int z)
{
    const struct depth_view *v = context;
    const bool ideal = lens_is_ideal(&v->lens);
    for (int y = 0; y < v->grid->size[1]; y++)
        integrate_row(v, ideal, y, z);
}

// Curless & Levoy 1996: adds truncated signed distances, weighted by 1 / z^2. Slices are independent, so the result
// does not depend on the number of threads.
static void integrate_view(struct depth_view *view, int threads)
{
    parallel_for(threads, view->grid->size[2], integrate_slice, view);
}

// ---------------------------------------------------------------- the grid

// Bounds of the actor's joints over the take, world axes. False: there are none.
static bool find_actor_bounds(const struct take *take, struct vec3 *low, struct vec3 *high)
{
    *low = v3(INFINITY, INFINITY, INFINITY);
    *high = v3(-INFINITY, -INFINITY, -INFINITY);
    for (int64_t i = 0; i < take_frame_count(take); i++) {
        const struct take_entry *e = take_entry(take, i);
        for (int j = 0; j < JOINT_COUNT && e->has_skeleton && e->located; j++) {
            if (!(e->skeleton.confidence[j] > 0))
                continue;
            struct vec3 p = pose_apply(e->world_from_camera, e->skeleton.joint[j]);
            *low = v3(fmin(low->x, p.x), fmin(low->y, p.y), fmin(low->z, p.z));
            *high = v3(fmax(high->x, p.x), fmax(high->y, p.y), fmax(high->z, p.z));
        }
    }
    return low->x < high->x;
}

static enum status open_grid(struct occluder_grid *grid, const struct take *take, double step)
{
    struct vec3 low, high;
    if (!find_actor_bounds(take, &low, &high))
        return NOTHING;
    *grid = (struct occluder_grid){
        .corner = v3(low.x - MARGIN_M, low.y - MARGIN_M, FLOOR_M), .step = step, .truncation = 2.5 * step};
    const double extent[3] = {high.x - low.x + 2 * MARGIN_M, high.y - low.y + 2 * MARGIN_M,
                              high.z + HEADROOM_M - FLOOR_M};
    double count = 1;
    for (int i = 0; i < 3; i++) {
        grid->size[i] = (int)fmin(fmax(ceil(extent[i] / step), 0), 1e6) + 1;
        count *= grid->size[i];
    }
    if (count > MAX_VOXELS)
        return open_grid(grid, take, step * COARSENING);
    grid->sum = calloc((size_t)count, sizeof *grid->sum);
    grid->weight = calloc((size_t)count, sizeof *grid->weight);
    return grid->sum && grid->weight ? OK : fail(ERR_MEMORY, "no memory for the room's surface");
}

static void close_grid(struct occluder_grid *grid)
{
    free(grid->sum);
    free(grid->weight);
}

static struct affine_map depth_from_world(const struct calibration *calibration, struct pose world_from_color)
{
    return affine_from_pose(pose_inverse(pose_multiply(world_from_color, calibration->color_from_depth)));
}

static enum status integrate_place(struct occluder_grid *grid, const struct place *place,
                                   const struct occluder_options *options)
{
    const struct calibration *c = &place->calibration;
    for (int32_t i = 0; i < place->view_count; i++) {
        if (!progress_continue(options->watch, (double)i / place->view_count))
            return NOTHING;
        struct depth_view v = {grid, place->views[i].depth, NULL, c->depth, {{{0}}}, 1};
        if (!v.depth)
            continue;
        v.camera_from_world = depth_from_world(c, place->views[i].world_from_camera);
        integrate_view(&v, options->threads);
    }
    return OK;
}

// The room during the take, seen from its sensor.
static enum status integrate_take(struct occluder_grid *grid, struct take *take, int threads)
{
    const struct calibration *c = take_calibration(take);
    int64_t frames = take_frame_count(take), before = -1;
    for (int k = 0; k < FRAMES; k++) {
        int64_t i = k * frames / FRAMES;
        const struct take_entry *e = take_entry(take, i);
        struct take_images images;
        if (i == before || !e->located || !e->has_depth || !e->has_mask)
            continue;
        before = i;
        enum status status = take_read(take, i, TAKE_DEPTH | TAKE_MASK, &images);
        if (status == ERR_CORRUPT) // a damaged frame costs itself alone
            continue;
        if (status != OK)
            return status;
        struct depth_view v = {
            grid, images.depth, images.mask, c->depth, depth_from_world(c, e->world_from_camera), FRAME_WEIGHT};
        integrate_view(&v, threads);
    }
    return OK;
}

// Marks the voxels of a capsule as empty: the actor was there.
static void clear_capsule(struct occluder_grid *grid, struct vec3 a, struct vec3 b, double radius)
{
    struct vec3 along = v3_sub(b, a);
    double length2 = v3_dot(along, along);
    const double lows[3] = {fmin(a.x, b.x) - grid->corner.x, fmin(a.y, b.y) - grid->corner.y,
                            fmin(a.z, b.z) - grid->corner.z};
    const double highs[3] = {fmax(a.x, b.x) - grid->corner.x, fmax(a.y, b.y) - grid->corner.y,
                             fmax(a.z, b.z) - grid->corner.z};
    int from[3], to[3];
    for (int i = 0; i < 3; i++) {
        from[i] = (int)fmin(fmax(ceil((lows[i] - radius) / grid->step), 0), grid->size[i]);
        to[i] = (int)fmin(fmax(floor((highs[i] + radius) / grid->step) + 1, 0), grid->size[i]);
    }
    for (int z = from[2]; z < to[2]; z++)
        for (int y = from[1]; y < to[1]; y++)
            for (int x = from[0]; x < to[0]; x++) {
                struct vec3 p = v3_sub(v3_add(grid->corner, v3(x * grid->step, y * grid->step, z * grid->step)), a);
                double t = length2 > 0 ? v3_dot(p, along) / length2 : 0;
                t = clamp_double(t, 0, 1);
                if (v3_length(v3_sub(p, v3_scale(along, t))) > radius)
                    continue;
                size_t at = occluder_grid_index(grid, x, y, z);
                grid->weight[at] = 1;
                grid->sum[at] = (float)grid->truncation;
            }
}

static void clear_body(struct occluder_grid *grid, const struct take *take)
{
    int64_t frames = take_frame_count(take), step = 1 + frames / BODY_FRAMES;
    const struct body *body = take_body(take);
    for (int64_t i = 0; i < frames; i += step) {
        const struct take_entry *e = take_entry(take, i);
        for (int p = 0; p < PART_COUNT && e->has_skeleton && e->located; p++) {
            if (!part_is_known(body, &e->skeleton, (enum part)p))
                continue;
            struct vec3 a = pose_apply(e->world_from_camera, e->skeleton.joint[part_ends[p].from]);
            struct vec3 b = pose_apply(e->world_from_camera, e->skeleton.joint[part_ends[p].to]);
            clear_capsule(grid, a, b, fmin(body->radius_rate[p] * v3_distance(a, b), OCCLUDER_BODY_RADIUS_M));
        }
    }
}

// ---------------------------------------------------------------- bounding spheres

// A triangle and the cell of its first corner.
struct cell_triangle {
    int cell[3];
    uint16_t corners[3];
};

static int compare_cells(const void *a, const void *b)
{
    const struct cell_triangle *x = a, *y = b;
    int differ = 0;
    for (int k = 0; k < 3 && !differ; k++)
        differ = (x->cell[k] > y->cell[k]) - (x->cell[k] < y->cell[k]);
    return differ ? differ : memcmp(x->corners, y->corners, sizeof x->corners);
}

// Centred on a cell, containing all its triangles.
static struct occluder_sphere bounding_sphere(const struct occluder_mesh *mesh, const struct cell_triangle *pieces,
                                              int first, int count)
{
    const int *cell = pieces[first].cell;
    struct occluder_sphere sphere = {v3((cell[0] + 0.5) * CELL_M, (cell[1] + 0.5) * CELL_M, (cell[2] + 0.5) * CELL_M),
                                     0, 3 * first, 3 * count};
    for (int i = 0; i < 3 * count; i++) {
        const float *p = mesh->points[pieces[first + i / 3].corners[i % 3]];
        sphere.radius_m =
            fmax(sphere.radius_m, v3_distance(sphere.middle, v3((double)p[0], (double)p[1], (double)p[2])));
    }
    return sphere;
}

// Sorts the triangles by cell and bounds those of each cell by a sphere.
static enum status find_spheres(struct occluder_mesh *out)
{
    const int count = out->corner_count / 3;
    struct cell_triangle *pieces = malloc(sizeof *pieces * (size_t)count);
    out->spheres = malloc(sizeof *out->spheres * (size_t)count);
    if (!pieces || !out->spheres) {
        free(pieces);
        return fail(ERR_MEMORY, "no memory for the room's surface");
    }
    for (int i = 0; i < count; i++) {
        memcpy(pieces[i].corners, out->corners + 3 * (size_t)i, sizeof pieces[i].corners);
        for (int k = 0; k < 3; k++)
            pieces[i].cell[k] = (int)floor((double)out->points[pieces[i].corners[0]][k] / CELL_M);
    }
    qsort(pieces, (size_t)count, sizeof *pieces, compare_cells);
    for (int i = 0, first = 0; i < count; i++) {
        memcpy(out->corners + 3 * (size_t)i, pieces[i].corners, sizeof pieces[i].corners);
        if (i + 1 < count && !memcmp(pieces[i].cell, pieces[i + 1].cell, sizeof pieces[i].cell))
            continue;
        out->spheres[out->sphere_count++] = bounding_sphere(out, pieces, first, i + 1 - first);
        first = i + 1;
    }
    free(pieces);
    return OK;
}

// ---------------------------------------------------------------- building

struct occluder_options occluder_default_options(void) { return (struct occluder_options){.threads = 2}; }

// With voxels of `step` metres. *too_large: the surface has more vertices than a mesh can hold; *out is then empty.
static enum status try_mesh(struct occluder_mesh *out, const struct place *place, struct take *take, double step,
                            const struct occluder_options *options, bool *too_large)
{
    struct occluder_grid g = {0};
    *out = (struct occluder_mesh){0};
    *too_large = false;
    enum status status = open_grid(&g, take, step);
    if (status == OK)
        status = integrate_place(&g, place, options);
    if (status == OK)
        status = integrate_take(&g, take, options->threads);
    if (status == OK) {
        clear_body(&g, take);
        status = occluder_surface_nets(&g, out, too_large);
    }
    close_grid(&g);
    if (status == OK && !*too_large)
        status = find_spheres(out);
    if (status != OK)
        occluder_mesh_free(out);
    return status;
}

enum status occluder_mesh_make(struct occluder_mesh *out, const struct place *place, struct take *take,
                               const struct occluder_options *options)
{
    const struct occluder_options defaults = occluder_default_options();
    *out = (struct occluder_mesh){0};
    if (!(place->calibration.depth.width > 0) || !place->view_count)
        return NOTHING;
    enum status status = OK;
    bool too_large = true;
    for (double step = VOXEL_M; status == OK && too_large; step *= COARSENING)
        status = try_mesh(out, place, take, step, options ? options : &defaults, &too_large);
    return status;
}
