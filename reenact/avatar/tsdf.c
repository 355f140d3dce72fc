#include "reenact/avatar/tsdf.h"

#include "base/clamp.h"
#include "base/parallel.h"
#include "reenact/avatar/tsdf_internal.h"

#include <stdlib.h>
#include <string.h>

static const double REACH_M = 0.12;         // of the field around the parts' cylinders; chosen by hand
static const double END_REACH_M = 0.27;     // around head, hands and feet, which extend past the last joint; likewise
static const float CYLINDER_WEIGHT = 0.5F;  // of the cylinders' distances, in frames; less cost the filmed man 0.4 dB
static const double TRUNK_DEPTH = 0.7;      // depth / width; 0.6 to 0.85 do alike on the filmed people, 1 is worse
static const float FREE_SPACE_SHARE = 0.6F; // of the truncation: what is at least so far from the surface is free

enum { NORMAL_PASSES = 6, CHUNK = 8192 };

static struct vec3 point_at(const struct tsdf *v, int at)
{
    const int x = at % v->size[0], y = at / v->size[0] % v->size[1], z = at / v->size[0] / v->size[1];
    return v3_add(v->corner, v3(x * v->step, y * v->step, z * v->step));
}

// The grid: the bind pose's joints and a margin. Sizes are compared before they become integers: joints may lie
// anywhere.
static enum status find_size(struct tsdf *v)
{
    struct vec3 low = v3(INFINITY, INFINITY, INFINITY), high = v3(-INFINITY, -INFINITY, -INFINITY);
    for (int j = 0; j < JOINT_COUNT; j++) {
        if (!(v->bind_pose.skeleton.confidence[j] > 0))
            continue;
        struct vec3 p = v->bind_pose.skeleton.joint[j];
        if (!v3_finite(p)) // fmin and fmax would pass over it
            return fail(ERR_INPUT, "a joint of the take's person is not finite");
        low = v3(fmin(low.x, p.x), fmin(low.y, p.y), fmin(low.z, p.z));
        high = v3(fmax(high.x, p.x), fmax(high.y, p.y), fmax(high.z, p.z));
    }
    double margin = END_REACH_M;
    for (int p = 0; p < PART_COUNT; p++)
        margin = v->bind_pose.known[p] ? fmax(margin, v->bind_pose.radius[p] + REACH_M) : margin;
    v->corner = v3_sub(low, v3(margin, margin, margin));
    struct vec3 extent = v3_sub(v3_add(high, v3(margin, margin, margin)), v->corner);
    const double size[3] = {ceil(extent.x / v->step) + 1, ceil(extent.y / v->step) + 1, ceil(extent.z / v->step) + 1};
    if (!(size[0] >= 1 && size[1] >= 1 && size[2] >= 1 && size[0] * size[1] * size[2] <= TSDF_POINTS_MOST))
        return fail(ERR_INPUT, "the take's joints lie too far apart to be one person's");
    for (int i = 0; i < 3; i++)
        v->size[i] = (int)size[i];
    return OK;
}

static int clamp_to(double g, int size)
{
    if (!(g > 0)) // not a number, too
        return 0;
    return g > size ? size : (int)g;
}

// Rasterises a capsule, from a to b: each voxel's distance becomes the minimum of its own and the capsule's; grid
// points nearer than `reach` are marked in `keep`.
static void rasterize_capsule(struct tsdf *v, struct vec3 a, struct vec3 b, double radius, double reach, uint8_t *keep)
{
    struct vec3 along = v3_sub(b, a), low = v3_sub(a, v->corner), high = v3_sub(b, v->corner);
    double length2 = v3_dot(along, along), wide = radius + fmax(reach, (double)TSDF_TRUNCATION_M);
    const double lows[] = {fmin(low.x, high.x), fmin(low.y, high.y), fmin(low.z, high.z)};
    const double highs[] = {fmax(low.x, high.x), fmax(low.y, high.y), fmax(low.z, high.z)};
    int from[3], to[3];
    for (int i = 0; i < 3; i++) {
        from[i] = clamp_to(floor((lows[i] - wide) / v->step), v->size[i]);
        to[i] = clamp_to(ceil((highs[i] + wide) / v->step) + 1, v->size[i]);
    }
    for (int z = from[2]; z < to[2]; z++)
        for (int y = from[1]; y < to[1]; y++)
            for (int x = from[0]; x < to[0]; x++) {
                int at = (z * v->size[1] + y) * v->size[0] + x;
                struct vec3 p = v3_sub(point_at(v, at), a);
                double t = length2 > 0 ? v3_dot(p, along) / length2 : 0;
                t = clamp_double(t, 0, 1);
                double gap = v3_length(v3_sub(p, v3_scale(along, t))) - radius;
                v->voxels[at].distance = fminf(v->voxels[at].distance, (float)gap);
                keep[at] |= gap < reach;
            }
}

