// reenact drive's window: stick or arrow keys drive; a finger turns the viewpoint, the wheel brings it nearer; 1, 2, 3
// (pad: X) choose first person, third person and from above. Main thread.
#pragma once
#include "reenact/surround/drive/drive_session.h"

// Runs until the window is closed, or for `seconds` where that is above 0. ERR_DEVICE: no screen.
MUST_CHECK enum status drive_window_run(struct drive_session *session, double seconds);
