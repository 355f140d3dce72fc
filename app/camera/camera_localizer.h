// Where the tablet is, picture after picture: the seam between the app and whatever
// locates. It survives a camera that is opened anew and whose clock begins anew.
//
// A camera that was followed and is lost, or jumps, is found anew on a thread of its own: meanwhile
// the pictures go on, and nobody knows where they were taken. Where that leads nowhere, or
// nothing could be followed before, whoever asks waits until the picture's place is found.
#pragma once
#include "app/camera/present_gap.h"
#include "locate/locator.h"

struct camera_localizer;

// Copies what it needs of both. lull: when to begin to look for a lost camera; NULL: at once. It must outlive the
// finder. ERR_INPUT, ERR_MEMORY as locator_open.
MUST_CHECK enum status localizer_open(struct camera_localizer **out, const struct place *place, const struct lens *lens,
                                      struct present_gap *gap);
void localizer_close(struct camera_localizer **f); // NULL is fine

// The lens by which the camera was last looked for, see locator_lens.
const struct lens *localizer_lens(const struct camera_localizer *f);

// How many tags hang elsewhere than the place has them, by the last picture that was looked at; *first: the lowest
// number of them, -1 for none. See locator_moved_tags.
int32_t localizer_moved_tags(const struct camera_localizer *f, int32_t *first);

// color: RGB of the lens's size; time_ns: when it was taken, by the camera's clock.
// OK and AMBIGUOUS: *world_from_camera is filled. NOTHING: it does not know. Errors as locator_localize.
MUST_CHECK enum status localizer_locate(struct camera_localizer *f, const uint8_t *color, int64_t time_ns,
                                        struct pose *world_from_camera);
