// Fusing one depth frame into a TSDF, eight cells at a time (tsdf.h).
#include "base/parallel.h"
#include "reenact/avatar/tsdf_internal.h"

#include <stdlib.h>
#include <string.h>

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
        return fail(ERR_MEMORY, "out of memory");
    s->cells = v->active_cells ? v->active_cells : v->cells;
    s->count = v->active_cells ? v->active_count : v->cell_count;
    v->block_count = sort_cells(s, NULL);
    v->blocks = malloc(sizeof *v->blocks * (size_t)(v->block_count + 1));
    if (v->blocks)
        sort_cells(s, v->blocks);
    free(s);
    return v->blocks ? OK : fail(ERR_MEMORY, "out of memory");
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
