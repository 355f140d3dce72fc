// What a comparison says nothing of, because its joints are not there.
#pragma once
#include "compare/comparison.h"

// "could not be judged: the knees are not in the attempt; the head is hardly ever in the reference". "": all parts
// were.
enum { NOT_JUDGED_BYTES = 600 };
const char *not_judged_text(const struct comparison *c, char out[NOT_JUDGED_BYTES]);
