// The inner corners of a chequers board in a grey image (OpenCV, findChessboardCornersSB: Duda & Frese, "Accurate
// detection and localization of checkerboard corners for calibration", BMVC 2018). Any thread may call.
#pragma once
#include "base/lens.h"

#ifdef __cplusplus
extern "C" {
#endif

// gray: width * height bytes. OK: the whole board is in sight; out[row * columns + column], rows clockwise of columns
// in the image, the origin at either of two opposite corners. NOTHING: it is not. ERR_MEMORY, ERR_SOLVER.
MUST_CHECK enum status chequers_find(const uint8_t *gray, int width, int height, int columns, int rows,
                                     struct pixel *out);

#ifdef __cplusplus
}
#endif
