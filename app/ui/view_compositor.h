// The picture behind the controls: the camera's or a studio's, the actor, and what
// may be laid over him.
#pragma once
#include "app/view/take_view.h"
#include "app/ui/widgets.h"

// How a camera's picture lies on the screen: it fills the box, what is too much is cut off.
struct cover {
    double scale; // dp a pixel
    double x, y;  // of the picture's corner, dp
};
struct cover cover_of(const struct lens *lens, struct ui_box box);

// The point of the floor, z = 0, under a place of the screen. False: it looks past the floor or too far.
bool cover_floor(const struct take_view_image *image, struct cover cover, struct ui_point at, struct vec3 *floor);

// Where on the screen the actor and where his shadow may be, at most; what lies beyond need not be drawn. No more than
// `box`.
struct ui_box compositor_actor_box(const struct take_view_image *image, struct cover cover, struct ui_box box);
struct ui_box compositor_shadow_box(const struct take_view_image *image, struct cover cover, struct ui_box box);

void compositor_draw(const struct brush *b, struct ui_box box, const struct take_view_image *image,
                     const struct view_state *show);