static void rasterize_body(struct tsdf *v, uint8_t *keep)
{
    static const enum joint ends[] = {JOINT_LEFT_HAND, JOINT_RIGHT_HAND, JOINT_LEFT_FOOT, JOINT_RIGHT_FOOT, JOINT_HEAD};
    const struct skeleton *s = &v->bind_pose.skeleton;
    for (int p = 0; p < PART_COUNT; p++)
        if (v->bind_pose.known[p])
            rasterize_capsule(v, s->joint[part_ends[p].from], s->joint[part_ends[p].to], v->bind_pose.radius[p],
                              REACH_M, keep);
    for (int p = 0; p < PART_COUNT; p++)
        for (size_t e = 0; e < COUNT_OF(ends); e++)
            if (v->bind_pose.known[p] && part_ends[p].to == ends[e])
                rasterize_capsule(v, s->joint[ends[e]], s->joint[ends[e]], 0, END_REACH_M, keep);
}

static void skin_chunk(void *context, int chunk)
{
    struct tsdf *v = context;
    for (int c = chunk * CHUNK; c < (chunk + 1) * CHUNK && c < v->cell_count; c++)
        v->cells[c].skin = bind_pose_skin_weights(&v->bind_pose, point_at(v, v->cells[c].at));
}

static enum status open_cells(struct tsdf *v, int count)
{
    uint8_t *keep = calloc((size_t)count, 1);
    if (!keep)
        return fail(ERR_MEMORY, "out of memory");
    for (int i = 0; i < count; i++)
        v->voxels[i].distance = TSDF_TRUNCATION_M;
    rasterize_body(v, keep);
    for (int i = 0; i < count; i++)
        v->cell_count += keep[i];
    v->cells = malloc(sizeof *v->cells * (size_t)(v->cell_count ? v->cell_count : 1));
    int c = 0;
    for (int i = 0; i < count && v->cells; i++)
        if (keep[i]) {
            struct vec3 p = point_at(v, i);
            v->cells[c++] = (struct tsdf_cell){.at = i, .point = {(float)p.x, (float)p.y, (float)p.z}};
            v->voxels[i] = (struct tsdf_voxel){fmaxf(-TSDF_TRUNCATION_M, v->voxels[i].distance), CYLINDER_WEIGHT, 0};
        }
    free(keep);
    if (!v->cells)
        return fail(ERR_MEMORY, "out of memory");
    parallel_for(v->threads, (v->cell_count + CHUNK - 1) / CHUNK, skin_chunk, v);
    return OK;
}

enum status tsdf_open(struct tsdf **out, const struct bind_pose *bind_pose, const struct calibration *calibration,
                      double step_m, int threads)
{
    *out = NULL;
    struct tsdf *v = calloc(1, sizeof *v);
    if (!v)
        return fail(ERR_MEMORY, "out of memory");
    v->step = step_m;
    v->threads = threads;
    v->bind_pose = *bind_pose;
    v->calibration = *calibration;
    v->depth_from_color = pose_inverse(calibration->color_from_depth);
    enum status status = find_size(v);
    if (status == OK) {
        const int count = v->size[0] * v->size[1] * v->size[2];
        const struct lens *lens = &calibration->depth;
        v->voxels = calloc((size_t)count, sizeof *v->voxels);
        v->samples = malloc(sizeof *v->samples * (size_t)lens->width * (size_t)lens->height);
        status = v->voxels && v->samples ? open_cells(v, count) : fail(ERR_MEMORY, "out of memory");
    }
    if (status != OK) {
        tsdf_close(&v);
        return status;
    }
    *out = v;
    return OK;
}

void tsdf_close(struct tsdf **v)
{
    if (!*v)
        return;
    free((*v)->cells);
    free((*v)->active_cells);
    free((*v)->blocks);
    free((*v)->voxels);
    free((*v)->samples);
    free(*v);
    *v = NULL;
}

// ---------------------------------------------------------------- the unseen trunk

static bool is_trunk(int bone) { return bone == PART_UPPER_TORSO || bone == PART_LOWER_TORSO; }

