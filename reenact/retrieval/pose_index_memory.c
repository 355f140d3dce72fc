// Memory of a pose index, for both its states: as points are added, and packed.
#include "reenact/retrieval/pose_index_packed.h"

#include <stdlib.h>
#include <string.h>

void *pose_index_alloc_zeroed(size_t bytes)
{
    void *zeros = alloc_cache_aligned(bytes);
    return zeros ? memset(zeros, 0, bytes) : NULL;
}

void pose_index_free_points(struct pose_index *n)
{
    free(n->points);
    free(n->heads);
    free(n->boxes);
    free(n->min_fixed_cost);
    n->points = NULL;
    n->heads = NULL;
    n->boxes = NULL;
    n->min_fixed_cost = NULL;
}

void packed_index_close(struct packed_index **s)
{
    if (!*s)
        return;
    free((*s)->blocks);
    free((*s)->groups);
    free((*s)->wide_boxes);
    free((*s)->wide_fixed_cost);
    free(*s);
    *s = NULL;
}
