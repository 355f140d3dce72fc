// What one recorded frame itself shows of the person: the surface its depth
// measured, cut into body parts, with that frame's own colours, and a picture
// that says where nobody is. The side of the body that the sensor sees at the
// shown instant needs no model. Pure; deterministic; the take is only read.
#pragma once
#include "reenact/cylinders.h"
#include "reenact/source_picture.h"

struct seen {
    int64_t frame;                            // -1: nothing loaded
    struct cylinder_mesh surface[PART_COUNT]; // metres, colour camera's axes; counter-clockwise seen from the sensor
    uint8_t *depth;                           // RGBA of the depth picture's size: millimetres (high, low byte), then
                                              // 255 person, 128 a gap within the person, 0 neither; 255
    struct source_picture picture;            // rgb: about the person its own colours go on outwards
};

// Loads frame `frame` into *seen, which is zeroed or was loaded before from the
// same take. NOTHING: the frame lacks depth, colour or skeleton.
// ERR_CORRUPT, ERR_IO, ERR_MEMORY; then as zeroed.
MUST_CHECK enum status seen_load(struct seen *seen, struct take *take, int64_t frame, const struct source_rays *rays);
void seen_free(struct seen *seen); // leaves it zeroed, frame -1
