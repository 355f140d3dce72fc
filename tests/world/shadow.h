// Shadows of the figure: depth maps seen from points on the lamps give its soft shadow, on itself and on the room;
// spheres on its joints give the ambient shadow around its feet. Internal to tests/world.
#pragma once
#include "tests/world/figure.h"
#include "tests/world/scene.h"

struct shadow;

// Keeps `scene` and `joints`. ERR_MEMORY.
MUST_CHECK enum status shadow_open(struct shadow **out, const struct world_scene *scene, const struct mesh *mesh,
                                   const struct vec3 *at, const struct skeleton *joints, int threads);
void shadow_close(struct shadow **s); // NULL is fine

// The lamps' irradiance / pi on the figure's own skin.
void shadow_light(const struct shadow *s, struct vec3 at, struct vec3f normal, float out[3]);

// Whether a point of a surface may lie in shadow; and how much light it loses: see actor.h.
bool shadow_reaches(const struct shadow *s, int surface, double u, double v, double around);
void shadow_on(const struct shadow *s, struct vec3 at, struct vec3 normal, float lost[3], float *ambient);
