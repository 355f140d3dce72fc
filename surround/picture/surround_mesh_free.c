// Freeing a mesh, apart from making it, which stands on pictures.
#include "surround/picture/surround_mesh.h"

#include <stdlib.h>

void surround_mesh_free(struct surround_mesh *m)
{
    for (int i = 0; i < m->count; i++) {
        free(m->pieces[i].vertices);
        free(m->pieces[i].indices);
    }
    free(m->pieces);
    *m = (struct surround_mesh){0};
}

void surround_picture_free_mesh(struct surround_picture *p)
{
    if (p->mesh)
        surround_mesh_free(p->mesh);
    free(p->mesh);
    p->mesh = NULL;
}
