// The image behind the controls: the camera's image or a drawn studio, the actor's shadow, the actor, and the overlays
// over it (sources, skeleton).
#pragma once
#include "app/view/take_view.h"
#include "app/ui/widgets.h"

// How an image is placed on the screen: it covers the box, what exceeds it is cut off.
struct cover {
    double scale; // dp per pixel
    double x, y;  // of the image's corner, dp
};
struct cover cover_of(const struct lens *lens, struct ui_box box);

// The point of the floor, z = 0, at a point of the screen, world axes. False: the ray misses the floor, or meets it
// beyond 15 m.
bool cover_floor(const struct take_view_image *image, struct cover cover, struct ui_point at, struct vec3 *floor);

// Bounds of the actor and of the shadow on the screen, within `box`; nothing outside of them needs to be drawn.
struct ui_box compositor_actor_box(const struct take_view_image *image, struct cover cover, struct ui_box box);
struct ui_box compositor_shadow_box(const struct take_view_image *image, struct cover cover, struct ui_box box);

void compositor_draw(const struct brush *b, struct ui_box box, const struct take_view_image *image,
                     const struct view_state *s);
