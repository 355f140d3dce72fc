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

static void put_cell(struct tsdf_block *block, const struct tsdf_cell *cell)
{
    const int first = block->count, last = first ? first : LANES - 1; // the first cell fills all lanes
    for (int l = first; l <= last; l++) {
        block->at[l] = cell->at;
        for (int i = 0; i < 3; i++)
            block->point[i][l] = cell->point[i];
        for (int i = 0; i < SKIN_BONES; i++)
            block->weight[i][l] = i == 0 || cell->skin.weight[0] < 1 ? cell->skin.weight[i] : 0;
    }
    memcpy(block->bone, cell->skin.bone, sizeof block->bone);
    block->count++;
}

// Groups cells by their bones, in the cells' order. blocks: NULL: they are only counted. Returns their number.
static int sort_cells(struct cell_sorting *sorting, struct tsdf_block *blocks)
{
    int count = 0;
    memset(sorting->open, -1, sizeof sorting->open);
    for (int c = 0; c < sorting->count; c++) {
        const uint8_t *bone = sorting->cells[c].skin.bone;
        int32_t *open = &sorting->open[bone[0]][bone[1]][bone[2]];
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
        put_cell(&blocks[*open], &sorting->cells[c]);
    }
    return count;
}

static enum status open_blocks(struct tsdf *tsdf)
{
    struct cell_sorting *s = malloc(sizeof *s);
    if (!s)
        return fail(ERR_MEMORY, "no memory for the TSDF");
    s->cells = tsdf->active_cells ? tsdf->active_cells : tsdf->cells;
    s->count = tsdf->active_cells ? tsdf->active_count : tsdf->cell_count;
    tsdf->block_count = sort_cells(s, NULL);
    tsdf->blocks = malloc(sizeof *tsdf->blocks * (size_t)(tsdf->block_count + 1));
    if (tsdf->blocks)
        sort_cells(s, tsdf->blocks);
    free(s);
    return tsdf->blocks ? OK : fail(ERR_MEMORY, "no memory for the TSDF");
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
INLINE void skin_cells(const struct integration *integration, const struct tsdf_block *block, lanes out[3])
{
    lanes point[3], weight[SKIN_BONES];
    memcpy(point, block->point, sizeof point);
    memcpy(weight, block->weight, sizeof weight);
    for (int row = 0; row < 3; row++) {
        lanes m[4];
        for (int k = 0; k < 4; k++)
            m[k] = weight[0] * integration->maps[block->bone[0]][row][k];
        for (int i = 1; i < SKIN_BONES; i++)
            for (int k = 0; k < 4 && block->bone[i] != block->bone[0]; k++)
                m[k] += weight[i] * integration->maps[block->bone[i]][row][k];
        out[row] = m[0] * point[0] + m[1] * point[1] + m[2] * point[2] + m[3];
    }
}

// Projects points into the depth image, pixels, plus 0.5 for rounding.
INLINE void project_points(const struct integration *integration, const lanes p[3], lanes px[2])
{
    if (integration->ideal) {
        const lanes scale = 1 / p[2];
        px[0] = p[0] * scale * integration->fx + integration->cx;
        px[1] = p[1] * scale * integration->fy + integration->cy;
    } else {
        for (int l = 0; l < LANES; l++) {
            const struct pixel at =
                lens_project(integration->lens, v3((double)p[0][l], (double)p[1][l], (double)p[2][l]));
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

INLINE void sample_depth(const struct integration *integration, const struct tsdf_block *block, const lanes p[3],
                         struct block_samples *out)
{
    lanes px[2];
    project_points(integration, p, px);
    const lanes_int inside = (p[2] > 0.05F) & (px[0] >= 0) & (px[1] >= 0) & (px[0] < (float)integration->lens->width) &
                             (px[1] < (float)integration->lens->height);
    const lanes_int x = __builtin_convertvector(SELECT(inside, px[0], SPLAT(0.0F)), lanes_int) - integration->left,
                    y = __builtin_convertvector(SELECT(inside, px[1], SPLAT(0.0F)), lanes_int) -
                        integration->top; // rounded down
    const lanes_int in_window = inside & (x >= 0) & (y >= 0) & (x < integration->width) & (y < integration->height);
    const lanes_int at = in_window & (y * integration->width + x);
    const int own = (int)bone_part(block->bone[0]), adjacent = integration->adjacent[block->bone[0]];
    lanes_int depth, edge, half, part;
    for (int l = 0; l < LANES; l++) {
        const struct labelled_sample *sample = &integration->samples[at[l]];
        depth[l] = sample->depth, edge[l] = sample->edge, half[l] = sample->half, part[l] = sample->part;
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

INLINE void evaluate_update(const struct integration *integration, const struct block_samples *samples, const lanes *z,
                            int bone, struct block_update *out)
{
    const lanes before = samples->depth_m - *z;
    // Where the sensor saw past the actor, the surface is no farther than the silhouette it saw past.
    const lanes beyond = SELECT(samples->room, SPLAT(0.5F - (float)DEPTH_FRAME_RIM_PX),
                                SPLAT(0.5F + (float)DEPTH_FRAME_RIM_PX)); // the rim still shows the actor
    const lanes away = (samples->edge_px + beyond) * *z / integration->fx,
                lateral = LANE_MIN(away, SPLAT(TSDF_TRUNCATION_M));
    const lanes sure = 0.1F + 0.3F * samples->edge_px; // near an edge a pixel may show either surface
    // The body extends behind the observed surface, no farther than it is thick.
    const lanes wide = samples->half_px * *z / integration->fx, thick = LANE_MIN(SPLAT(integration->thick[bone]), wide);
    const lanes_int behind = ~samples->room & (before < -BACK_TRUNCATION_M);
    out->in_band = ~samples->room & ~behind & (before < TSDF_TRUNCATION_M);
    out->distance = SELECT(out->in_band, before, SELECT(behind, -LANE_MIN(lateral, SPLAT(BACK_TRUNCATION_M)), lateral));
    out->weight = SELECT(out->in_band, LANE_MIN(SPLAT(1.0F), sure), LANE_MIN(SPLAT(FREE_SPACE_WEIGHT), sure));
    const lanes_int past = samples->room & (before > ROOM_SLACK_M);
    const lanes_int within = behind & (before > -THICKNESS_SLACK * thick) & samples->own;
    out->any = samples->valid & (past | within | (~samples->room & ~behind & (~out->in_band | samples->adjacent_part)));
}

INLINE void add_block(const struct integration *integration, const struct tsdf_block *block)
{
    lanes p[3], known, weight_sum, seen;
    struct block_samples samples;
    struct block_update update;
    struct tsdf_voxel *points = integration->tsdf->voxels;
    skin_cells(integration, block, p);
    sample_depth(integration, block, p, &samples);
    evaluate_update(integration, &samples, &p[2], block->bone[0], &update);
    int any = 0;
    for (int l = 0; l < block->count; l++)
        any |= update.any[l];
    if (!any)
        return;
    // Far from the surface the sign is certain but the distance is not, since limbs move: less weight.
    const lanes far = SELECT(update.distance < 0, -update.distance, update.distance);
    const lanes vote = FULL_WEIGHT_M / SELECT(far > 1e-6F, far, SPLAT(1e-6F));
    const lanes weight = update.weight * LANE_MIN(SPLAT(1.0F), vote);
    for (int l = 0; l < LANES; l++) {
        const struct tsdf_voxel *point = &points[block->at[l]];
        known[l] = point->distance, weight_sum[l] = point->weight, seen[l] = point->seen;
    }
    known = (known * weight_sum + update.distance * weight) / (weight_sum + weight);
    weight_sum += weight;
    seen += SELECT(update.in_band, weight, SPLAT(0.0F));
    for (int l = 0; l < block->count; l++)
        if (update.any[l])
            points[block->at[l]] = (struct tsdf_voxel){known[l], weight_sum[l], seen[l]};
}

INLINE void add_blocks(const struct integration *integration, int chunk)
{
    const int from = chunk * CHUNK, to = from + CHUNK, count = integration->tsdf->block_count;
    for (int i = from; i < to && i < count; i++) {
        const struct tsdf_block *b = &integration->tsdf->blocks[i],
                                *later = b + (i + PREFETCH_BLOCKS < count ? PREFETCH_BLOCKS : 0);
        __builtin_prefetch(&integration->tsdf->voxels[later->at[0]], 1);
        __builtin_prefetch(&integration->tsdf->voxels[later->at[later->count - 1]], 1);
        add_block(integration, b);
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
static void copy_depth_window(struct integration *integration, const struct depth_frame *frame)
{
    int right = frame->right + DEPTH_FRAME_MAX_EDGE_PX, bottom = frame->bottom + DEPTH_FRAME_MAX_EDGE_PX;
    integration->left = frame->left > DEPTH_FRAME_MAX_EDGE_PX ? frame->left - DEPTH_FRAME_MAX_EDGE_PX : 0;
    integration->top = frame->top > DEPTH_FRAME_MAX_EDGE_PX ? frame->top - DEPTH_FRAME_MAX_EDGE_PX : 0;
    integration->width = (right < frame->width ? right + 1 : frame->width) - integration->left;
    integration->height = (bottom < frame->height ? bottom + 1 : frame->height) - integration->top;
    struct labelled_sample *sample = integration->tsdf->samples;
    integration->samples = sample;
    for (int y = integration->top; y < integration->top + integration->height; y++)
        for (int i = y * frame->width + integration->left;
             i < y * frame->width + integration->left + integration->width; i++)
            *sample++ = (struct labelled_sample){frame->depth[i], frame->part[i], frame->edge_distance[i],
                                                 frame->half_width[i]};
}

enum status tsdf_integrate(struct tsdf *tsdf, const struct depth_frame *depth_frame,
                           const struct bone_transforms *transforms)
{
    struct integration a = {.tsdf = tsdf, .lens = &tsdf->calibration.depth};
    enum status status = tsdf->blocks ? OK : open_blocks(tsdf);
    if (status != OK || depth_frame->right < depth_frame->left)
        return status;
    a.ideal = lens_is_ideal(a.lens);
    a.fx = (float)a.lens->fx, a.fy = (float)a.lens->fy, a.cx = (float)a.lens->cx, a.cy = (float)a.lens->cy;
    for (int p = 0; p < BONE_COUNT; p++) {
        const struct affine_map map = affine_from_pose(pose_multiply(tsdf->depth_from_color, transforms->bone[p]));
        memcpy(a.maps[p], map.row, sizeof a.maps[p]);
        a.thick[p] = (float)tsdf->bind_pose.radius[p];
        for (int q = 0; q < PART_COUNT; q++)
            a.adjacent[p] |= (uint16_t)(bones_adjacent((int)bone_part(p), q) << q);
    }
    copy_depth_window(&a, depth_frame);
    // Each cell belongs to one chunk, so the result does not depend on the number of threads.
    parallel_for(tsdf->threads, (tsdf->block_count + CHUNK - 1) / CHUNK, find_adder(), &a);
    return OK;
}

// ---------------------------------------------------------------- tsdf store

// Beyond anything that is measured of a person, and small enough that sums cannot overflow; chosen by hand.
static const double MIN_STEP_M = 1e-4, MAX_M = 100;
static const float MAX_DISTANCE_M = 100, MAX_WEIGHT = 1e9F;

// Grid points without a value come in long runs: their number, then the number of those with one, and those.
static void voxels_archive(struct archive *archive, struct tsdf_voxel *voxels, int32_t count)
{
    for (int32_t i = 0; i < count && !archive->failed;) {
        int32_t none = 0, some = 0;
        for (; !archive->reading && i + none < count && !(voxels[i + none].weight > 0);)
            none++;
        for (; !archive->reading && i + none + some < count && voxels[i + none + some].weight > 0;)
            some++;
        ARCHIVE(archive, none);
        ARCHIVE(archive, some);
        archive->failed |= none < 0 || some < 0 || none > count - i || some > count - i - none || (!none && !some);
        if (archive->failed)
            break;
        archive_bytes(archive, voxels + i + none, (size_t)some * sizeof *voxels);
        i += none + some;
    }
}

// Every number is finite and one that a person's can be; false for what is not a number.
static bool numbers_are_sound(const struct tsdf *tsdf, int32_t points)
{
    const struct vec3 c = tsdf->corner;
    bool sound = fabs(c.x) <= MAX_M && fabs(c.y) <= MAX_M && fabs(c.z) <= MAX_M && tsdf->step >= MIN_STEP_M &&
                 tsdf->step <= MAX_M;
    for (int32_t i = 0; i < points; i++) {
        const struct tsdf_voxel *v = &tsdf->voxels[i];
        sound &= fabsf(v->distance) <= MAX_DISTANCE_M && fabsf(v->weight) <= MAX_WEIGHT && fabsf(v->seen) <= MAX_WEIGHT;
    }
    return sound;
}

void tsdf_archive(struct archive *archive, struct tsdf **tsdf, const struct tsdf_of *of)
{
    struct tsdf *t = *tsdf;
    if (archive->reading)
        t = *tsdf = calloc(1, sizeof *t);
    if (!t) {
        archive->failed = archive->out_of_memory = true;
        return;
    }
    ARCHIVE(archive, t->corner);
    ARCHIVE(archive, t->step);
    ARCHIVE(archive, t->size);
    const double points = (double)t->size[0] * t->size[1] * t->size[2];
    archive->failed |= !(t->size[0] > 0 && t->size[1] > 0 && t->size[2] > 0 && points <= TSDF_POINTS_MAX);
    if (archive->reading && !archive->failed) {
        t->bind_pose = *of->bind_pose;
        t->calibration = *of->calibration;
        t->depth_from_color = pose_inverse(of->calibration->color_from_depth);
        t->threads = 1;
        t->voxels = calloc((size_t)points, sizeof *t->voxels);
        archive->failed = archive->out_of_memory = !t->voxels;
    }
    if (!archive->failed)
        voxels_archive(archive, t->voxels, (int32_t)points);
    if (archive->reading && !archive->failed)
        archive->failed = !numbers_are_sound(t, (int32_t)points);
    if (archive->reading && archive->failed)
        tsdf_close(tsdf);
}

// ---------------------------------------------------------------- tsdf

static const double REACH_M = 0.12;         // of the field around the parts' cylinders; chosen by hand
static const double END_REACH_M = 0.27;     // around head, hands and feet, which extend past the last joint; likewise
static const float CYLINDER_WEIGHT = 0.5F;  // of the cylinders' distances, in frames; less cost the filmed man 0.4 dB
static const double TRUNK_DEPTH = 0.7;      // depth / width; 0.6 to 0.85 do alike on the filmed people, 1 is worse
static const float FREE_SPACE_SHARE = 0.6F; // of the truncation: what is at least so far from the surface is free

enum { NORMAL_PASSES = 6, CELL_CHUNK = 8192 };

static struct vec3 point_at(const struct tsdf *tsdf, int at)
{
    const int x = at % tsdf->size[0], y = at / tsdf->size[0] % tsdf->size[1], z = at / tsdf->size[0] / tsdf->size[1];
    return v3_add(tsdf->corner, v3(x * tsdf->step, y * tsdf->step, z * tsdf->step));
}

// The grid: the bind pose's joints and a margin. Sizes are compared before they become integers: joints may lie
// anywhere.
static enum status find_size(struct tsdf *tsdf)
{
    struct vec3 low = v3(INFINITY, INFINITY, INFINITY), high = v3(-INFINITY, -INFINITY, -INFINITY);
    for (int j = 0; j < JOINT_COUNT; j++) {
        if (!(tsdf->bind_pose.skeleton.confidence[j] > 0))
            continue;
        struct vec3 p = tsdf->bind_pose.skeleton.joint[j];
        if (!v3_finite(p)) // fmin and fmax would pass over it
            return fail(ERR_INPUT, "a joint of the take's person is not finite");
        low = v3(fmin(low.x, p.x), fmin(low.y, p.y), fmin(low.z, p.z));
        high = v3(fmax(high.x, p.x), fmax(high.y, p.y), fmax(high.z, p.z));
    }
    double margin = END_REACH_M;
    for (int p = 0; p < PART_COUNT; p++)
        margin = tsdf->bind_pose.known[p] ? fmax(margin, tsdf->bind_pose.radius[p] + REACH_M) : margin;
    tsdf->corner = v3_sub(low, v3(margin, margin, margin));
    struct vec3 extent = v3_sub(v3_add(high, v3(margin, margin, margin)), tsdf->corner);
    const double size[3] = {ceil(extent.x / tsdf->step) + 1, ceil(extent.y / tsdf->step) + 1,
                            ceil(extent.z / tsdf->step) + 1};
    if (!(size[0] >= 1 && size[1] >= 1 && size[2] >= 1 && size[0] * size[1] * size[2] <= TSDF_POINTS_MAX))
        return fail(ERR_INPUT, "the take's joints lie too far apart to be one person's");
    for (int i = 0; i < 3; i++)
        tsdf->size[i] = (int)size[i];
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
static void rasterize_capsule(struct tsdf *tsdf, struct vec3 a, struct vec3 b, double radius, double reach,
                              uint8_t *keep)
{
    struct vec3 along = v3_sub(b, a), low = v3_sub(a, tsdf->corner), high = v3_sub(b, tsdf->corner);
    double length2 = v3_dot(along, along), wide = radius + fmax(reach, (double)TSDF_TRUNCATION_M);
    const double lows[] = {fmin(low.x, high.x), fmin(low.y, high.y), fmin(low.z, high.z)};
    const double highs[] = {fmax(low.x, high.x), fmax(low.y, high.y), fmax(low.z, high.z)};
    int from[3], to[3];
    for (int i = 0; i < 3; i++) {
        from[i] = clamp_to(floor((lows[i] - wide) / tsdf->step), tsdf->size[i]);
        to[i] = clamp_to(ceil((highs[i] + wide) / tsdf->step) + 1, tsdf->size[i]);
    }
    for (int z = from[2]; z < to[2]; z++)
        for (int y = from[1]; y < to[1]; y++)
            for (int x = from[0]; x < to[0]; x++) {
                int at = (z * tsdf->size[1] + y) * tsdf->size[0] + x;
                struct vec3 p = v3_sub(point_at(tsdf, at), a);
                double t = length2 > 0 ? v3_dot(p, along) / length2 : 0;
                t = clamp_double(t, 0, 1);
                double gap = v3_length(v3_sub(p, v3_scale(along, t))) - radius;
                tsdf->voxels[at].distance = fminf(tsdf->voxels[at].distance, (float)gap);
                keep[at] |= gap < reach;
            }
}

static void rasterize_body(struct tsdf *tsdf, uint8_t *keep)
{
    static const enum joint ends[] = {JOINT_LEFT_HAND, JOINT_RIGHT_HAND, JOINT_LEFT_FOOT, JOINT_RIGHT_FOOT, JOINT_HEAD};
    const struct skeleton *s = &tsdf->bind_pose.skeleton;
    for (int p = 0; p < PART_COUNT; p++)
        if (tsdf->bind_pose.known[p])
            rasterize_capsule(tsdf, s->joint[part_ends[p].from], s->joint[part_ends[p].to], tsdf->bind_pose.radius[p],
                              REACH_M, keep);
    for (int p = 0; p < PART_COUNT; p++)
        for (size_t e = 0; e < COUNT_OF(ends); e++)
            if (tsdf->bind_pose.known[p] && part_ends[p].to == ends[e])
                rasterize_capsule(tsdf, s->joint[ends[e]], s->joint[ends[e]], 0, END_REACH_M, keep);
}

static void skin_chunk(void *context, int chunk)
{
    struct tsdf *tsdf = context;
    for (int c = chunk * CELL_CHUNK; c < (chunk + 1) * CELL_CHUNK && c < tsdf->cell_count; c++)
        tsdf->cells[c].skin = bind_pose_skin_weights(&tsdf->bind_pose, point_at(tsdf, tsdf->cells[c].at));
}

static enum status open_cells(struct tsdf *tsdf, int count)
{
    uint8_t *keep = calloc((size_t)count, 1);
    if (!keep)
        return fail(ERR_MEMORY, "no memory for the TSDF");
    for (int i = 0; i < count; i++)
        tsdf->voxels[i].distance = TSDF_TRUNCATION_M;
    rasterize_body(tsdf, keep);
    for (int i = 0; i < count; i++)
        tsdf->cell_count += keep[i];
    tsdf->cells = malloc(sizeof *tsdf->cells * (size_t)(tsdf->cell_count ? tsdf->cell_count : 1));
    int c = 0;
    for (int i = 0; i < count && tsdf->cells; i++)
        if (keep[i]) {
            struct vec3 p = point_at(tsdf, i);
            tsdf->cells[c++] = (struct tsdf_cell){.at = i, .point = {(float)p.x, (float)p.y, (float)p.z}};
            tsdf->voxels[i] =
                (struct tsdf_voxel){fmaxf(-TSDF_TRUNCATION_M, tsdf->voxels[i].distance), CYLINDER_WEIGHT, 0};
        }
    free(keep);
    if (!tsdf->cells)
        return fail(ERR_MEMORY, "no memory for the TSDF");
    parallel_for(tsdf->threads, (tsdf->cell_count + CELL_CHUNK - 1) / CELL_CHUNK, skin_chunk, tsdf);
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

void tsdf_close(struct tsdf **tsdf)
{
    if (!*tsdf)
        return;
    free((*tsdf)->cells);
    free((*tsdf)->active_cells);
    free((*tsdf)->blocks);
    free((*tsdf)->voxels);
    free((*tsdf)->samples);
    free(*tsdf);
    *tsdf = NULL;
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

void tsdf_flatten_unseen_trunk(struct tsdf *tsdf)
{
    for (int c = 0; c < tsdf->cell_count; c++) {
        struct tsdf_voxel *point = &tsdf->voxels[tsdf->cells[c].at];
        const int bone = tsdf->cells[c].skin.bone[0];
        if (!is_trunk(bone) || point->weight != CYLINDER_WEIGHT)
            continue;
        const float gap = (float)flattened_distance(&tsdf->bind_pose, bone, point_at(tsdf, tsdf->cells[c].at));
        point->distance = fmaxf(point->distance, fminf(gap, TSDF_TRUNCATION_M));
    }
}

// ---------------------------------------------------------------- offset, free space

struct offset_job {
    struct tsdf *tsdf;
    const struct bone_chart *out_m;
};

static void offset_cell(const struct offset_job *job, const struct tsdf_cell *cell)
{
    float *distance = &job->tsdf->voxels[cell->at].distance;
    if (*distance >= TSDF_TRUNCATION_M) // far outside: stays so
        return;
    const struct vec3 point = v3((double)cell->point[0], (double)cell->point[1], (double)cell->point[2]);
    for (int i = 0; i < SKIN_BONES; i++) {
        const int bone = cell->skin.bone[i];
        if (!(cell->skin.weight[i] > 0))
            continue;
        const struct chart_sample here = chart_sample_at(&job->tsdf->bind_pose.frame[bone], point);
        *distance -= cell->skin.weight[i] * bone_chart_at(&job->out_m[bone], &here);
    }
}

static void offset_chunk(void *context, int chunk)
{
    const struct offset_job *job = context;
    for (int c = chunk * CELL_CHUNK; c < (chunk + 1) * CELL_CHUNK && c < job->tsdf->cell_count; c++)
        offset_cell(job, &job->tsdf->cells[c]);
}

void tsdf_offset(struct tsdf *tsdf, const struct bone_chart out_m[BONE_COUNT])
{
    struct offset_job job = {tsdf, out_m};
    parallel_for(tsdf->threads, (tsdf->cell_count + CELL_CHUNK - 1) / CELL_CHUNK, offset_chunk, &job);
}

// The voxel of `known` that is nearest to a cell of v; both grids begin at the same corner.
static const struct tsdf_voxel *known_voxel(const struct tsdf *tsdf, const struct tsdf *known,
                                            const struct tsdf_cell *cell)
{
    const int at[3] = {cell->at % tsdf->size[0], cell->at / tsdf->size[0] % tsdf->size[1],
                       cell->at / tsdf->size[0] / tsdf->size[1]};
    int nearest[3];
    for (int i = 0; i < 3; i++) {
        nearest[i] = (int)(at[i] * tsdf->step / known->step + 0.5);
        nearest[i] = nearest[i] < known->size[i] ? nearest[i] : known->size[i] - 1;
    }
    return &known->voxels[(nearest[2] * known->size[1] + nearest[1]) * known->size[0] + nearest[0]];
}

enum status tsdf_copy_free_space(struct tsdf *tsdf, const struct tsdf *known)
{
    const struct tsdf_cell *cells = tsdf->active_cells ? tsdf->active_cells : tsdf->cells;
    int count = tsdf->active_cells ? tsdf->active_count : tsdf->cell_count, left = 0;
    struct tsdf_cell *active = malloc(sizeof *active * (size_t)(count ? count : 1));
    if (!active)
        return fail(ERR_MEMORY, "no memory for the TSDF");
    for (int c = 0; c < count; c++) {
        const struct tsdf_voxel *point = known_voxel(tsdf, known, &cells[c]);
        if (point->weight > CYLINDER_WEIGHT && point->distance >= FREE_SPACE_SHARE * TSDF_TRUNCATION_M) {
            tsdf->voxels[cells[c].at].distance = point->distance;
            tsdf->voxels[cells[c].at].weight = point->weight;
        } else {
            active[left++] = cells[c];
        }
    }
    free(tsdf->active_cells);
    free(tsdf->blocks);
    tsdf->blocks = NULL;
    tsdf->active_cells = active;
    tsdf->active_count = left;
    return OK;
}

// ---------------------------------------------------------------- sampling

const struct bind_pose *tsdf_bind_pose(const struct tsdf *tsdf) { return &tsdf->bind_pose; }

const struct calibration *tsdf_calibration(const struct tsdf *tsdf) { return &tsdf->calibration; }

bool tsdf_sample(const struct tsdf *tsdf, struct vec3 bind_point, double *distance, struct vec3 *gradient, double *seen)
{
    struct vec3 g = v3_scale(v3_sub(bind_point, tsdf->corner), 1 / tsdf->step);
    if (!(g.x >= 0 && g.y >= 0 && g.z >= 0 && g.x < tsdf->size[0] - 1 && g.y < tsdf->size[1] - 1 &&
          g.z < tsdf->size[2] - 1))
        return false;
    const int x = (int)g.x, y = (int)g.y, z = (int)g.z;
    double f[2][2][2], u = g.x - x, w = g.y - y, t = g.z - z;
    float min_seen = INFINITY;
    for (int i = 0; i < 8; i++) {
        int at = ((z + (i >> 2)) * tsdf->size[1] + y + (i >> 1 & 1)) * tsdf->size[0] + x + (i & 1);
        const struct tsdf_voxel *voxel = &tsdf->voxels[at];
        if (!(voxel->weight > 0))
            return false;
        f[i >> 2][i >> 1 & 1][i & 1] = (double)voxel->distance;
        min_seen = voxel->seen < min_seen ? voxel->seen : min_seen;
    }
    *seen = (double)min_seen;
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
    *gradient = v3_scale(*gradient, 1 / tsdf->step);
    return fabs(*distance) < (double)TSDF_TRUNCATION_M * 0.98;
}

enum status tsdf_smooth(struct tsdf *tsdf, int passes)
{
    size_t count = (size_t)(tsdf->size[0] * tsdf->size[1] * tsdf->size[2]);
    float *from = malloc(sizeof *from * count);
    if (!from)
        return fail(ERR_MEMORY, "no memory for the TSDF");
    const int step[3] = {1, tsdf->size[0], tsdf->size[0] * tsdf->size[1]};
    for (int pass = 0; pass < passes; pass++)
        for (int axis = 0; axis < 3; axis++) {
            for (size_t i = 0; i < count; i++)
                from[i] = tsdf->voxels[i].distance;
            for (int c = 0; c < tsdf->cell_count; c++) {
                int at = tsdf->cells[c].at, a = at - step[axis], b = at + step[axis];
                if (tsdf->voxels[a].weight > 0 && tsdf->voxels[b].weight > 0) // (a cell is never at the grid's border)
                    tsdf->voxels[at].distance = (from[a] + 2 * from[at] + from[b]) / 4;
            }
        }
    free(from);
    return OK;
}

// ---------------------------------------------------------------- surface (naive surface nets)

void surface_mesh_free(struct surface_mesh *mesh)
{
    free(mesh->points);
    free(mesh->normals);
    free(mesh->corners);
    *mesh = (struct surface_mesh){0};
}

// The vertex of the cube whose lowest grid point is `at`: the mean of its edges' zero crossings. False: none cross.
static bool cube_point(const struct tsdf *tsdf, int at, struct vec3 *out)
{
    const int dx = 1, dy = tsdf->size[0], dz = tsdf->size[0] * tsdf->size[1];
    float d[8];
    int inside = 0;
    for (int i = 0; i < 8; i++) {
        int corner = at + (i & 1) * dx + (i >> 1 & 1) * dy + (i >> 2) * dz;
        if (!(tsdf->voxels[corner].weight > 0))
            return false;
        d[i] = tsdf->voxels[corner].distance;
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
    *out = v3_add(point_at(tsdf, at), v3_scale(sum, tsdf->step / crossings));
    return true;
}

static void add_quad(struct surface_mesh *mesh, const int32_t q[4], bool reversed)
{
    static const int order[2][6] = {{0, 1, 2, 0, 2, 3}, {0, 2, 1, 0, 3, 2}};
    for (int i = 0; i < 4; i++)
        if (q[i] < 0)
            return;
    for (int i = 0; i < 6; i++)
        mesh->corners[mesh->corner_count++] = q[order[reversed][i]];
}

// Normals as noisy as depth would make the shading flicker: each becomes the mean of itself and its neighbours.
static enum status smooth_normals(struct surface_mesh *mesh)
{
    struct vec3 *sum = malloc(sizeof *sum * (size_t)(mesh->point_count + 1));
    if (!sum)
        return fail(ERR_MEMORY, "no memory for the TSDF");
    for (int pass = 0; pass < NORMAL_PASSES; pass++) {
        for (int i = 0; i < mesh->point_count; i++)
            sum[i] = mesh->normals[i];
        for (int c = 0; c < mesh->corner_count; c++) {
            int next = c % 3 == 2 ? c - 2 : c + 1;
            sum[mesh->corners[c]] = v3_add(sum[mesh->corners[c]], mesh->normals[mesh->corners[next]]);
        }
        for (int i = 0; i < mesh->point_count; i++)
            mesh->normals[i] = v3_unit(sum[i]);
    }
    free(sum);
    return OK;
}

enum status tsdf_extract_surface(const struct tsdf *tsdf, struct surface_mesh *out)
{
    *out = (struct surface_mesh){0};
    const int step[3] = {1, tsdf->size[0], tsdf->size[0] * tsdf->size[1]};
    int count = tsdf->size[0] * tsdf->size[1] * tsdf->size[2], max = 0;
    int32_t *number = malloc(sizeof *number * (size_t)count);
    for (int i = 0; number && i < count; i++)
        number[i] = -1;
    struct vec3 p;
    for (int c = 0; number && c < tsdf->cell_count; c++)
        if (cube_point(tsdf, tsdf->cells[c].at, &p))
            number[tsdf->cells[c].at] = max++;
    out->points = malloc(sizeof *out->points * (size_t)(max + 1));
    out->normals = malloc(sizeof *out->normals * (size_t)(max + 1));
    out->corners = malloc(sizeof *out->corners * 18 * (size_t)(max + 1));
    if (!number || !out->points || !out->normals || !out->corners) {
        free(number);
        surface_mesh_free(out);
        return fail(ERR_MEMORY, "no memory for the TSDF");
    }
    for (int c = 0; c < tsdf->cell_count; c++) {
        int at = tsdf->cells[c].at;
        if (number[at] < 0 || !cube_point(tsdf, at, &p))
            continue;
        double distance, seen;
        struct vec3 *normal = &out->normals[out->point_count];
        *normal = v3(0, 0, 0);
        tsdf_sample(tsdf, p, &distance, normal, &seen);
        *normal = v3_unit(*normal);
        out->points[out->point_count++] = p;
    }
    for (int c = 0; c < tsdf->cell_count; c++)
        for (int axis = 0; axis < 3; axis++) { // each crossing edge makes a quad of the four cubes around it
            int at = tsdf->cells[c].at, to = at + step[axis], b = step[(axis + 1) % 3], d = step[(axis + 2) % 3];
            if (to >= count || at < b + d || !(tsdf->voxels[to].weight > 0) ||
                (tsdf->voxels[at].distance < 0) == (tsdf->voxels[to].distance < 0))
                continue;
            const int32_t quad[4] = {number[at], number[at - b], number[at - b - d], number[at - d]};
            add_quad(out, quad, tsdf->voxels[at].distance >= 0);
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
