// What is drawn over the picture at a depth of its own: strokes, hidden by what the picture shows before them; and
// points of which is asked whether they are seen. Both are compared with the depth that the picture itself is composed
// with: the actor's, and the room's where the renderer has it. Threads, errors and memory as in platform/screen/gpu.h.
#pragma once
#include "base/lens.h"
#include "platform/screen/gpu.h"

// A line with round ends; from == to: a disc. Metres.
struct overlay_stroke {
    struct vec3 from, to;
    double width_px; // in the image, at any distance
    double dash_px;  // length of a dash and of the gap after it; 0: solid
    uint32_t color;  // 0xRRGGBBAA, straight alpha
};

// Points that are asked for together: of one thing.
enum { OVERLAY_POINTS = 9, OVERLAY_GROUPS_MAX = 64, OVERLAY_STROKES_MAX = 192 };
struct overlay_group {
    struct vec3 point[OVERLAY_POINTS];
};

// Strokes are drawn in their order, the later over the earlier, whatever their depth. Those beyond
// OVERLAY_STROKES_MAX, and groups beyond OVERLAY_GROUPS_MAX, are left out.
struct overlay {
    const struct overlay_stroke *strokes;
    int stroke_count;
    const struct overlay_group *groups;
    int group_count;
};

struct depth_overlay;
MUST_CHECK enum status depth_overlay_open(struct depth_overlay **out, struct gpu *gpu);
void depth_overlay_close(struct depth_overlay **o); // NULL is fine

struct overlay_picture {
    const struct gpu_texture *actor; // gpu_target_depth of the actor's image
    const struct gpu_texture *room;  // depth of the room, two texels along a pixel's side; NULL: it is in `actor`, or
                                     // there is none
    struct lens lens;                // of that image, at the resolution that is drawn
    double scale;                    // its pixels along one of those that widths count
};
// Draws what `overlay` has, points in the viewer camera's axes. target: for the strokes, of the picture's size,
// cleared; may be NULL without strokes. Where a point is asked for, the answers replace the former ones.
void depth_overlay_draw(struct depth_overlay *depth_overlay, struct gpu_target *target,
                        const struct overlay_picture *picture, const struct overlay *overlay);

// The answers to the last points asked for: of each group the share, of those of its points that the image contains,
// that is seen; 1: it contains none. Waits for the GPU, which is short if something else was done since. *count: of
// groups; 0: none were asked for. ERR_DEVICE.
MUST_CHECK enum status depth_overlay_read(struct depth_overlay *overlay, float share[OVERLAY_GROUPS_MAX], int *count);
