#include "tests/world/figure.h"
#include <string.h>
enum status figure_build(struct figure *f, const struct physique *p) { memset(f, 0, sizeof *f); f->physique = *p; for (int j = 0; j < JOINT_COUNT; j++) f->joint_radius[j] = 0.06; return OK; }
void figure_free(struct figure *f) { memset(f, 0, sizeof *f); }
