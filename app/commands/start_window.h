// The start screen in a window: its event loop.
#pragma once
#include "app/start/start.h"
#include "platform/screen/window.h"

// Until the user chose, leaves, the program is to stop, or until_ns (0: never): then out->wish is START_WISHES_LEAVE.
// ERR_DEVICE, ERR_MEMORY.
MUST_CHECK enum status start_window_run(struct window *window, struct gpu *gpu, const struct start_options *options,
                                        int64_t until_ns, struct start_choice *out);
