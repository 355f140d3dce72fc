// One recorded frame's depth picture, sorted: which pixel shows which part of the
// person, and which shows the room. Pure; the take is only read.
#pragma once
#include "reenact/observation/part_label.h"

enum {
    DEPTH_FRAME_BACKGROUND = PART_COUNT, // not the person; or no reading at all
    DEPTH_FRAME_MIXED,                   // the person's, but half in the air: at an edge, or between two surfaces
};

enum { DEPTH_FRAME_MAX_EDGE_PX = 100 };
enum { DEPTH_FRAME_INWARD_PX = 3 }; // how far depth_frame_step_inside looks
#define DEPTH_FRAME_RIM_PX 0.6      // the person goes on so far beyond the outermost pixels, which have no reading

struct depth_frame {
    int width, height;
    const struct source_rays *rays;
    const struct body *body;
    uint16_t *depth;        // millimetres; where the person keeps the sensor's light off the room, the room's
    uint8_t *part;          // of each pixel: a part, or one of the above
    uint8_t *edge_distance; // of each pixel: how far the nearest edge between two surfaces is, pixels, at most
                            // max_edge_distance
    uint8_t
        *half_width; // of the person's: half of how wide the surface about each is, in the narrower of two directions
    int max_edge_distance; // how far an edge is looked for: at first DEPTH_FRAME_MAX_EDGE_PX; whoever needs less sets
                           // less
    bool has_mask;
    int left, top, right, bottom; // of the person's pixels; right < left: there are none
};

// rays and take must outlive it. ERR_MEMORY.
MUST_CHECK enum status depth_frame_open(struct depth_frame *out, const struct take *take,
                                        const struct source_rays *rays);
void depth_frame_close(struct depth_frame *s);

// Reads frame `frame` and sorts it by its own skeleton. NOTHING: it lacks depth or
// skeleton. ERR_CORRUPT, ERR_IO, ERR_MEMORY.
MUST_CHECK enum status depth_frame_read(struct depth_frame *s, struct take *take, int64_t frame);

// From the room's pixel i to the person's beside it, `step` on, and through what is half in the air: the first pixel
// that shows a part, at most DEPTH_FRAME_INWARD_PX from i. -1: there is none, or the room is not well behind it.
int depth_frame_step_inside(const struct depth_frame *s, int i, int step);

// The middle one of the person's readings in and about one of his pixels, without what noise does to one of them;
// millimetres.
int depth_frame_median_mm(const struct depth_frame *s, int i);

// Which part a person's pixel shows, anew, by better joints (colour camera's axes).
void depth_frame_relabel(struct depth_frame *s, const struct skeleton *skeleton);

// The frame's colours with nobody else's among them: what lies at an edge or off the
// person takes the colour of the nearest place well within a surface, within a
// pixel of the person's box. Both are RGB of the colour picture, and may be the same.
// Where colour and depth are not the same pixels, a copy. ERR_MEMORY.
MUST_CHECK enum status depth_frame_clean_colors(const struct depth_frame *s, const struct calibration *calibration,
                                                const uint8_t *rgb, uint8_t *out);
