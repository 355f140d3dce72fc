// Which way is up where a take was filmed, without a place: by the floor in its depth images, else by what the sensor
// said of gravity.
#pragma once
#include "recording/recording.h"

// *up: unit vector against gravity, colour camera's axes; the mean over five depth images of which most show a floor,
// and the same. Without that the mean over all frames of what a telephone knew. NOTHING: neither. ERR_IO, ERR_MEMORY.
MUST_CHECK enum status take_floor_up(struct take *take, struct vec3 *up);
