// Relocalises a lost camera on a thread of its own: in the image in which it was lost, then by tracking through the
// images that arrived since, until there is no newer one.
//
// The camera_tracker is lent from relocalizer_begin until relocalizer_busy returns false. One thread calls.
#pragma once
#include "app/camera/present_gap.h"
#include "locate/camera_tracker.h"

struct relocalizer;

// width, height: of the images. gap: when to start; NULL: immediately; must outlive the relocalizer. ERR_MEMORY: *out
// is NULL. Keeps two images.
MUST_CHECK enum status relocalizer_open(struct relocalizer **out, int width, int height, struct present_gap *gap);
void relocalizer_close(struct relocalizer **r); // NULL is fine; waits for the image in work, a part of a second

// tracker: one that lost the camera in the image of time_ns. color: RGB; copied. finds: in how many images the camera
// may be localised from scratch, at least 1, where it cannot be tracked from one to the next.
void relocalizer_begin(struct relocalizer *r, struct camera_tracker *tracker, const uint8_t *color, int64_t time_ns,
                       int finds);

// Whether it is still running. If so it takes this newer image, too; color: RGB; copied.
bool relocalizer_busy(struct relocalizer *r, const uint8_t *color, int64_t time_ns);

// Once relocalizer_busy has returned false. OK, AMBIGUOUS: the camera was found, and tracked to the newest image.
// NOTHING: it was not found, or lost again. Errors as camera_tracker_process. *finds: in how many images it was
// localised from scratch.
MUST_CHECK enum status relocalizer_finish(struct relocalizer *r, int *finds);
