#include "tests/support/surround_readback.h"

#include "surround/gpu/surround_renderer.h"

#include <stdlib.h>
#include <string.h>

enum status surround_readback(struct surround_renderer *r, struct surround_view *view)
{
    const size_t pixels = (size_t)r->lens.width * (size_t)r->lens.height;
    uint8_t *rgba = malloc(8 * pixels);
    if (!rgba)
        return fail(ERR_MEMORY, "out of memory");
    uint8_t *surface = rgba + 4 * pixels;
    assert(view->lens.width == r->lens.width && view->lens.height == r->lens.height);
    view->world_from_view = r->world_from_view;
    quat_to_matrix(r->world_from_view.rotation, view->axes);
    enum status status = gpu_target_read(r->image, rgba);
    if (status == OK)
        status = gpu_target_read(r->surface, surface);
    for (size_t i = 0; i < pixels && status == OK; i++) {
        memcpy(view->rgb + 3 * i, rgba + 4 * i, 3);
        view->source[i] = rgba[4 * i + 3] ? SOURCE_SEEN : SOURCE_UNSEEN;
        view->inverse_z[i] = surround_inverse_z(surface + 4 * i);
        view->first[i] = (int16_t)(surface[4 * i + 3] - 1);
    }
    free(rgba);
    return status;
}