// Distance from a trunk's surface, an elliptic capsule, to a point along the direction from its bone; negative: inside.
// (Bind-pose axes: z points to the back.)
static double flattened_distance(const struct bind_pose *bind_pose, int bone, struct vec3 point)
{
    const struct bone_frame *f = &bind_pose->frame[bone];
    const struct vec3 in = v3_sub(point, f->origin);
    const double along = fmin(fmax(v3_dot(in, f->z), 0), f->length);
    const struct vec3 off = v3_sub(in, v3_scale(f->z, along));
    const double wide = v3_length(v3(off.x, off.y, off.z / TRUNK_DEPTH)); // stretched to a round cross-section
    return wide > 0 ? v3_length(off) * (1 - bind_pose->radius[bone] / wide) : -TRUNK_DEPTH * bind_pose->radius[bone];
}

void tsdf_flatten_unseen_trunk(struct tsdf *v)
{
    for (int c = 0; c < v->cell_count; c++) {
        struct tsdf_voxel *point = &v->voxels[v->cells[c].at];
        const int bone = v->cells[c].skin.bone[0];
        if (!is_trunk(bone) || point->weight != CYLINDER_WEIGHT)
            continue;
        const float gap = (float)flattened_distance(&v->bind_pose, bone, point_at(v, v->cells[c].at));
        point->distance = fmaxf(point->distance, fminf(gap, TSDF_TRUNCATION_M));
    }
}

// ---------------------------------------------------------------- offset, free space

struct offset_job {
    struct tsdf *tsdf;
    const struct bone_chart *out_m;
};

static void offset_cell(const struct offset_job *g, const struct tsdf_cell *cell)
{
    float *distance = &g->tsdf->voxels[cell->at].distance;
    if (*distance >= TSDF_TRUNCATION_M) // far outside: stays so
        return;
    const struct vec3 point = v3((double)cell->point[0], (double)cell->point[1], (double)cell->point[2]);
    for (int i = 0; i < SKIN_BONES; i++) {
        const int bone = cell->skin.bone[i];
        if (!(cell->skin.weight[i] > 0))
            continue;
        const struct chart_sample here = chart_sample_at(&g->tsdf->bind_pose.frame[bone], point);
        *distance -= cell->skin.weight[i] * bone_chart_at(&g->out_m[bone], &here);
    }
}

static void offset_chunk(void *context, int chunk)
{
    const struct offset_job *g = context;
    for (int c = chunk * CHUNK; c < (chunk + 1) * CHUNK && c < g->tsdf->cell_count; c++)
        offset_cell(g, &g->tsdf->cells[c]);
}

void tsdf_offset(struct tsdf *v, const struct bone_chart out_m[BONE_COUNT])
{
    struct offset_job job = {v, out_m};
    parallel_for(v->threads, (v->cell_count + CHUNK - 1) / CHUNK, offset_chunk, &job);
}

// The voxel of `known` that is nearest to a cell of v; both grids begin at the same corner.
static const struct tsdf_voxel *known_voxel(const struct tsdf *v, const struct tsdf *known,
                                            const struct tsdf_cell *cell)
{
    const int at[3] = {cell->at % v->size[0], cell->at / v->size[0] % v->size[1], cell->at / v->size[0] / v->size[1]};
    int nearest[3];
    for (int i = 0; i < 3; i++) {
        nearest[i] = (int)(at[i] * v->step / known->step + 0.5);
        nearest[i] = nearest[i] < known->size[i] ? nearest[i] : known->size[i] - 1;
    }
    return &known->voxels[(nearest[2] * known->size[1] + nearest[1]) * known->size[0] + nearest[0]];
}

enum status tsdf_copy_free_space(struct tsdf *v, const struct tsdf *known)
{
    const struct tsdf_cell *cells = v->active_cells ? v->active_cells : v->cells;
    int count = v->active_cells ? v->active_count : v->cell_count, left = 0;
    struct tsdf_cell *active = malloc(sizeof *active * (size_t)(count ? count : 1));
    if (!active)
        return fail(ERR_MEMORY, "out of memory");
    for (int c = 0; c < count; c++) {
        const struct tsdf_voxel *point = known_voxel(v, known, &cells[c]);
        if (point->weight > CYLINDER_WEIGHT && point->distance >= FREE_SPACE_SHARE * TSDF_TRUNCATION_M) {
            v->voxels[cells[c].at].distance = point->distance;
            v->voxels[cells[c].at].weight = point->weight;
        } else {
            active[left++] = cells[c];
        }
    }
    free(v->active_cells);
    free(v->blocks);
    v->blocks = NULL;
    v->active_cells = active;
    v->active_count = left;
    return OK;
}

