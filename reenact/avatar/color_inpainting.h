// Colours for the sides of a person that nobody saw. Pure; deterministic.
#pragma once
#include "reenact/avatar/vertex_color.h"

// Gives every point that is marked as filled a colour, and leaves the others alone. The body's other half lends its own
// where that was seen. Else clothes are taken to be alike all round a part at one height: what was seen of the part
// there, the nearest sides before the farther ones, and without what differs from the others, as a print or a face
// does. Of a part of which nothing was seen at that height, the nearest point of all. surface is in bind_pose; skins:
// of its points. ERR_MEMORY.
MUST_CHECK enum status color_inpaint(struct vertex_colors *vertex_colors, const struct surface_mesh *surface,
                                     const struct skin_weights *skins, const struct bind_pose *bind_pose);
