// Inpainting of vertex colours: colours for the surface that no frame showed. The surface is in the bind pose. A point
// takes, in this order, the first that there is:
// 1. the mirrored point's colour, if the body's other half was seen there (and this half was not seen nearer by);
// 2. clothes are assumed to look alike all round a bone at one height: a robust mean of what was seen of the bone at
//    this height, nearer sides with more weight, and without outliers such as prints or the face;
// 3. the colour of the nearest point that was seen.
// Deterministic; the result does not depend on the number of threads.
#pragma once
#include "reenact/avatar/vertex_color.h"

// Sets color and time_s of every point that is marked as filled, and leaves all others alone; without any point that
// was seen it changes nothing. Starts up to `threads` threads and ends them. ERR_MEMORY; nothing is changed then.
MUST_CHECK enum status color_inpaint(struct vertex_colors *vertex_colors, const struct vertex_color_target *target,
                                     int threads);
