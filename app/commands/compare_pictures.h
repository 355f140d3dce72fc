// Pictures of a take's actor for the page of reenact compare: drawn as in the viewer, from a side of the person's own.
#pragma once
#include "compare/report.h"

struct compare_pictures;

// Prepares the take's avatar. `take` NULL: the file's only one. Errors: as recording_open, take_open, gpu_open and
// renderer_open; *out is then NULL. Main thread.
MUST_CHECK enum status compare_pictures_open(struct compare_pictures **out, const char *path, const char *take);
void compare_pictures_close(struct compare_pictures **p); // NULL is fine; sets *p = NULL

// The person `time_s` after the take's first skeleton, seen from azimuth_rad as report_moment says; part: marked, -1:
// none. NOTHING: no person is tracked then; *out is zeroed. ERR_DEVICE, ERR_MEMORY, ERR_CORRUPT, ERR_IO.
MUST_CHECK enum status compare_pictures_draw(struct compare_pictures *p, double time_s, double azimuth_rad, int part,
                                             struct report_picture *out);
