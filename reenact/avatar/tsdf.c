#include "reenact/avatar/tsdf.h"

#include "base/clamp.h"
#include "base/threads.h"

#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- tsdf integrate

// Fusing one depth frame into a TSDF, eight cells at a time (tsdf.h).

// Tuned by hand on the takes of docs/results.md.
static const float BACK_TRUNCATION_M = 0.04F; // width of the band behind the observed surface
static const float THICKNESS_SLACK = 1.15F;   // how far a part extends behind its surface, in its cylinder's radii
static const float FREE_SPACE_WEIGHT = 0.5F;  // of free space and inside, against 1 in the band about the surface
static const float FULL_WEIGHT_M = 0.02F;     // larger distances have proportionally less weight
static const float ROOM_SLACK_M = 0.05F;      // background is at least this far behind the actor

enum { LANES = TSDF_LANES, CHUNK = 1024, PREFETCH_BLOCKS = 3 };

// One number for each cell of a block. The arithmetic is the same on every machine, whatever its vectors' width.
typedef float lanes __attribute__((vector_size(sizeof(float) * LANES)));
typedef int32_t lanes_int __attribute__((vector_size(sizeof(int32_t) * LANES)));

// Comparing lanes gives lanes_int, -1 for true. Functions take pointers: not every ABI can pass vectors of this width.
#define SELECT(yes, a, b) ((lanes)(((yes) & (lanes_int)(a)) | (~(yes) & (lanes_int)(b))))
#define LANE_MIN(a, b)    SELECT((a) < (b), a, b)
#define SPLAT(number)     ((lanes){0} + (number))

// ---------------------------------------------------------------- cells, eight at a time

struct cell_sorting {
    const struct tsdf_cell *cells;
    int count;
    int32_t open[BONE_COUNT][BONE_COUNT][BONE_COUNT]; // the last block with these bones; -1: none
};

static void put_cell(struct tsdf_block *b, const struct tsdf_cell *cell)
{
    const int first = b->count, last = first ? first : LANES - 1; // the first cell fills all lanes
    for (int l = first; l <= last; l++) {
        b->at[l] = cell->at;
        for (int i = 0; i < 3; i++)
            b->point[i][l] = cell->point[i];
        for (int i = 0; i < SKIN_BONES; i++)
            b->weight[i][l] = i == 0 || cell->skin.weight[0] < 1 ? cell->skin.weight[i] : 0;
    }
    memcpy(b->bone, cell->skin.bone, sizeof b->bone);
    b->count++;
}

// Groups cells by their bones, in the cells' order. blocks: NULL: they are only counted. Returns their number.
static int sort_cells(struct cell_sorting *s, struct tsdf_block *blocks)
{
    int count = 0;
    memset(s->open, -1, sizeof s->open);
    for (int c = 0; c < s->count; c++) {
        const uint8_t *bone = s->cells[c].skin.bone;
        int32_t *open = &s->open[bone[0]][bone[1]][bone[2]];
        // While counting there are no blocks: `open` holds the number of cells in the last one.
        if (!blocks) {
            count += *open < 0 || *open == LANES;
            *open = *open < 0 || *open == LANES ? 1 : *open + 1;
            continue;
        }
        if (*open < 0 || blocks[*open].count == LANES) {
            *open = count++;
            blocks[*open].count = 0;
        }
        put_cell(&blocks[*open], &s->cells[c]);
    }
    return count;
}

static enum status open_blocks(struct tsdf *v)
{
    struct cell_sorting *s = malloc(sizeof *s);
    if (!s)
        return fail(ERR_MEMORY, "no memory for the TSDF");
    s->cells = v->active_cells ? v->active_cells : v->cells;
    s->count = v->active_cells ? v->active_count : v->cell_count;
    v->block_count = sort_cells(s, NULL);
    v->blocks = malloc(sizeof *v->blocks * (size_t)(v->block_count + 1));
    if (v->blocks)
        sort_cells(s, v->blocks);
    free(s);
    return v->blocks ? OK : fail(ERR_MEMORY, "no memory for the TSDF");
}

// ---------------------------------------------------------------- one frame

