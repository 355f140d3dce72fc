// A photograph of what is seen, without the controls, as large as the camera's picture.
#pragma once
#include "app/ui/view_compositor.h"

// Where the next one goes: `folder`, or the user's own for pictures; named by date
// and time. The folder is made if need be. ERR_IO, ERR_INPUT.
MUST_CHECK enum status screenshot_path(const char *folder, char *path, size_t capacity);

// Draws the scene and writes it as a JPEG. Between two frames of the ui. ERR_DEVICE, ERR_IO, ERR_MEMORY.
MUST_CHECK enum status screenshot_take(const struct brush *b, struct gpu *gpu, const struct take_view_image *image,
                                       const struct view_state *show, const char *path);
