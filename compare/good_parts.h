// What an attempt does well.
#pragma once
#include "compare/comparison.h"

// The attempt's own parts of which every deviation is within the natural spread (score.h), and of which no finding
// speaks. Both halves of the trunk or neither. 0 where the relation is not RELATION_SAME.
uint16_t good_parts(const struct comparison *comparison);

// They as people say them: "the head, the arms, the left shin". "": there are none.
enum { GOOD_TEXT_BYTES = 200 };
const char *good_text(const struct comparison *comparison, char out[GOOD_TEXT_BYTES]);
