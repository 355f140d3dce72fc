// A rehearsal whose place was filmed and in which known things stand, for tests of what the app shows of a room. Errors
// abort.
#pragma once
#include "tests/support/rehearsal.h"

enum { ROOM_THINGS = 6, ROOM_VIEWS = 10 };
// The first has a picture and a model, the second only text, the fourth is gone, the last has a note alone and no place
// that is known well.

struct rehearsal room_rehearsal_make(void);

// A dumbbell as binary glTF, 0.3 m long; the caller frees *bytes.
void room_model(uint8_t **bytes, size_t *count);
// A photograph of it as PNG, likewise; written through a file of the scratch folder.
void room_photograph(const struct scratch *scratch, uint8_t **bytes, size_t *count);