// One frame's update of all cells.
struct integration {
    struct tsdf *tsdf;
    float maps[BONE_COUNT][3][4];  // depth camera's axes from bind pose, rows
    float thick[BONE_COUNT];       // radius of the bone's cylinder, metres
    uint16_t adjacent[BONE_COUNT]; // bit p: part p is adjacent
    bool ideal;                    // the lens has no distortion: projected here, for speed
    const struct lens *lens;
    float fx, fy, cx, cy;         // of the lens
    int left, top, width, height; // of the window of `samples`, depth pixels
    const struct labelled_sample *samples;
};

// Inlined into a function for each instruction set.
#define INLINE static inline __attribute__((always_inline))

// Skins a block's cells into the depth camera's axes.
INLINE void skin_cells(const struct integration *a, const struct tsdf_block *b, lanes out[3])
{
    lanes point[3], weight[SKIN_BONES];
    memcpy(point, b->point, sizeof point);
    memcpy(weight, b->weight, sizeof weight);
    for (int row = 0; row < 3; row++) {
        lanes m[4];
        for (int k = 0; k < 4; k++)
            m[k] = weight[0] * a->maps[b->bone[0]][row][k];
        for (int i = 1; i < SKIN_BONES; i++)
            for (int k = 0; k < 4 && b->bone[i] != b->bone[0]; k++)
                m[k] += weight[i] * a->maps[b->bone[i]][row][k];
        out[row] = m[0] * point[0] + m[1] * point[1] + m[2] * point[2] + m[3];
    }
}

// Projects points into the depth image, pixels, plus 0.5 for rounding.
INLINE void project(const struct integration *a, const lanes p[3], lanes px[2])
{
    if (a->ideal) {
        const lanes scale = 1 / p[2];
        px[0] = p[0] * scale * a->fx + a->cx;
        px[1] = p[1] * scale * a->fy + a->cy;
    } else {
        for (int l = 0; l < LANES; l++) {
            const struct pixel at = lens_project(a->lens, v3((double)p[0][l], (double)p[1][l], (double)p[2][l]));
            px[0][l] = (float)at.x, px[1][l] = (float)at.y;
        }
    }
    px[0] += 0.5F, px[1] += 0.5F;
}

// The depth samples that a block's cells project to.
struct block_samples {
    lanes depth_m, edge_px, half_px;
    lanes_int valid;         // there is one, and it is not mixed
    lanes_int room;          // it shows the background
    lanes_int own;           // it shows the cells' own part
    lanes_int adjacent_part; // it shows that or an adjacent one
};

INLINE void sample_depth(const struct integration *a, const struct tsdf_block *b, const lanes p[3],
                         struct block_samples *out)
{
    lanes px[2];
    project(a, p, px);
    const lanes_int inside = (p[2] > 0.05F) & (px[0] >= 0) & (px[1] >= 0) & (px[0] < (float)a->lens->width) &
                             (px[1] < (float)a->lens->height);
    const lanes_int x = __builtin_convertvector(SELECT(inside, px[0], SPLAT(0.0F)), lanes_int) - a->left,
                    y = __builtin_convertvector(SELECT(inside, px[1], SPLAT(0.0F)), lanes_int) - a->top; // rounded down
    const lanes_int in_window = inside & (x >= 0) & (y >= 0) & (x < a->width) & (y < a->height);
    const lanes_int at = in_window & (y * a->width + x);
    const int own = (int)bone_part(b->bone[0]), adjacent = a->adjacent[b->bone[0]];
    lanes_int depth, edge, half, part;
    for (int l = 0; l < LANES; l++) {
        const struct labelled_sample *w = &a->samples[at[l]];
        depth[l] = w->depth, edge[l] = w->edge, half[l] = w->half, part[l] = w->part;
    }
    out->depth_m = __builtin_convertvector(depth, lanes) * 1e-3F;
    out->edge_px = __builtin_convertvector(edge, lanes);
    out->half_px = __builtin_convertvector(half, lanes);
    out->valid = in_window & (depth != 0) & (part != DEPTH_FRAME_MIXED);
    out->room = part == DEPTH_FRAME_BACKGROUND;
    out->own = part == own;
    for (int l = 0; l < LANES; l++)
        out->adjacent_part[l] = -(adjacent >> part[l] & 1);
}

// One frame's update of a block's cells.
struct block_update {
    lanes distance, weight; // signed distance along the viewing ray, positive before the surface
    lanes_int any;          // there is an update
    lanes_int in_band;      // the depth sample shows the surface next to the cell
};

