// One recorded frame's depth picture, sorted: which pixel shows which part of the
// person, and which shows the room. Pure; the take is only read.
#pragma once
#include "reenact/observation/part_label.h"

enum {
    SIGHT_ROOM = PART_COUNT, // not the person; or no reading at all
    SIGHT_RIM,               // the person's, but half in the air: at an edge, or between two surfaces
};

enum { SIGHT_EDGE_MOST = 100 };
enum { SIGHT_INWARD_PX = 3 }; // how far sight_inside looks
#define SIGHT_RIM_PX 0.6      // the person goes on so far beyond the outermost pixels, which have no reading

struct sight {
    int width, height;
    const struct source_rays *rays;
    const struct body *body;
    uint16_t *depth; // millimetres; where the person keeps the sensor's light off the room, the room's
    uint8_t *part;   // of each pixel: a part, or one of the above
    uint8_t *edge;   // of each pixel: how far the nearest edge between two surfaces is, pixels, at most edge_most
    uint8_t *half;   // of the person's: half of how wide the surface about each is, in the narrower of two directions
    int edge_most;   // how far an edge is looked for: at first SIGHT_EDGE_MOST; whoever needs less sets less
    bool has_mask;
    int left, top, right, bottom; // of the person's pixels; right < left: there are none
};

// rays and take must outlive it. ERR_MEMORY.
MUST_CHECK enum status sight_open(struct sight *out, const struct take *take, const struct source_rays *rays);
void sight_close(struct sight *s);

// Reads frame `frame` and sorts it by its own skeleton. NOTHING: it lacks depth or
// skeleton. ERR_CORRUPT, ERR_IO, ERR_MEMORY.
MUST_CHECK enum status sight_read(struct sight *s, struct take *take, int64_t frame);

// From the room's pixel i to the person's beside it, `step` on, and through what is half in the air: the first pixel
// that shows a part, at most SIGHT_INWARD_PX from i. -1: there is none, or the room is not well behind it.
int sight_inside(const struct sight *s, int i, int step);

// The middle one of the person's readings in and about one of his pixels, without what noise does to one of them;
// millimetres.
int sight_middle_mm(const struct sight *s, int i);

// Which part a person's pixel shows, anew, by better joints (colour camera's axes).
void sight_label(struct sight *s, const struct skeleton *skeleton);

// The frame's colours with nobody else's among them: what lies at an edge or off the
// person takes the colour of the nearest place well within a surface, within a
// pixel of the person's box. Both are RGB of the colour picture, and may be the same.
// Where colour and depth are not the same pixels, a copy. ERR_MEMORY.
MUST_CHECK enum status sight_colors(const struct sight *s, const struct calibration *calibration, const uint8_t *rgb,
                                    uint8_t *out);
