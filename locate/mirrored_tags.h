// Whether a picture shows tags in a mirror: none is found in it, since no tag's mirror image is another tag, and they
// are found in the picture turned over. What has no tag may be mirrored without anything to tell it.
#pragma once
#include "base/lens.h"

struct mirrored_tags;

// For pictures of that size. ids: of the tags that count, copied; NULL: all tags do. ERR_MEMORY.
MUST_CHECK enum status mirrored_tags_open(struct mirrored_tags **out, const struct lens *lens, const int32_t *ids,
                                          int count);
void mirrored_tags_close(struct mirrored_tags **m); // NULL is fine; sets *m = NULL

// *shown: how many of the tags the picture shows in a mirror. 15 ms at 640 x 480. ERR_MEMORY.
MUST_CHECK enum status mirrored_tags_look(struct mirrored_tags *m, const uint8_t *gray, int *shown);

// The same of the picture as it is.
MUST_CHECK enum status mirrored_tags_look_straight(struct mirrored_tags *m, const uint8_t *gray, int *shown);