INLINE void evaluate(const struct integration *a, const struct block_samples *w, const lanes *z, int bone,
                     struct block_update *out)
{
    const lanes before = w->depth_m - *z;
    // Where the sensor saw past the actor, the surface is no farther than the silhouette it saw past.
    const lanes beyond = SELECT(w->room, SPLAT(0.5F - (float)DEPTH_FRAME_RIM_PX),
                                SPLAT(0.5F + (float)DEPTH_FRAME_RIM_PX)); // the rim still shows the actor
    const lanes away = (w->edge_px + beyond) * *z / a->fx, lateral = LANE_MIN(away, SPLAT(TSDF_TRUNCATION_M));
    const lanes sure = 0.1F + 0.3F * w->edge_px; // near an edge a pixel may show either surface
    // The body extends behind the observed surface, no farther than it is thick.
    const lanes wide = w->half_px * *z / a->fx, thick = LANE_MIN(SPLAT(a->thick[bone]), wide);
    const lanes_int behind = ~w->room & (before < -BACK_TRUNCATION_M);
    out->in_band = ~w->room & ~behind & (before < TSDF_TRUNCATION_M);
    out->distance = SELECT(out->in_band, before, SELECT(behind, -LANE_MIN(lateral, SPLAT(BACK_TRUNCATION_M)), lateral));
    out->weight = SELECT(out->in_band, LANE_MIN(SPLAT(1.0F), sure), LANE_MIN(SPLAT(FREE_SPACE_WEIGHT), sure));
    const lanes_int past = w->room & (before > ROOM_SLACK_M);
    const lanes_int within = behind & (before > -THICKNESS_SLACK * thick) & w->own;
    out->any = w->valid & (past | within | (~w->room & ~behind & (~out->in_band | w->adjacent_part)));
}

INLINE void add_block(const struct integration *a, const struct tsdf_block *b)
{
    lanes p[3], known, weight_sum, seen;
    struct block_samples samples;
    struct block_update update;
    struct tsdf_voxel *points = a->tsdf->voxels;
    skin_cells(a, b, p);
    sample_depth(a, b, p, &samples);
    evaluate(a, &samples, &p[2], b->bone[0], &update);
    int any = 0;
    for (int l = 0; l < b->count; l++)
        any |= update.any[l];
    if (!any)
        return;
    // Far from the surface the sign is certain but the distance is not, since limbs move: less weight.
    const lanes far = SELECT(update.distance < 0, -update.distance, update.distance);
    const lanes vote = FULL_WEIGHT_M / SELECT(far > 1e-6F, far, SPLAT(1e-6F));
    const lanes weight = update.weight * LANE_MIN(SPLAT(1.0F), vote);
    for (int l = 0; l < LANES; l++) {
        const struct tsdf_voxel *point = &points[b->at[l]];
        known[l] = point->distance, weight_sum[l] = point->weight, seen[l] = point->seen;
    }
    known = (known * weight_sum + update.distance * weight) / (weight_sum + weight);
    weight_sum += weight;
    seen += SELECT(update.in_band, weight, SPLAT(0.0F));
    for (int l = 0; l < b->count; l++)
        if (update.any[l])
            points[b->at[l]] = (struct tsdf_voxel){known[l], weight_sum[l], seen[l]};
}

INLINE void add_blocks(const struct integration *a, int chunk)
{
    const int from = chunk * CHUNK, to = from + CHUNK, count = a->tsdf->block_count;
    for (int i = from; i < to && i < count; i++) {
        const struct tsdf_block *b = &a->tsdf->blocks[i],
                                *later = b + (i + PREFETCH_BLOCKS < count ? PREFETCH_BLOCKS : 0);
        __builtin_prefetch(&a->tsdf->voxels[later->at[0]], 1);
        __builtin_prefetch(&a->tsdf->voxels[later->at[later->count - 1]], 1);
        add_block(a, b);
    }
}

static void add_chunk(void *context, int chunk) { add_blocks(context, chunk); }

// The same arithmetic, eight lanes to an instruction.
#ifdef __x86_64__
__attribute__((target("avx2"))) static void add_chunk_avx2(void *context, int chunk) { add_blocks(context, chunk); }
#endif

