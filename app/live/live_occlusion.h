// Hides the actor where the sensor sees something nearer: the person's hand before the actor, a table between. The
// picture's pixels there, to be drawn over the actor. Pure.
//
// The actor's depth is that of the limbs' axes; the actor counts as covering COVER_M more than the limbs' radii.
#pragma once
#include "base/lens.h"
#include "recording/skeleton.h"

struct live_occlusion {
    const struct calibration *calibration; // of the sensor
    const uint8_t *rgb;                    // of calibration->color's size
    const uint16_t *depth;                 // of calibration->depth's size
    const struct skeleton *actor;          // colour camera's axes
    const struct body *body;               // the actor's radii
    float *scratch;                        // two numbers a colour pixel
};

// Fills rgba (of the colour image's size, premultiplied): the picture where it is nearer than the actor, else 0.
// Returns how many pixels hide the actor.
int live_occlusion_make(const struct live_occlusion *occlusion, uint8_t *rgba);
