// Figures of people drawn from their joints: as bodies beside each other, as limbs over a picture, or as the ghost of a
// pose to come. Verdicts colour the parts: right and wrong are solid, what the sensor cannot tell is thin and dashed,
// so that it differs from right without colour, too.
#pragma once
#include "app/ui/view_compositor.h"
#include "compare/difference.h"

// From where a figure is seen, and where its image is on the screen.
struct figure_view {
    struct lens lens;
    struct pose world_from_camera;
    struct cover cover;
    bool flipped; // left to right, as a mirror shows it
};

enum figure_kind {
    FIGURE_BODY,  // filled, on an empty ground
    FIGURE_LIMBS, // lines over a picture
    FIGURE_GHOST, // translucent
};
struct figure {
    enum figure_kind kind;
    const struct skeleton *skeleton; // world axes
    const enum verdict *verdicts;    // [PART_COUNT]; NULL: not judged
    bool dimmed;                     // a body that is only there to be compared with
    int marked;                      // 1 more than the part that stands out, of a body; 0: none
};
// FIGURE_LIMBS or FIGURE_GHOST as strokes in world axes, for a picture that hides them by depth. Their widths count
// pixels of view->lens's image. Returns how many; at most FIGURE_STROKES_MAX.
enum { FIGURE_STROKES_MAX = 2 * PART_COUNT + JOINT_COUNT };
int figure_strokes(const struct theme *theme, const struct figure_view *view, const struct figure *figure,
                   struct overlay_stroke out[FIGURE_STROKES_MAX]);

void figure_draw(const struct brush *brush, const struct figure_view *view, const struct figure *figure);

// Where a point of the world is on the screen. False: behind the camera, or far outside.
bool figure_point(const struct figure_view *view, struct vec3 world, struct ui_point *out);

// Where the view's whole image is on the screen.
struct ui_box figure_image_box(const struct figure_view *view);

uint32_t verdict_color(const struct theme *theme, enum verdict verdict);
// A line as the figures draw it: solid, or dashed for what the sensor cannot tell.
void verdict_line(const struct brush *brush, struct ui_point from, struct ui_point to, double width,
                  enum verdict verdict);
