#include "surround/alignment/branch_and_bound.h"

#include "base/portable_math.h"

#include <stdlib.h>
#include <string.h>

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
            return fail(ERR_MEMORY, "out of memory");
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
    const struct search_options *how;
    int count;
    int32_t (*cells)[2];         // of each turn's turned points, turn-major
    int64_t per_shift, per_turn; // cost of a squared step, 2^-16 points
    struct search_result best;
};

static int64_t cost_of(const struct search *s, int turn, int64_t x, int64_t y)
{
    return s->per_shift * (x * x + y * y) + s->per_turn * turn * turn;
}

static enum status start(struct search *s, const double (*points)[2], const double guess[3])
{
    const struct search_options *how = s->how;
    const int turns = 2 * how->turns + 1;
    s->cells = malloc(((size_t)turns * (size_t)s->count + 1) * sizeof *s->cells);
    if (!s->cells)
        return fail(ERR_MEMORY, "out of memory");
    for (int t = 0; t < turns; t++) {
        const double angle = guess[2] + (t - how->turns) * SEARCH_TURN_STEP;
        const double c = portable_cos(angle), n = portable_sin(angle);
        int32_t(*out)[2] = s->cells + (size_t)t * (size_t)s->count;
        for (int i = 0; i < s->count; i++) {
            const double x = c * points[i][0] - n * points[i][1] + guess[0];
            const double y = n * points[i][0] + c * points[i][1] + guess[1];
            out[i][0] = (int32_t)floor((x - s->grid->x0) / SEARCH_CELL_M);
            out[i][1] = (int32_t)floor((y - s->grid->y0) / SEARCH_CELL_M);
        }
    }
    const double share = 65536.0 * 0.01 * s->count;
    const double shift = SEARCH_CELL_M / (PRIOR_SHIFT_M * how->prior),
                 turn = SEARCH_TURN_STEP / (PRIOR_TURN * how->prior);
    s->per_shift = (int64_t)(share * shift * shift) + 1; // at least 1: of equal answers the nearest
    s->per_turn = (int64_t)(share * turn * turn) + 1;
    s->best = (struct search_result){.score = INT64_MIN};
    return OK;
}

// Points on marked cells when shifted by any of the block's shifts: an upper bound of each one's hits; at level 0
// exact.
static int hits_of(struct search *s, int turn, int x, int y, int level)
{
    const struct search_grid *g = s->grid;
    const uint8_t *map = g->levels[level];
    int32_t(*cells)[2] = s->cells + (size_t)(turn + s->how->turns) * (size_t)s->count;
    const int side = 1 << level;
    int hits = 0;
    for (int i = 0; i < s->count; i++) {
        int u = cells[i][0] + x, v = cells[i][1] + y;
        if (u < 0 && u + side > 0) // a block that begins left of the grid
            u = 0;
        if (v < 0 && v + side > 0)
            v = 0;
        if (u >= 0 && v >= 0 && u < g->width && v < g->height)
            hits += map[(size_t)v * (size_t)g->width + (size_t)u];
    }
    s->best.lookups += s->count;
    return hits;
}

// Whether (turn, x, y) comes before the best in the order that ends every tie.
static bool earlier(const struct search_result *best, int turn, int x, int y)
{
    if (turn != best->turn)
        return turn < best->turn;
    return y != best->y ? y < best->y : x < best->x;
}

static void offer(struct search *s, int turn, int x, int y, int hits)
{
    const int64_t score = (int64_t)hits * 65536 - cost_of(s, turn, x, y);
    if (score < s->best.score || (score == s->best.score && !earlier(&s->best, turn, x, y)))
        return;
    s->best = (struct search_result){turn, x, y, hits, score, s->best.lookups};
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

static struct node bounded(struct search *s, int turn, int x, int y, int level)
{
    const int side = 1 << level, reach = s->how->reach;
    const int64_t cost =
        s->per_shift * (least_square(x, side, reach) + least_square(y, side, reach)) + s->per_turn * turn * turn;
    return (struct node){turn, x, y, level, (int64_t)hits_of(s, turn, x, y, level) * 65536 - cost};
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
static void visit(struct search *s, const struct node *node)
{
    if (node->bound < s->best.score)
        return;
    if (node->level == 0) {
        offer(s, node->turn, node->x, node->y, (int)((node->bound + cost_of(s, node->turn, node->x, node->y)) / 65536));
        return;
    }
    struct node children[4];
    int count = 0;
    const int half = 1 << (node->level - 1), reach = s->how->reach;
    for (int i = 0; i < 4; i++) {
        const int x = node->x + (i & 1) * half, y = node->y + (i >> 1) * half;
        if (x <= reach && y <= reach)
            children[count++] = bounded(s, node->turn, x, y, node->level - 1);
    }
    qsort(children, (size_t)count, sizeof *children, by_bound);
    for (int i = 0; i < count; i++)
        visit(s, &children[i]);
}

enum status search_branch_and_bound(const struct search_grid *grid, const double (*points)[2], int count,
                                    const double guess[3], const struct search_options *how, struct search_result *out)
{
    struct search s = {.grid = grid, .how = how, .count = count};
    enum status status = start(&s, points, guess);
    if (status != OK)
        return status;
    const int side = 1 << SEARCH_LEVELS, blocks = (2 * how->reach + side) / side;
    const int roots = blocks * blocks * (2 * how->turns + 1);
    struct node *nodes = malloc((size_t)roots * sizeof *nodes);
    if (!nodes) {
        free(s.cells);
        return fail(ERR_MEMORY, "out of memory");
    }
    int n = 0;
    for (int turn = -how->turns; turn <= how->turns; turn++)
        for (int j = 0; j < blocks; j++)
            for (int i = 0; i < blocks; i++)
                nodes[n++] = bounded(&s, turn, i * side - how->reach, j * side - how->reach, SEARCH_LEVELS);
    qsort(nodes, (size_t)n, sizeof *nodes, by_bound);
    for (int i = 0; i < n; i++)
        visit(&s, &nodes[i]);
    free(nodes);
    free(s.cells);
    *out = s.best;
    return OK;
}
