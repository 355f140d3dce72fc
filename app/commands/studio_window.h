// The studio in a window: its event loop, for all programs that film.
#pragma once
#include "app/studio/studio.h"
#include "platform/screen/window.h"

// Films until the user leaves, the program is to stop, or until_ns (0: never). Of the options refresh_hz, wake and
// wake_self are filled in here. ERR_DEVICE, ERR_MEMORY.
MUST_CHECK enum status studio_window_run(struct window *window, struct gpu *gpu, const struct studio_options *options,
                                         int64_t until_ns);
