// The floor in a take's depth images: which way is up where the take was filmed, without a place.
#pragma once
#include "recording/recording.h"

// *up: unit vector against gravity, colour camera's axes; the mean over five depth images of which most show a floor,
// and the same. NOTHING: they do not, or there is no depth. ERR_IO, ERR_MEMORY.
MUST_CHECK enum status take_floor_up(struct take *take, struct vec3 *up);
