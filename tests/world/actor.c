#include "tests/world/actor.h"
enum status actor_open(struct actor **out, const struct world *w, double time_s, bool lit) { (void)w; (void)time_s; (void)lit; *out = NULL; return OK; }
void actor_close(struct actor **a) { *a = NULL; }
enum status actor_aim(struct actor *a, const struct lens *lens, struct pose world_from_camera, bool fine) { (void)a;(void)lens;(void)world_from_camera;(void)fine; return OK; }
void actor_draw_rows(struct actor *a, int first, int end) { (void)a;(void)first;(void)end; }
void actor_bounds(const struct actor *a, int *x0, int *y0, int *x1, int *y1) { (void)a; *x0=*y0=*x1=*y1=0; }
double actor_depth(const struct actor *a, int x, int y) { (void)a;(void)x;(void)y; return 0; }
int actor_cover(const struct actor *a, int x, int y, double *near, double *far) { (void)a;(void)x;(void)y; *near=*far=0; return 0; }
void actor_color(const struct actor *a, int x, int y, const double *room_z, float color[3], int *count) { (void)a;(void)x;(void)y;(void)room_z;(void)color; *count=0; }
bool actor_shades(const struct actor *a, int surface, double u, double v) { (void)a;(void)surface;(void)u;(void)v; return false; }
void actor_shadow(const struct actor *a, int surface, struct vec3 at, struct vec3 normal, float out[3], float *ambient) { (void)a;(void)surface;(void)at;(void)normal;(void)out;*ambient=1; }
