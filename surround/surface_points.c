#include "surround/surface_points.h"

#include <stdlib.h>

enum status surface_points_gather(struct surface_points *s, const struct voxel_map *map)
{
    if (map->used + 1 > s->room) {
        const size_t room = map->used + map->used / 4 + 1;
        float(*xyz)[3] = realloc(s->xyz, room * sizeof *xyz);
        if (xyz)
            s->xyz = xyz;
        float *weights = realloc(s->weights, room * sizeof *weights);
        if (weights)
            s->weights = weights;
        if (!xyz || !weights)
            return fail(ERR_MEMORY, "out of memory");
        s->room = room;
    }
    s->count = 0;
    for (size_t i = 0; i < map->size; i++)
        if (map->table[i].key) {
            double mean[3];
            voxel_mean(map, &map->table[i], mean);
            for (int k = 0; k < 3; k++)
                s->xyz[s->count][k] = (float)mean[k];
            s->weights[s->count++] = (float)(map->table[i].weight * 1e-6);
        }
    return OK;
}

void surface_points_free(struct surface_points *s)
{
    free(s->xyz);
    free(s->weights);
    *s = (struct surface_points){0};
}

struct world_points surface_points_world(const struct surface_points *s)
{
    return (struct world_points){.xyz = (const float(*)[3])s->xyz, .weight = s->weights, .count = s->count};
}
