// Tags of AprilTag's families other than 36h11, drawn into pictures.
#pragma once
#include "base/status.h"

// Draws the tag of that family (platform/vision/tag_detector.h) with its margin, cells of `cell` pixels, its upper left
// corner at (x, y); gray has `width` bytes a row. Aborts where it does not fit into `height` rows.
void other_tag_draw(int family, int id, uint8_t *gray, int width, int height, int x, int y, int cell);
