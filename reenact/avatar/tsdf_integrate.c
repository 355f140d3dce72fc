#include "base/parallel.h"
#include "reenact/avatar/tsdf_internal.h"

#include <stdlib.h>
#include <string.h>

static const float INSIDE_M = 0.04F;     // distances are kept so far behind what was seen
static const float THICK = 1.15F;        // parts, against their cylinders' radius
static const float EMPTY_TRUST = 0.5F;   // against a reading's 1
static const float VOTE_M = 0.02F;       // what is said to lie farther from the surface counts by no more than that
static const float ROOM_SLACK_M = 0.05F; // the room is not nearer than this behind the person where they are told apart

enum { LANES = VOLUME_LANES, THREADS = 2, STRETCH = 1024, AHEAD = 3 };

// One number of each of a block's cells. What is done with them is the same on every machine, however many of them its
// instructions take at a time.
typedef float lanes __attribute__((vector_size(sizeof(float) * LANES)));
typedef int32_t lanes_int __attribute__((vector_size(sizeof(int32_t) * LANES)));

// Comparing lanes gives lanes_int, -1 for yes. Functions are given pointers, for not every machine can pass lanes.
#define WHERE(yes, a, b) ((lanes)(((yes) & (lanes_int)(a)) | (~(yes) & (lanes_int)(b))))
#define LEAST(a, b)      WHERE((a) < (b), a, b)
#define EACH(number)     ((lanes){0} + (number))

// ---------------------------------------------------------------- cells, eight at a time

struct sorting {
    const struct cell *cells;
    int count;
    int32_t open[BONE_COUNT][BONE_COUNT][BONE_COUNT]; // the last block of cells with such bones; -1: none
};

static void put_cell(struct cell_block *b, const struct cell *cell)
{
    const int first = b->count, last = first ? first : LANES - 1; // the first one fills all
    for (int l = first; l <= last; l++) {
        b->at[l] = cell->at;
        for (int i = 0; i < 3; i++)
            b->place[i][l] = cell->place[i];
        for (int i = 0; i < SKIN_BONES; i++)
            b->weight[i][l] = i == 0 || cell->skin.weight[0] < 1 ? cell->skin.weight[i] : 0;
    }
    memcpy(b->bone, cell->skin.bone, sizeof b->bone);
    b->count++;
}

