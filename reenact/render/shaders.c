// Shader texts by name; what several programs share.
#include "reenact/render/shaders.h"

#include <string.h>

const char *shader_find(const char *name)
{
    for (int i = 0; i < shader_text_count; i++)
        if (!strcmp(shader_texts[i].name, name))
            return shader_texts[i].text;
    assert(!"no such shader");
    return NULL;
}

void lens_uniform(const struct lens *lens, float out[12])
{
    const double values[12] = {lens->fx,    lens->fy,    lens->cx, lens->cy, lens->k1,
                               lens->k2,    lens->p1,    lens->p2, lens->k3, lens_max_radius2(lens),
                               lens->width, lens->height};
    for (int i = 0; i < 12; i++)
        out[i] = (float)values[i];
}

enum status fullscreen_mesh_open(struct gpu_mesh **out, struct gpu *gpu)
{
    static const float corners[] = {-1, -1, 3, -1, -1, 3};
    static const uint16_t order[] = {0, 1, 2};
    return gpu_mesh_open(out, gpu, &(struct gpu_mesh_data){corners, 2, 3, order, 3});
}
