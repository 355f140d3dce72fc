// The image behind the controls: the camera's image or a drawn studio, the actor's shadow, the actor, and the overlays
// over it (sources, skeleton).
#pragma once
#include "app/ui/widgets.h"
#include "app/view/take_view.h"

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

void compositor_draw(const struct brush *brush, struct ui_box box, const struct take_view_image *image,
                     const struct view_state *state);

// ---------------------------------------------------------------- screenshot

// A screenshot without the controls, of the size of the drawn image.

// The next screenshot's path: in `folder`, or (NULL) the user's folder for pictures, named by date and time. Creates
// the folder if it is missing. ERR_IO, ERR_INPUT.
MUST_CHECK enum status screenshot_path(const char *folder, char *path, size_t capacity);

// Draws the image and writes it as a JPEG. Call between two frames of the ui. ERR_DEVICE, ERR_IO, ERR_MEMORY.
MUST_CHECK enum status screenshot_take(const struct brush *b, struct gpu *gpu, const struct take_view_image *image,
                                       const struct view_state *s, const char *path);
