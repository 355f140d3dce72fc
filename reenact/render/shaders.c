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
