// The bitmap of a tag36h11. Internal to tests/world; wraps libapriltag.
#pragma once
#include "base/status.h"

// Cells of the tag with its white margin, top row first, true = white. The black
// square, whose outer edge is the tag's side, is the inner 8 x 8. ERR_MEMORY, ERR_INPUT: no such number.
enum { TAG_CELLS = 10 };
MUST_CHECK enum status tag_bitmap(int id, bool white[TAG_CELLS][TAG_CELLS]);
