#include "surround/drive/drive_path.h"

#define FINEST_M 0.05 // chosen by hand: of a path of up to 12 m nothing is left out

void drive_path_add(struct drive_path *p, struct vec3 at)
{
    if (!p->count)
        p->spacing_m = FINEST_M;
    else if (!(v3_distance(p->at[p->count - 1], at) >= p->spacing_m)) // NaN, too
        return;
    if (p->count == DRIVE_PATH_POINTS) {
        p->count = DRIVE_PATH_POINTS / 2;
        p->spacing_m *= 2;
        for (int i = 0; i < p->count; i++)
            p->at[i] = p->at[2 * i];
    }
    p->at[p->count++] = at;
}