typedef void adder(void *context, int chunk);

static adder *find_adder(void)
{
#ifdef __x86_64__
    if (__builtin_cpu_supports("avx2"))
        return add_chunk_avx2;
#endif
    return add_chunk;
}

// Copies the pixels about the actor, as far out as edge distances are known.
static void copy_depth_window(struct integration *a, const struct depth_frame *s)
{
    int right = s->right + DEPTH_FRAME_MAX_EDGE_PX, bottom = s->bottom + DEPTH_FRAME_MAX_EDGE_PX;
    a->left = s->left > DEPTH_FRAME_MAX_EDGE_PX ? s->left - DEPTH_FRAME_MAX_EDGE_PX : 0;
    a->top = s->top > DEPTH_FRAME_MAX_EDGE_PX ? s->top - DEPTH_FRAME_MAX_EDGE_PX : 0;
    a->width = (right < s->width ? right + 1 : s->width) - a->left;
    a->height = (bottom < s->height ? bottom + 1 : s->height) - a->top;
    struct labelled_sample *w = a->tsdf->samples;
    a->samples = w;
    for (int y = a->top; y < a->top + a->height; y++)
        for (int i = y * s->width + a->left; i < y * s->width + a->left + a->width; i++)
            *w++ = (struct labelled_sample){s->depth[i], s->part[i], s->edge_distance[i], s->half_width[i]};
}

enum status tsdf_integrate(struct tsdf *v, const struct depth_frame *depth_frame,
                           const struct bone_transforms *transforms)
{
    struct integration a = {.tsdf = v, .lens = &v->calibration.depth};
    enum status status = v->blocks ? OK : open_blocks(v);
    if (status != OK || depth_frame->right < depth_frame->left)
        return status;
    a.ideal = lens_is_ideal(a.lens);
    a.fx = (float)a.lens->fx, a.fy = (float)a.lens->fy, a.cx = (float)a.lens->cx, a.cy = (float)a.lens->cy;
    for (int p = 0; p < BONE_COUNT; p++) {
        const struct affine_map map = affine_from_pose(pose_multiply(v->depth_from_color, transforms->bone[p]));
        memcpy(a.maps[p], map.row, sizeof a.maps[p]);
        a.thick[p] = (float)v->bind_pose.radius[p];
        for (int q = 0; q < PART_COUNT; q++)
            a.adjacent[p] |= (uint16_t)(bones_adjacent((int)bone_part(p), q) << q);
    }
    copy_depth_window(&a, depth_frame);
    // Each cell belongs to one chunk, so the result does not depend on the number of threads.
    parallel_for(v->threads, (v->block_count + CHUNK - 1) / CHUNK, find_adder(), &a);
    return OK;
}

// ---------------------------------------------------------------- tsdf store

// Beyond anything that is measured of a person, and small enough that sums cannot overflow; chosen by hand.
static const double LEAST_STEP_M = 1e-4, MOST_M = 100;
static const float MOST_DISTANCE_M = 100, MOST_WEIGHT = 1e9F;

// Grid points without a value come in long runs: their number, then the number of those with one, and those.
static void voxels_archive(struct archive *a, struct tsdf_voxel *voxels, int32_t count)
{
    for (int32_t i = 0; i < count && !a->failed;) {
        int32_t none = 0, some = 0;
        for (; !a->reading && i + none < count && !(voxels[i + none].weight > 0);)
            none++;
        for (; !a->reading && i + none + some < count && voxels[i + none + some].weight > 0;)
            some++;
        ARCHIVE(a, none);
        ARCHIVE(a, some);
        a->failed |= none < 0 || some < 0 || none > count - i || some > count - i - none || (!none && !some);
        if (a->failed)
            break;
        archive_bytes(a, voxels + i + none, (size_t)some * sizeof *voxels);
        i += none + some;
    }
}

// Every number is finite and one that a person's can be; false for what is not a number.
static bool numbers_are_sound(const struct tsdf *t, int32_t points)
{
    const struct vec3 c = t->corner;
    bool sound = fabs(c.x) <= MOST_M && fabs(c.y) <= MOST_M && fabs(c.z) <= MOST_M && t->step >= LEAST_STEP_M &&
                 t->step <= MOST_M;
    for (int32_t i = 0; i < points; i++) {
        const struct tsdf_voxel *v = &t->voxels[i];
        sound &=
            fabsf(v->distance) <= MOST_DISTANCE_M && fabsf(v->weight) <= MOST_WEIGHT && fabsf(v->seen) <= MOST_WEIGHT;
    }
    return sound;
}

