// Reads folders with a place, images and their truth for the benches (TUM layout: place/, sensor/, viewer/, tags.json,
// truth/).
#pragma once
#include "base/geometry.h"
#include "recording/place.h"

#include <stdio.h>

// Maps the place from place/ and tags.json of `data`. The caller frees it: place_free.
MUST_CHECK enum status bench_map_folder(const char *data, struct place *out);

// Opens truth/NAME of `data`; the caller closes it. ERR_MISSING.
MUST_CHECK enum status bench_open_truth(const char *data, const char *name, FILE **out);

// The pose of a trajectory at that time. False: none.
bool bench_truth_at(FILE *trajectory, double seconds, struct pose *out);
