// Letters and digits as strokes, for posters and shirts. Internal to tests/world.
#pragma once
#include "base/status.h"

// The distance of (x, y) from the strokes of `letter` (A..Z, 0..9; others are blank),
// in a cell 4 wide and 6 high, y up, origin at its lower left. Large where blank.
float glyph_distance(char letter, float x, float y);

// The same for a line of text, cells 5.2 apart.
float text_distance(const char *text, float x, float y);
float text_width(const char *text);