// blocks: NULL: they are only counted. How many there are.
static int sort_cells(struct sorting *s, struct cell_block *blocks)
{
    int count = 0;
    memset(s->open, -1, sizeof s->open);
    for (int c = 0; c < s->count; c++) {
        const uint8_t *bone = s->cells[c].skin.bone;
        int32_t *open = &s->open[bone[0]][bone[1]][bone[2]];
        // While they are counted, `open` holds how many cells are in the block, for want of it.
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

static enum status open_blocks(struct volume *v)
{
    struct sorting *s = malloc(sizeof *s);
    if (!s)
        return fail(ERR_MEMORY, "out of memory");
    s->cells = v->heeding ? v->heeding : v->cells;
    s->count = v->heeding ? v->heeding_count : v->cell_count;
    v->block_count = sort_cells(s, NULL);
    v->blocks = malloc(sizeof *v->blocks * (size_t)(v->block_count + 1));
    if (v->blocks)
        sort_cells(s, v->blocks);
    free(s);
    return v->blocks ? OK : fail(ERR_MEMORY, "out of memory");
}

// ---------------------------------------------------------------- one frame

// What one frame says of the cells.
struct addition {
    struct volume *volume;
    float maps[BONE_COUNT][3][4]; // into the depth camera's axes: rows
    float thick[BONE_COUNT];
    uint16_t meeting[BONE_COUNT]; // bit p: meets part p
    bool ideal;                   // lens: without lens_project's way round, for speed
    const struct lens *lens;
    float fx, fy, cx, cy;         // likewise
    int left, top, width, height; // of the window that witnesses speak for
    const struct witness *witnesses;
};

// Into functions for processors of more and of less.
#define INLINE static inline __attribute__((always_inline))

// Where a block's cells are, in the depth camera's axes.
INLINE void place_cells(const struct addition *a, const struct cell_block *b, lanes out[3])
{
    lanes place[3], weight[SKIN_BONES];
    memcpy(place, b->place, sizeof place);
    memcpy(weight, b->weight, sizeof weight);
    for (int row = 0; row < 3; row++) {
        lanes m[4];
        for (int k = 0; k < 4; k++)
            m[k] = weight[0] * a->maps[b->bone[0]][row][k];
        for (int i = 1; i < SKIN_BONES; i++)
            for (int k = 0; k < 4 && b->bone[i] != b->bone[0]; k++)
                m[k] += weight[i] * a->maps[b->bone[i]][row][k];
        out[row] = m[0] * place[0] + m[1] * place[1] + m[2] * place[2] + m[3];
    }
}

// Where these places fall in the picture, pixels; half a pixel on, for rounding.
INLINE void project(const struct addition *a, const lanes p[3], lanes px[2])
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

// The witnesses' words for these cells.
struct words {
    lanes depth_m, edge_px, half_px;
    lanes_int heard; // there is one, and it shows a surface
    lanes_int room;  // it shows the room
    lanes_int own;   // it shows the cells' own part
    lanes_int meets; // or one that meets it
};

INLINE void call(const struct addition *a, const struct cell_block *b, const lanes p[3], struct words *out)
{
    lanes px[2];
    project(a, p, px);
    const lanes_int inside = (p[2] > 0.05F) & (px[0] >= 0) & (px[1] >= 0) & (px[0] < (float)a->lens->width) &
                             (px[1] < (float)a->lens->height);
    const lanes_int x = __builtin_convertvector(WHERE(inside, px[0], EACH(0.0F)), lanes_int) - a->left,
                    y = __builtin_convertvector(WHERE(inside, px[1], EACH(0.0F)), lanes_int) - a->top; // rounded down
    const lanes_int speaks = inside & (x >= 0) & (y >= 0) & (x < a->width) & (y < a->height);
    const lanes_int at = speaks & (y * a->width + x);
    const int own = (int)bone_part(b->bone[0]), meeting = a->meeting[b->bone[0]];
    lanes_int depth, edge, half, part;
    for (int l = 0; l < LANES; l++) {
        const struct witness *w = &a->witnesses[at[l]];
        depth[l] = w->depth, edge[l] = w->edge, half[l] = w->half, part[l] = w->part;
    }
    out->depth_m = __builtin_convertvector(depth, lanes) * 1e-3F;
    out->edge_px = __builtin_convertvector(edge, lanes);
    out->half_px = __builtin_convertvector(half, lanes);
    out->heard = speaks & (depth != 0) & (part != SIGHT_RIM);
    out->room = part == SIGHT_ROOM;
    out->own = part == own;
    for (int l = 0; l < LANES; l++)
        out->meets[l] = -(meeting >> part[l] & 1);
}

// What one frame says of a block's cells.
struct saying {
    lanes distance, trust; // how far they are before (+) what pixels show, and how surely
    lanes_int any;         // it says anything of them
    lanes_int reading;     // it shows that very surface
};

INLINE void ask(const struct addition *a, const struct words *w, const lanes *z, int bone, struct saying *out)
{
    const lanes before = w->depth_m - *z;
    // Where the sensor looked past, the surface is no farther off than the edge that it looked past.
    const lanes beyond = WHERE(w->room, EACH(0.5F - (float)SIGHT_RIM_PX),
                               EACH(0.5F + (float)SIGHT_RIM_PX)); // half of the rim is still the person
    const lanes away = (w->edge_px + beyond) * *z / a->fx, aside = LEAST(away, EACH(VOLUME_OUTSIDE_M));
    const lanes sure = 0.1F + 0.3F * w->edge_px; // which surface a pixel at an edge shows is a matter of chance
    // The body goes on behind what is seen of it, no farther than it is thick.
    const lanes wide = w->half_px * *z / a->fx, thick = LEAST(EACH(a->thick[bone]), wide);
    const lanes_int behind = ~w->room & (before < -INSIDE_M);
    out->reading = ~w->room & ~behind & (before < VOLUME_OUTSIDE_M);
    out->distance = WHERE(out->reading, before, WHERE(behind, -LEAST(aside, EACH(INSIDE_M)), aside));
    out->trust = WHERE(out->reading, LEAST(EACH(1.0F), sure), LEAST(EACH(EMPTY_TRUST), sure));
    const lanes_int past = w->room & (before > ROOM_SLACK_M);
    const lanes_int within = behind & (before > -THICK * thick) & w->own;
    out->any = w->heard & (past | within | (~w->room & ~behind & (~out->reading | w->meets)));
}

INLINE void add_block(const struct addition *a, const struct cell_block *b)
{
    lanes p[3], known, trusted, seen;
    struct words words;
    struct saying says;
    struct point *points = a->volume->points;
    place_cells(a, b, p);
    call(a, b, p, &words);
    ask(a, &words, &p[2], b->bone[0], &says);
    int any = 0;
    for (int l = 0; l < b->count; l++)
        any |= says.any[l];
    if (!any)
        return;
    // What is far from the surface says on which side it is, not how far: limbs are now here, now there.
    const lanes far = WHERE(says.distance < 0, -says.distance, says.distance);
    const lanes vote = VOTE_M / WHERE(far > 1e-6F, far, EACH(1e-6F));
    const lanes trust = says.trust * LEAST(EACH(1.0F), vote);
    for (int l = 0; l < LANES; l++) {
        const struct point *point = &points[b->at[l]];
        known[l] = point->distance, trusted[l] = point->trust, seen[l] = point->seen;
    }
    known = (known * trusted + says.distance * trust) / (trusted + trust);
    trusted += trust;
    seen += WHERE(says.reading, trust, EACH(0.0F));
    for (int l = 0; l < b->count; l++)
        if (says.any[l])
            points[b->at[l]] = (struct point){known[l], trusted[l], seen[l]};
}

INLINE void add_blocks(const struct addition *a, int stretch)
{
    const int from = stretch * STRETCH, to = from + STRETCH, count = a->volume->block_count;
    for (int i = from; i < to && i < count; i++) {
        const struct cell_block *b = &a->volume->blocks[i], *later = b + (i + AHEAD < count ? AHEAD : 0);
        __builtin_prefetch(&a->volume->points[later->at[0]], 1);
        __builtin_prefetch(&a->volume->points[later->at[later->count - 1]], 1);
        add_block(a, b);
    }
}

static void add_stretch(void *context, int stretch) { add_blocks(context, stretch); }

// The same numbers, eight at a time.
#ifdef __x86_64__
__attribute__((target("avx2"))) static void add_stretch_wide(void *context, int stretch)
{
    add_blocks(context, stretch);
}
#endif

typedef void adder(void *context, int stretch);

static adder *find_adder(void)
{
#ifdef __x86_64__
    if (__builtin_cpu_supports("avx2"))
        return add_stretch_wide;
#endif
    return add_stretch;
}

// Who speaks: all pixels as far about the person as edges are told.
static void call_witnesses(struct addition *a, const struct sight *s)
{
    int right = s->right + SIGHT_EDGE_MOST, bottom = s->bottom + SIGHT_EDGE_MOST;
    a->left = s->left > SIGHT_EDGE_MOST ? s->left - SIGHT_EDGE_MOST : 0;
    a->top = s->top > SIGHT_EDGE_MOST ? s->top - SIGHT_EDGE_MOST : 0;
    a->width = (right < s->width ? right + 1 : s->width) - a->left;
    a->height = (bottom < s->height ? bottom + 1 : s->height) - a->top;
    struct witness *w = a->volume->witnesses;
    a->witnesses = w;
    for (int y = a->top; y < a->top + a->height; y++)
        for (int i = y * s->width + a->left; i < y * s->width + a->left + a->width; i++)
            *w++ = (struct witness){s->depth[i], s->part[i], s->edge[i], s->half[i]};
}

enum status volume_add(struct volume *v, const struct sight *sight, const struct posture *posture)
{
    struct addition a = {.volume = v, .lens = &v->calibration.depth};
    enum status status = v->blocks ? OK : open_blocks(v);
    if (status != OK || sight->right < sight->left)
        return status;
    a.ideal = lens_is_ideal(a.lens);
    a.fx = (float)a.lens->fx, a.fy = (float)a.lens->fy, a.cx = (float)a.lens->cx, a.cy = (float)a.lens->cy;
    for (int p = 0; p < BONE_COUNT; p++) {
        const struct part_map map = part_map_of(pose_multiply(v->depth_from_color, posture->bone[p]));
        memcpy(a.maps[p], map.row, sizeof a.maps[p]);
        a.thick[p] = (float)v->rest.radius[p];
        for (int q = 0; q < PART_COUNT; q++)
            a.meeting[p] |= (uint16_t)(bones_meet((int)bone_part(p), q) << q);
    }
    call_witnesses(&a, sight);
    // Each cell is one thread's, so it does not matter how many there are.
    parallel(THREADS, (v->block_count + STRETCH - 1) / STRETCH, find_adder(), &a);
    return OK;
}
