// The place of a recording, as the input of a command.
#pragma once
#include "recording/recording.h"

// Reads the place of the file. NOTHING: it holds none. The caller owns *out: place_free. Errors as recording_open and
// recording_read_place.
MUST_CHECK enum status place_input_read(const char *path, struct place *out);
// The same without its views, as recording_read_map.
MUST_CHECK enum status place_input_read_map(const char *path, struct place *out);
