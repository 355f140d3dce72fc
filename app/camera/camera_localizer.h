// The camera's pose, image after image: the app's interface to tracking and relocalisation (locate/camera_tracker.h).
// It survives a camera that is opened again and whose clock restarts.
//
// A camera that was tracked and is lost, or jumps, is relocalised on another thread (camera_localizer.c); meanwhile
// images come without a pose. Where relocalisation was no help, or nothing was tracked before, localizer_locate blocks
// until the image is localised.
//
// One thread calls.
#pragma once
#include "app/camera/present_gap.h"
#include "locate/locator.h"

struct camera_localizer;

// Copies what it needs of place and lens. gap: relocalisation starts in it; NULL: immediately; must outlive the
// localizer. ERR_INPUT, ERR_MEMORY as locator_open; *out is then NULL.
MUST_CHECK enum status localizer_open(struct camera_localizer **out, const struct place *place, const struct lens *lens,
                                      struct present_gap *gap);
void localizer_close(struct camera_localizer **localizer); // NULL is fine; waits for a running relocalisation

// The lens used for the last image; self-calibration may have changed it: camera_tracker_lens.
const struct lens *localizer_lens(const struct camera_localizer *localizer);

// How many tags are not where the place has them, by the last image that was localised. *first: the lowest of their
// numbers, -1 for none. See camera_tracker_moved_tags.
int32_t localizer_moved_tags(const struct camera_localizer *localizer, int32_t *first);

// color: RGB of the lens's size. time_ns: of the exposure, by the camera's clock.
// OK, AMBIGUOUS: *world_from_camera is filled. NOTHING: the pose is not known. Errors as locator_localize; the next
// image may be tried.
MUST_CHECK enum status localizer_locate(struct camera_localizer *l, const uint8_t *color, int64_t time_ns,
                                        struct pose *world_from_camera);
