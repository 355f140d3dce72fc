// Search through points in the order of adding; queries.
#include "reenact/retrieval/pose_index_bounds.h"

// ---------------------------------------------------------------- unpacked search

enum { BLOCK_BATCH = 32 }; // blocks per batch: their prefetches complete while others are found

struct search_queue {
    int block_count;
    uint32_t blocks[BLOCK_BATCH]; // to be bounded
    int point_count;
    uint32_t slots[BLOCK_BATCH * BLOCK]; // to be evaluated
    int16_t sums[BLOCK_BATCH * BLOCK];   // their bounds
};

// Bounds the points of the queued blocks and queues those within the limit.
static KERNEL void bound_queued(const struct index_search *s, struct search_queue *q)
{
    const struct pose_index *n = s->n;
    const struct quantized_query *w = &s->target;
    for (int b = 0; b < q->block_count; b++) {
        int64_t block = q->blocks[b];
        const uint32_t known = n->heads[block].known;
        points_lanes sums;
        memcpy(sums, n->heads[block].fixed_cost, sizeof sums);
        for (int k = 0; k < w->count; k++) {
            int position = w->position[k];
            const struct point_lanes *p = &n->points[block * n->positions + position];
            if (known >> position & 1)
                add_points((struct point_axes){p->at[0], p->at[1], p->at[2]}, BLOCK, w->at[position], n->max_distance,
                           sums);
        }
        uint32_t bits = lowest(bits_within(sums, BLOCK, s->limit), n->count - block * BLOCK);
        for (; bits; bits &= bits - 1) {
            int i = __builtin_ctz(bits);
            q->slots[q->point_count] = (uint32_t)(block * BLOCK + i);
            q->sums[q->point_count++] = sums[i];
        }
    }
    q->block_count = 0;
}

// Evaluates the point with the least bound first: mostly, none of the others needs evaluation then.
static KERNEL void evaluate_points(struct index_search *s, struct search_queue *q)
{
    int least = 0;
    for (int i = 1; i < q->point_count; i++)
        least = q->sums[i] < q->sums[least] ? i : least;
    if (q->point_count > 0)
        evaluate(s, q->slots[least]);
    for (int i = 0; i < q->point_count; i++)
        if (i != least && q->sums[i] <= s->limit)
            evaluate(s, q->slots[i]);
    q->point_count = 0;
}

// Queues the blocks `first` + i, bit i.
static KERNEL void enqueue_blocks(struct index_search *s, struct search_queue *q, int64_t first, uint32_t bits)
{
    const struct pose_index *n = s->n;
    for (; bits; bits &= bits - 1) {
        if (q->block_count == BLOCK_BATCH) {
            bound_queued(s, q);
            evaluate_points(s, q);
        }
        int64_t block = first + __builtin_ctz(bits);
        q->blocks[q->block_count++] = (uint32_t)block;
        prefetch(&n->points[block * n->positions], (size_t)n->positions * sizeof *n->points);
        prefetch(&n->heads[block], sizeof *n->heads);
    }
}

// The block with the least bound is evaluated first: it sets the limit for all.
FOR_EACH_PROCESSOR
static void search_unpacked(struct index_search *s)
{
    struct search_queue q;
    const struct pose_index *n = s->n;
    int64_t blocks = blocks_of(n->count), promising = bound_all(s, n->boxes, *n->min_fixed_cost, blocks);
    q.block_count = q.point_count = 0;
    if (promising < 0)
        return;
    enqueue_blocks(s, &q, promising, 1);
    bound_queued(s, &q);
    evaluate_points(s, &q);
    n->bounds[promising / LANES][promising % LANES] = MAX_SUM; // not again
    for (int64_t b = 0; b < blocks; b += LANES)
        enqueue_blocks(s, &q, b, boxes_within_limit(s, b, blocks));
    bound_queued(s, &q);
    evaluate_points(s, &q);
}

// ---------------------------------------------------------------- queries

static struct quantized_query quantize_query(const struct pose_index *n, const struct pose_index_point *point)
{
    struct quantized_query w = {0};
    for (int p = 0; p < n->positions; p++) {
        if (!(point->known >> p & 1))
            continue;
        quantize_position(point->position[p], n->unit_m, w.at[p]);
        w.position[w.count++] = p;
    }
    return w;
}

void pose_index_query_all(struct pose_index_query *queries, int count, pose_index_cost *cost)
{
    struct index_search all[POSE_INDEX_MAX_QUERIES];
    assert(count > 0 && count <= POSE_INDEX_MAX_QUERIES);
    for (int i = 0; i < count; i++) {
        const struct pose_index_query *q = &queries[i];
        assert(q->scale > 0 && !q->index->packed == !queries[0].index->packed);
        all[i] = (struct index_search){.n = q->index,
                                       .target = quantize_query(q->index, &q->point),
                                       .scale = q->scale,
                                       .cost = cost,
                                       .context = q->context,
                                       .best = -1,
                                       .limit = MAX_SUM};
    }
    if (all[0].n->packed)
        pose_index_query_packed(all, count);
    else
        for (int i = 0; i < count; i++)
            search_unpacked(&all[i]);
    for (int i = 0; i < count; i++) {
        queries[i].number = all[i].best < 0 ? -1 : pose_index_number(all[i].n, all[i].best);
        queries[i].cost_m = all[i].best_m;
    }
}
