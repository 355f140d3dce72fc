// Decoding of the depth images that earlier versions wrote (methods 1 and 2 of docs/format.md). Internal to the depth
// codec.
#pragma once
#include "recording/depth_pixels.h"

enum { DEPTH_EARLIER_CONTEXTS = 73 };

// The head has been read into c->rans and c->depth_of; the code's first part are the uncoded bits. states: 1 or 2.
// NOTHING: the code is damaged. ERR_MEMORY.
MUST_CHECK enum status depth_decode_earlier(struct depth_coder *c, int states, const struct depth_code *code,
                                            const struct depth_layout *l, uint16_t *depth);