// ---------------------------------------------------------------- sampling

const struct bind_pose *tsdf_bind_pose(const struct tsdf *v) { return &v->bind_pose; }

const struct calibration *tsdf_calibration(const struct tsdf *v) { return &v->calibration; }

bool tsdf_sample(const struct tsdf *v, struct vec3 bind_point, double *distance, struct vec3 *gradient, double *seen)
{
    struct vec3 g = v3_scale(v3_sub(bind_point, v->corner), 1 / v->step);
    if (!(g.x >= 0 && g.y >= 0 && g.z >= 0 && g.x < v->size[0] - 1 && g.y < v->size[1] - 1 && g.z < v->size[2] - 1))
        return false;
    const int x = (int)g.x, y = (int)g.y, z = (int)g.z;
    double f[2][2][2], u = g.x - x, w = g.y - y, t = g.z - z;
    float least_seen = INFINITY;
    for (int i = 0; i < 8; i++) {
        int at = ((z + (i >> 2)) * v->size[1] + y + (i >> 1 & 1)) * v->size[0] + x + (i & 1);
        const struct tsdf_voxel *p = &v->voxels[at];
        if (!(p->weight > 0))
            return false;
        f[i >> 2][i >> 1 & 1][i & 1] = (double)p->distance;
        least_seen = p->seen < least_seen ? p->seen : least_seen;
    }
    *seen = (double)least_seen;
    double c[2][2], cx[2][2];
    for (int k = 0; k < 2; k++)
        for (int j = 0; j < 2; j++) {
            c[k][j] = f[k][j][0] * (1 - u) + f[k][j][1] * u;
            cx[k][j] = f[k][j][1] - f[k][j][0];
        }
    double low = c[0][0] * (1 - w) + c[0][1] * w, high = c[1][0] * (1 - w) + c[1][1] * w;
    *distance = low * (1 - t) + high * t;
    gradient->x = (cx[0][0] * (1 - w) + cx[0][1] * w) * (1 - t) + (cx[1][0] * (1 - w) + cx[1][1] * w) * t;
    gradient->y = (c[0][1] - c[0][0]) * (1 - t) + (c[1][1] - c[1][0]) * t;
    gradient->z = high - low;
    *gradient = v3_scale(*gradient, 1 / v->step);
    return fabs(*distance) < (double)TSDF_TRUNCATION_M * 0.98;
}

enum status tsdf_smooth(struct tsdf *v, int passes)
{
    size_t count = (size_t)(v->size[0] * v->size[1] * v->size[2]);
    float *from = malloc(sizeof *from * count);
    if (!from)
        return fail(ERR_MEMORY, "out of memory");
    const int step[3] = {1, v->size[0], v->size[0] * v->size[1]};
    for (int pass = 0; pass < passes; pass++)
        for (int axis = 0; axis < 3; axis++) {
            for (size_t i = 0; i < count; i++)
                from[i] = v->voxels[i].distance;
            for (int c = 0; c < v->cell_count; c++) {
                int at = v->cells[c].at, a = at - step[axis], b = at + step[axis];
                if (v->voxels[a].weight > 0 && v->voxels[b].weight > 0) // (a cell is never at the grid's border)
                    v->voxels[at].distance = (from[a] + 2 * from[at] + from[b]) / 4;
            }
        }
    free(from);
    return OK;
}

// ---------------------------------------------------------------- surface (naive surface nets)

void surface_mesh_free(struct surface_mesh *s)
{
    free(s->points);
    free(s->normals);
    free(s->corners);
    *s = (struct surface_mesh){0};
}

