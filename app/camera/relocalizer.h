// A lost camera, found anew on a thread of its own, so that its pictures go on meanwhile: in the picture in
// which it was lost, and then followed through those that came since, until there is no newer one.
//
// The track is lent from relocalizer_begin to relocalizer_finish. One thread calls.
#pragma once
#include "app/camera/present_gap.h"
#include "locate/camera_tracker.h"

struct relocalizer;

// Of pictures of that size. lull: when to begin; NULL: at once. It must outlive the search. ERR_MEMORY
MUST_CHECK enum status relocalizer_open(struct relocalizer **out, int width, int height, struct present_gap *gap);
void relocalizer_close(
    struct relocalizer **s); // NULL is fine; waits for the picture being searched, a part of a second

// A camera_tracker that said of the picture of time_ns that it has to be found anew. color: RGB; copied. finds: in
// so many pictures, at least 1, where it cannot be followed from the one to the next.
void relocalizer_begin(struct relocalizer *s, struct camera_tracker *track, const uint8_t *color, int64_t time_ns,
                       int finds);

// Is the track still lent? With true, the picture, which came meanwhile, will be looked at, too.
bool relocalizer_busy(struct relocalizer *s, const uint8_t *color, int64_t time_ns);

// Once it does not go on: OK, AMBIGUOUS: the camera was found, and followed to the newest picture. NOTHING: it was
// found, and lost again. Errors as camera_tracker_process. *finds: in how many pictures it was found.
MUST_CHECK enum status relocalizer_finish(struct relocalizer *s, int *finds);
