// A picture of a depth image, for sensors without a colour camera: the person in one light colour, shaded as by a lamp
// above the sensor; all else grey, darker with the distance; black where there is no reading. It depends on the image
// alone. Any thread may call.
#pragma once
#include "base/lens.h"

// The lens is the depth image's; its distortion is ignored. mask NULL: nobody; else one byte a pixel, not 0: the
// person. rgb: 3 bytes a pixel. A third of a megapixel with a person takes twice as long as decoding a JPEG of that
// size.
void depth_picture_draw(const struct lens *lens, const uint16_t *depth, const uint8_t *mask, uint8_t *rgb);

// Frames in a row without a colour image after which a colour camera counts as failed and depth is shown instead: half
// a second. Fewer are images that were lost.
enum { DEPTH_PICTURE_AFTER = 15 };

// The count of them after one more frame; goes no further than DEPTH_PICTURE_AFTER.
static inline int frames_without_color(int before, bool has_color)
{
    return has_color ? 0 : before < DEPTH_PICTURE_AFTER ? before + 1 : before;
}

// True: there is no colour camera but a depth camera, whose pictures are drawn instead; *calibration then says that
// colour has its lens. False: *calibration is unchanged.
bool depth_picture_replaces_color(struct calibration *calibration);
