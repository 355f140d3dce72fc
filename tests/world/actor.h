// The figure at one instant, ready to be rendered: its posed skin, the light on it, the shadow it casts, and what each
// sample of an image sees of it. Internal to tests/world.
#pragma once
#include "tests/world/world_internal.h"

struct actor;

// Samples per pixel side in the colour image.
enum { ACTOR_LOG2_SIDE = 2, ACTOR_SIDE = 1 << ACTOR_LOG2_SIDE, ACTOR_SAMPLES = ACTOR_SIDE * ACTOR_SIDE };

// Poses and, when `lit`, lights the figure. ERR_MEMORY.
MUST_CHECK enum status actor_open(struct actor **out, const struct world *w, double time_s, bool lit);
void actor_close(struct actor **a); // NULL is fine

// Prepares for one camera. `fine`: with ACTOR_SAMPLES samples a pixel beside the one at its centre. ERR_MEMORY.
MUST_CHECK enum status actor_aim(struct actor *a, const struct lens *lens, struct pose world_from_camera, bool fine);

// Renders the rows [first, end), which only this call touches.
void actor_draw_rows(struct actor *a, int first, int end);

// Depth z of the figure at the centre of a pixel, metres; 0: nothing.
double actor_depth(const struct actor *a, int x, int y);

// How many of the pixel's samples see the figure, and the nearest and farthest z among them.
int actor_cover(const struct actor *a, int x, int y, double *z_near, double *z_far);

// The figure's radiance towards the camera, the mean over its samples whose z is less than room_z[sample]; *count: how
// many those are. room_z NULL: all of them.
void actor_color(const struct actor *a, int x, int y, const double *room_z, float color[3], int *count);

// Whether the figure may darken a point of a room's surface, known to within `around` metres; and by how much: `lost`
// of irradiance / pi, and a share (1 - ambient) of what remains.
bool actor_shades(const struct actor *a, int surface, double u, double v, double around);
void actor_shadow(const struct actor *a, struct vec3 at, struct vec3 normal, float lost[3], float *ambient);
