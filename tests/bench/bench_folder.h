// A folder with a place, pictures and their truth, as benches read it (TUM layout: place/, sensor/, viewer/,
// tags.json, truth/).
#pragma once
#include "capture/recording/place.h"
#include "base/geometry.h"

#include <stdio.h>

// The place that place/ and tags.json of `data` come to. The caller frees it: place_free.
MUST_CHECK enum status bench_map_folder(const char *data, struct place *out);

// truth/NAME of `data`, to be closed by the caller. ERR_MISSING.
MUST_CHECK enum status bench_open_truth(const char *data, const char *name, FILE **out);

// The line of a trajectory at that time. False: none.
bool bench_truth_at(FILE *trajectory, double seconds, struct pose *out);
