// A thing as a body on the GPU: its model where the recording keeps one, else a box of its size with its picture on the
// front. The GPU's thread.
#pragma once
#include "app/place/place_things.h"
#include "reenact/render/solid_renderer.h"

struct thing_solid {
    struct solid_mesh *parts[GLB_MOST_PARTS];
    struct gpu_texture *pictures[GLB_MOST_PARTS]; // NULL: none
    bool two_sided[GLB_MOST_PARTS];
    int count;
    bool is_model;
    struct vec3 low, high; // bounds in the thing's axes, metres
};

// ERR_DEVICE, ERR_MEMORY. On error *out is zeroed.
MUST_CHECK enum status thing_solid_open(struct thing_solid *out, struct gpu *gpu, const struct place_thing *thing);
void thing_solid_close(struct thing_solid *s); // zeroed is fine

void thing_solid_draw(const struct thing_solid *s, struct solid_renderer *r, const struct solid_view *view,
                      struct pose world_from_thing);

// Alone, turned by `angle` about its vertical axis, in the middle of the target, which is cleared.
void thing_solid_draw_turning(const struct thing_solid *s, struct solid_renderer *r, struct gpu_target *target,
                              double angle);
