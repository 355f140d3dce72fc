#include "reenact/retrieval/pose_index_bounds.h"

// ---------------------------------------------------------------- in the order in which they came

enum { BLOCKS_AT_ONCE = 32 }; // looked at together: what they lie in comes while others are found

struct waiting {
    int block_count; // to be looked at
    uint32_t blocks[BLOCKS_AT_ONCE];
    int point_count; // to be asked
    uint32_t slots[BLOCKS_AT_ONCE * BLOCK];
    int16_t sums[BLOCKS_AT_ONCE * BLOCK]; // their bounds
};

// Those points of the waiting blocks whose bounds are low enough wait to be asked.
static KERNEL void look(const struct search *s, struct waiting *q)
{
    const struct nearest *n = s->n;
    const struct wanted *w = &s->wanted;
    for (int b = 0; b < q->block_count; b++) {
        int64_t block = q->blocks[b];
        const uint32_t known = n->heads[block].known;
        points_lanes sums;
        memcpy(sums, n->heads[block].own, sizeof sums);
        for (int k = 0; k < w->count; k++) {
            int place = w->place[k];
            const struct point_lanes *p = &n->points[block * n->places + place];
            if (known >> place & 1)
                add_points(p->at[0], p->at[1], p->at[2], BLOCK, w->at[place], n->place_most, sums);
        }
        uint32_t bits = lowest(within(sums, BLOCK, s->limit), n->count - block * BLOCK);
        for (; bits; bits &= bits - 1) {
            int i = __builtin_ctz(bits);
            q->slots[q->point_count] = (uint32_t)(block * BLOCK + i);
            q->sums[q->point_count++] = sums[i];
        }
    }
    q->block_count = 0;
}

// That with the least bound comes first: mostly, none of the others need be asked then.
static KERNEL void ask_points(struct search *s, struct waiting *q)
{
    int least = 0;
    for (int i = 1; i < q->point_count; i++)
        least = q->sums[i] < q->sums[least] ? i : least;
    if (q->point_count > 0)
        ask(s, q->slots[least]);
    for (int i = 0; i < q->point_count; i++)
        if (i != least && q->sums[i] <= s->limit)
            ask(s, q->slots[i]);
    q->point_count = 0;
}

// Blocks from `first` on, as bits, wait to be looked at.
static KERNEL void wait_for(struct search *s, struct waiting *q, int64_t first, uint32_t bits)
{
    const struct nearest *n = s->n;
    for (; bits; bits &= bits - 1) {
        if (q->block_count == BLOCKS_AT_ONCE) {
            look(s, q);
            ask_points(s, q);
        }
        int64_t block = first + __builtin_ctz(bits);
        q->blocks[q->block_count++] = (uint32_t)block;
        fetch(&n->points[block * n->places], (size_t)n->places * sizeof *n->points);
        fetch(&n->heads[block], sizeof *n->heads);
    }
}

// The promising block sets the mark for all.
FOR_EACH_PROCESSOR
static void find_in_order(struct search *s)
{
    struct waiting q;
    const struct nearest *n = s->n;
    int64_t blocks = blocks_of(n->count), promising = bound_all(s, n->boxes, *n->least_own, blocks);
    q.block_count = q.point_count = 0;
    if (promising < 0)
        return;
    wait_for(s, &q, promising, 1);
    look(s, &q);
    ask_points(s, &q);
    n->bounds[promising / LANES][promising % LANES] = SUM_MOST; // once is enough
    for (int64_t b = 0; b < blocks; b += LANES)
        wait_for(s, &q, b, near_boxes(s, b, blocks));
    look(s, &q);
    ask_points(s, &q);
}

// ---------------------------------------------------------------- finding

static struct wanted wanted_of(const struct nearest *n, const struct nearest_point *point)
{
    struct wanted w = {0};
    for (int p = 0; p < n->places; p++) {
        if (!(point->known >> p & 1))
            continue;
        const double *place = &point->place[p].x;
        for (int axis = 0; axis < 3; axis++)
            w.at[p][axis] = units(place[axis], n->unit_m);
        w.place[w.count++] = p;
    }
    return w;
}

void nearest_find_all(struct nearest_query *queries, int count, nearest_cost *cost)
{
    struct search all[NEAREST_QUERIES_MOST];
    assert(count > 0 && count <= NEAREST_QUERIES_MOST);
    for (int i = 0; i < count; i++) {
        const struct nearest_query *q = &queries[i];
        assert(q->scale > 0 && !q->index->settled == !queries[0].index->settled);
        all[i] = (struct search){.n = q->index,
                                 .wanted = wanted_of(q->index, &q->point),
                                 .scale = q->scale,
                                 .cost = cost,
                                 .context = q->context,
                                 .best = -1,
                                 .limit = SUM_MOST};
    }
    if (all[0].n->settled)
        nearest_find_settled(all, count);
    else
        for (int i = 0; i < count; i++)
            find_in_order(&all[i]);
    for (int i = 0; i < count; i++) {
        queries[i].number = all[i].best < 0 ? -1 : nearest_number(all[i].n, all[i].best);
        queries[i].cost_m = all[i].best_m;
    }
}