void tsdf_archive(struct archive *a, struct tsdf **v, const struct tsdf_of *of)
{
    struct tsdf *t = *v;
    if (a->reading)
        t = *v = calloc(1, sizeof *t);
    if (!t) {
        a->failed = a->out_of_memory = true;
        return;
    }
    ARCHIVE(a, t->corner);
    ARCHIVE(a, t->step);
    ARCHIVE(a, t->size);
    const double points = (double)t->size[0] * t->size[1] * t->size[2];
    a->failed |= !(t->size[0] > 0 && t->size[1] > 0 && t->size[2] > 0 && points <= TSDF_POINTS_MOST);
    if (a->reading && !a->failed) {
        t->bind_pose = *of->bind_pose;
        t->calibration = *of->calibration;
        t->depth_from_color = pose_inverse(of->calibration->color_from_depth);
        t->threads = 1;
        t->voxels = calloc((size_t)points, sizeof *t->voxels);
        a->failed = a->out_of_memory = !t->voxels;
    }
    if (!a->failed)
        voxels_archive(a, t->voxels, (int32_t)points);
    if (a->reading && !a->failed)
        a->failed = !numbers_are_sound(t, (int32_t)points);
    if (a->reading && a->failed)
        tsdf_close(v);
}

// ---------------------------------------------------------------- tsdf

static const double REACH_M = 0.12;         // of the field around the parts' cylinders; chosen by hand
static const double END_REACH_M = 0.27;     // around head, hands and feet, which extend past the last joint; likewise
static const float CYLINDER_WEIGHT = 0.5F;  // of the cylinders' distances, in frames; less cost the filmed man 0.4 dB
static const double TRUNK_DEPTH = 0.7;      // depth / width; 0.6 to 0.85 do alike on the filmed people, 1 is worse
static const float FREE_SPACE_SHARE = 0.6F; // of the truncation: what is at least so far from the surface is free

enum { NORMAL_PASSES = 6, CELL_CHUNK = 8192 };

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
    for (int c = chunk * CELL_CHUNK; c < (chunk + 1) * CELL_CHUNK && c < v->cell_count; c++)
        v->cells[c].skin = bind_pose_skin_weights(&v->bind_pose, point_at(v, v->cells[c].at));
}

static enum status open_cells(struct tsdf *v, int count)
{
    uint8_t *keep = calloc((size_t)count, 1);
    if (!keep)
        return fail(ERR_MEMORY, "no memory for the TSDF");
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
        return fail(ERR_MEMORY, "no memory for the TSDF");
    parallel_for(v->threads, (v->cell_count + CELL_CHUNK - 1) / CELL_CHUNK, skin_chunk, v);
    return OK;
}

enum status tsdf_open(struct tsdf **out, const struct bind_pose *bind_pose, const struct calibration *calibration,
                      double step_m, int threads)
{
    *out = NULL;
    struct tsdf *v = calloc(1, sizeof *v);
    if (!v)
        return fail(ERR_MEMORY, "no memory for the TSDF");
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
        status = v->voxels && v->samples ? open_cells(v, count) : fail(ERR_MEMORY, "no memory for the TSDF");
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
    for (int c = chunk * CELL_CHUNK; c < (chunk + 1) * CELL_CHUNK && c < g->tsdf->cell_count; c++)
        offset_cell(g, &g->tsdf->cells[c]);
}

void tsdf_offset(struct tsdf *v, const struct bone_chart out_m[BONE_COUNT])
{
    struct offset_job job = {v, out_m};
    parallel_for(v->threads, (v->cell_count + CELL_CHUNK - 1) / CELL_CHUNK, offset_chunk, &job);
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
        return fail(ERR_MEMORY, "no memory for the TSDF");
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
        return fail(ERR_MEMORY, "no memory for the TSDF");
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
        return fail(ERR_MEMORY, "no memory for the TSDF");
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
        return fail(ERR_MEMORY, "no memory for the TSDF");
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
