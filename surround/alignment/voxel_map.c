#include "surround/alignment/voxel_map.h"

#include "base/memory.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { FIRST_SIZE = 4096 };
#define MOST_VOXELS 1048576 // on each side of the origin: 21 bits a coordinate

static bool voxel_corner(const struct voxel_map *map, const double p[3], int64_t cell[3])
{
    for (int i = 0; i < 3; i++) {
        const double c = floor(p[i] * map->per_m);
        if (!(fabs(c) < MOST_VOXELS))
            return false;
        cell[i] = (int64_t)c;
    }
    return true;
}

static int64_t key_of(const int64_t cell[3])
{
    // The top bit keeps every key from 0
    return (int64_t)(((uint64_t)(cell[0] + MOST_VOXELS) << 42 | (uint64_t)(cell[1] + MOST_VOXELS) << 21 |
                      (uint64_t)(cell[2] + MOST_VOXELS)) +
                     1);
}

// Fibonacci hashing (Knuth 6.4), twice: a product's lower bits know nothing of the key's upper ones, which hold x.
static size_t home_of(const struct voxel_map *map, int64_t key)
{
    uint64_t h = (uint64_t)key * 0x9E3779B97F4A7C15u;
    h = (h ^ h >> 32) * 0x9E3779B97F4A7C15u;
    return (size_t)(h >> 32) & (map->size - 1);
}

static size_t slot_of(const struct voxel_map *map, int64_t key)
{
    size_t slot = home_of(map, key);
    while (map->table[slot].key && map->table[slot].key != key)
        slot = (slot + 1) & (map->size - 1);
    return slot;
}

static struct voxel *empty(size_t size)
{
    struct voxel *table = alloc_cache_aligned(size * sizeof *table);
    if (table)
        memset(table, 0, size * sizeof *table);
    return table;
}

enum status voxel_map_open(struct voxel_map *map, double side_m)
{
    *map = (struct voxel_map){.side_m = side_m, .per_m = 1 / side_m, .size = FIRST_SIZE, .table = empty(FIRST_SIZE)};
    return map->table ? OK : fail(ERR_MEMORY, "out of memory");
}

void voxel_map_close(struct voxel_map *map)
{
    free(map->table);
    *map = (struct voxel_map){0};
}

static enum status grow(struct voxel_map *map)
{
    struct voxel_map larger = *map;
    larger.size = map->size * 2;
    larger.table = empty(larger.size);
    if (!larger.table)
        return fail(ERR_MEMORY, "out of memory");
    for (size_t i = 0; i < map->size; i++)
        if (map->table[i].key)
            larger.table[slot_of(&larger, map->table[i].key)] = map->table[i];
    free(map->table);
    *map = larger;
    return OK;
}

enum status voxel_map_add(struct voxel_map *map, const double world[3], double sigma_m, int capture)
{
    int64_t cell[3];
    if (!voxel_corner(map, world, cell))
        return OK;
    if (map->used * 2 >= map->size) {
        const enum status status = grow(map);
        if (status != OK)
            return status;
    }
    const int64_t key = key_of(cell);
    struct voxel *v = &map->table[slot_of(map, key)];
    if (!v->key) {
        *v = (struct voxel){.key = key, .last = -1};
        map->used++;
    }
    const float w = (float)(1 / (sigma_m * sigma_m));
    float d[3];
    for (int i = 0; i < 3; i++)
        d[i] = (float)(world[i] - (double)cell[i] * map->side_m);
    for (int i = 0, k = 0; i < 3; i++) {
        v->sum[i] += w * d[i];
        for (int j = i; j < 3; j++)
            v->square[k++] += w * d[i] * d[j];
    }
    v->weight += w;
    v->count++;
    v->captures += v->last != capture;
    v->last = capture;
    return OK;
}

void voxel_map_expect(const struct voxel_map *map, const double world[3])
{
    int64_t cell[3];
    if (voxel_corner(map, world, cell))
        __builtin_prefetch(&map->table[home_of(map, key_of(cell))], 1);
}

const struct voxel *voxel_map_at(const struct voxel_map *map, const double world[3])
{
    int64_t cell[3];
    if (!voxel_corner(map, world, cell))
        return NULL;
    const struct voxel *v = &map->table[slot_of(map, key_of(cell))];
    return v->key ? v : NULL;
}

void voxel_mean(const struct voxel_map *map, const struct voxel *v, double mean[3])
{
    const uint64_t key = (uint64_t)v->key - 1;
    for (int i = 0; i < 3; i++) {
        const int64_t cell = (int64_t)(key >> (42 - 21 * i) & (2 * MOST_VOXELS - 1)) - MOST_VOXELS;
        mean[i] = (double)cell * map->side_m + (double)v->sum[i] / (double)v->weight;
    }
}

// Eigenvalues and vectors (columns) of a symmetric matrix, by cyclic Jacobi rotations.
static void jacobi3(double a[3][3], double vectors[3][3])
{
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            vectors[i][j] = i == j;
    for (int sweep = 0; sweep < 8; sweep++)
        for (int p = 0; p < 2; p++)
            for (int q = p + 1; q < 3; q++) {
                if (fabs(a[p][q]) < 1e-30)
                    continue;
                const double tau = (a[q][q] - a[p][p]) / (2 * a[p][q]);
                const double t = (tau < 0 ? -1 : 1) / (fabs(tau) + sqrt(1 + tau * tau));
                const double c = 1 / sqrt(1 + t * t), s = t * c;
                for (int k = 0; k < 3; k++) {
                    const double x = a[k][p], y = a[k][q];
                    a[k][p] = c * x - s * y;
                    a[k][q] = s * x + c * y;
                }
                for (int k = 0; k < 3; k++) {
                    const double x = a[p][k], y = a[q][k];
                    a[p][k] = c * x - s * y;
                    a[q][k] = s * x + c * y;
                }
                for (int k = 0; k < 3; k++) {
                    const double x = vectors[k][p], y = vectors[k][q];
                    vectors[k][p] = c * x - s * y;
                    vectors[k][q] = s * x + c * y;
                }
            }
}

bool voxel_plane(const struct voxel *v, double normal[3], double *thickness_m)
{
    if (v->count < 6)
        return false;
    const double weight = v->weight;
    double a[3][3], vectors[3][3];
    for (int i = 0, k = 0; i < 3; i++)
        for (int j = i; j < 3; j++, k++)
            a[i][j] = a[j][i] =
                (double)v->square[k] / weight - (double)v->sum[i] * (double)v->sum[j] / (weight * weight);
    jacobi3(a, vectors);
    int least = 0;
    for (int i = 1; i < 3; i++)
        if (a[i][i] < a[least][least])
            least = i;
    const double other = fmin(a[(least + 1) % 3][(least + 1) % 3], a[(least + 2) % 3][(least + 2) % 3]);
    const double across = a[least][least] > 0 ? a[least][least] : 0;
    for (int i = 0; i < 3; i++)
        normal[i] = vectors[i][least];
    *thickness_m = sqrt(across);
    return across * 9 < other;
}
