// A screenshot without the controls, of the size of the drawn image.
#pragma once
#include "app/ui/view_compositor.h"

// The next screenshot's path: in `folder`, or (NULL) the user's folder for pictures, named by date and time. Creates
// the folder if it is missing. ERR_IO, ERR_INPUT.
MUST_CHECK enum status screenshot_path(const char *folder, char *path, size_t capacity);

// Draws the image and writes it as a JPEG. Call between two frames of the ui. ERR_DEVICE, ERR_IO, ERR_MEMORY.
MUST_CHECK enum status screenshot_take(const struct brush *b, struct gpu *gpu, const struct take_view_image *image,
                                       const struct view_state *s, const char *path);
