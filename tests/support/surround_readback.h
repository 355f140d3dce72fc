// The image that the surroundings' renderer has drawn, read back whole, to compare it with the processor's.
#pragma once
#include "surround/gpu/surround_renderer.h"

// The last image as surround_view_draw fills it; *view is open and of the image's size. Waits for the graphics card.
// ERR_DEVICE, ERR_MEMORY.
MUST_CHECK enum status surround_readback(struct surround_renderer *r, struct surround_view *view);
