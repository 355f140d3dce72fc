// The small world's empty room, swept for a mapper.
#pragma once
#include "capture/mapper.h"
#include "tests/world/world.h"

struct sweep {
    struct world *world; // the caller closes it
    struct calibration calibration;
    struct mapper_tag tags[32]; // all that hang there
    int32_t tag_count;
};
void sweep_open(struct sweep *s);

// The sweep's way round in `frames` noisy pictures, handed to the mapper.
enum status sweep_film(struct sweep *s, struct mapper *m, int frames, bool with_depth);

// The rigid motion that takes points a to points b best.
struct pose sweep_align(const struct vec3 *a, const struct vec3 *b, int n);
