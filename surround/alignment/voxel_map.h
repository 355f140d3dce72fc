// Points averaged in cubes: each voxel of a hash table holds the weighted mean and covariance of what fell into it.
// Pure but for memory; one writer, or any number of readers.
#pragma once
#include "base/status.h"

// One line of the processor's cache: the table is read in no order, and each line waits for the memory.
struct voxel {
    int64_t key;      // 0: empty
    float weight;     // sum of 1 / sigma^2 of its points
    float sum[3];     // weighted, relative to the voxel's corner, metres
    float square[6];  // weighted products xx xy xz yy yz zz, relative to the corner
    int32_t count;    // points
    int32_t captures; // how many additions of a new capture
    int32_t last;     // number of the newest capture in it
    int32_t unused;
};

struct voxel_map {
    double side_m, per_m; // per_m: 1 / side_m
    struct voxel *table;  // a power of two of them, aligned to the cache's lines
    size_t size, used;
};

// side_m > 0. ERR_MEMORY.
MUST_CHECK enum status voxel_map_open(struct voxel_map *map, double side_m);
void voxel_map_close(struct voxel_map *map); // what was zeroed, too

// A world point with its standard deviation, seen by capture number `capture` (from 0, rising). Points more than 2^20
// voxels from the origin are left out. ERR_MEMORY: the map is as before.
MUST_CHECK enum status voxel_map_add(struct voxel_map *map, const double world[3], double sigma_m, int capture);

// A point that will be added soon: its voxel is fetched from memory meanwhile.
void voxel_map_expect(const struct voxel_map *map, const double world[3]);

// The voxel that holds a point; NULL: empty.
const struct voxel *voxel_map_at(const struct voxel_map *map, const double world[3]);

void voxel_mean(const struct voxel_map *map, const struct voxel *v, double mean[3]);

// The plane of a voxel's points: unit normal (its sign is free) and standard deviation across it. False: fewer than 6
// points, or not flat (thicker than a third of its second-longest extent).
bool voxel_plane(const struct voxel *v, double normal[3], double *thickness_m);