// The vertex of the cube whose lowest grid point is `at`: the mean of its edges' zero crossings. False: none cross.
static bool cube_point(const struct tsdf *v, int at, struct vec3 *out)
{
    const int dx = 1, dy = v->size[0], dz = v->size[0] * v->size[1];
    float d[8];
    int inside = 0;
    for (int i = 0; i < 8; i++) {
        int corner = at + (i & 1) * dx + (i >> 1 & 1) * dy + (i >> 2) * dz;
        if (!(v->voxels[corner].weight > 0))
            return false;
        d[i] = v->voxels[corner].distance;
        inside += d[i] < 0;
    }
    if (inside == 0 || inside == 8)
        return false;
    struct vec3 sum = v3(0, 0, 0);
    int crossings = 0;
    for (int i = 0; i < 8; i++)
        for (int axis = 1; axis < 8; axis <<= 1) {
            int j = i | axis;
            if (j == i || (d[i] < 0) == (d[j] < 0))
                continue;
            double t = (double)(d[i] / (d[i] - d[j]));
            sum = v3_add(sum, v3((i & 1) + (axis == 1 ? t : 0), (i >> 1 & 1) + (axis == 2 ? t : 0),
                                 (i >> 2) + (axis == 4 ? t : 0)));
            crossings++;
        }
    *out = v3_add(point_at(v, at), v3_scale(sum, v->step / crossings));
    return true;
}

static void add_quad(struct surface_mesh *s, const int32_t q[4], bool reversed)
{
    static const int order[2][6] = {{0, 1, 2, 0, 2, 3}, {0, 2, 1, 0, 3, 2}};
    for (int i = 0; i < 4; i++)
        if (q[i] < 0)
            return;
    for (int i = 0; i < 6; i++)
        s->corners[s->corner_count++] = q[order[reversed][i]];
}

// Normals as noisy as depth would make the shading flicker: each becomes the mean of itself and its neighbours.
static enum status smooth_normals(struct surface_mesh *s)
{
    struct vec3 *sum = malloc(sizeof *sum * (size_t)(s->point_count + 1));
    if (!sum)
        return fail(ERR_MEMORY, "out of memory");
    for (int pass = 0; pass < NORMAL_PASSES; pass++) {
        for (int i = 0; i < s->point_count; i++)
            sum[i] = s->normals[i];
        for (int c = 0; c < s->corner_count; c++) {
            int next = c % 3 == 2 ? c - 2 : c + 1;
            sum[s->corners[c]] = v3_add(sum[s->corners[c]], s->normals[s->corners[next]]);
        }
        for (int i = 0; i < s->point_count; i++)
            s->normals[i] = v3_unit(sum[i]);
    }
    free(sum);
    return OK;
}

enum status tsdf_extract_surface(const struct tsdf *v, struct surface_mesh *out)
{
    *out = (struct surface_mesh){0};
    const int step[3] = {1, v->size[0], v->size[0] * v->size[1]};
    int count = v->size[0] * v->size[1] * v->size[2], most = 0;
    int32_t *number = malloc(sizeof *number * (size_t)count);
    for (int i = 0; number && i < count; i++)
        number[i] = -1;
    struct vec3 p;
    for (int c = 0; number && c < v->cell_count; c++)
        if (cube_point(v, v->cells[c].at, &p))
            number[v->cells[c].at] = most++;
    out->points = malloc(sizeof *out->points * (size_t)(most + 1));
    out->normals = malloc(sizeof *out->normals * (size_t)(most + 1));
    out->corners = malloc(sizeof *out->corners * 18 * (size_t)(most + 1));
    if (!number || !out->points || !out->normals || !out->corners) {
        free(number);
        surface_mesh_free(out);
        return fail(ERR_MEMORY, "out of memory");
    }
    for (int c = 0; c < v->cell_count; c++) {
        int at = v->cells[c].at;
        if (number[at] < 0 || !cube_point(v, at, &p))
            continue;
        double distance, seen;
        struct vec3 *normal = &out->normals[out->point_count];
        *normal = v3(0, 0, 0);
        tsdf_sample(v, p, &distance, normal, &seen);
        *normal = v3_unit(*normal);
        out->points[out->point_count++] = p;
    }
    for (int c = 0; c < v->cell_count; c++)
        for (int axis = 0; axis < 3; axis++) { // each crossing edge makes a quad of the four cubes around it
            int at = v->cells[c].at, to = at + step[axis], b = step[(axis + 1) % 3], d = step[(axis + 2) % 3];
            if (to >= count || at < b + d || !(v->voxels[to].weight > 0) ||
                (v->voxels[at].distance < 0) == (v->voxels[to].distance < 0))
                continue;
            const int32_t quad[4] = {number[at], number[at - b], number[at - b - d], number[at - d]};
            add_quad(out, quad, v->voxels[at].distance >= 0);
        }
    free(number);
    if (!out->corner_count) {
        surface_mesh_free(out);
        return NOTHING;
    }
    enum status status = smooth_normals(out);
    if (status != OK)
        surface_mesh_free(out);
    return status;
}
