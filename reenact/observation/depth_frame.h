// One recorded frame's depth image, labelled: which body part each pixel shows, how far it is from the nearest depth
// edge, and how wide the surface about it is. Pixels are labelled by the nearest part's capsule (part_label.h); edges
// and widths come from two-pass distance transforms. Method: our own. Pure and deterministic; the take is only read.
// One depth_frame, one thread.
//
// Memory: 5 bytes a depth pixel, allocated by depth_frame_open.
#pragma once
#include "reenact/observation/part_label.h"
#include "reenact/skeleton/take_skeletons.h"

enum {
    DEPTH_FRAME_BACKGROUND = PART_COUNT, // not the actor, or no depth sample
    DEPTH_FRAME_MIXED, // the actor's, but at an edge: between two surfaces, or farther from every part
};

enum { DEPTH_FRAME_MAX_EDGE_PX = 100 };
enum { DEPTH_FRAME_INWARD_PX = 3 }; // how far depth_frame_step_inside searches
#define DEPTH_FRAME_RIM_PX 0.6      // the silhouette lies so far beyond the outermost labelled pixels

// What the frames of one take are read with. All borrowed.
struct frame_source {
    struct take *take;
    const struct take_skeletons *skeletons;
    const struct source_rays *rays;
};

struct depth_frame {
    int width, height;
    double fx; // of the depth lens, pixels
    const struct source_rays *rays;
    const struct body *body;
    uint16_t *depth;        // millimetres; the background's where the actor blocks the projector
    uint8_t *part;          // of each pixel: a part, or one of the above
    uint8_t *edge_distance; // of each pixel: to the nearest edge between two surfaces, pixels (city block), at most
                            // max_edge_distance
    uint8_t *half_width;    // of each of the actor's pixels: half the width of the surface about it, pixels, along the
                            // narrower of the image's two axes
    int max_edge_distance;  // of the search for edges; DEPTH_FRAME_MAX_EDGE_PX unless the caller sets less
    bool has_mask;
    int left, top, right, bottom; // bounds of the actor's pixels, inclusive; right < left: there are none
};

// rays and take must outlive it. ERR_MEMORY: *out is then zeroed.
MUST_CHECK enum status depth_frame_open(struct depth_frame *out, const struct take *take,
                                        const struct source_rays *rays);
void depth_frame_close(struct depth_frame *s); // zeroed is fine; leaves it zeroed

// Labels a frame. images: its depth (not NULL) and mask (NULL: none), from take_read. joints: its skeleton, inpainted
// (take_skeletons_at), colour camera's axes.
void depth_frame_label(struct depth_frame *s, const struct take_images *images, const struct skeleton *joints);

// take_read and depth_frame_label for a caller that needs one frame of a take. NOTHING: it lacks depth or skeleton.
// ERR_CORRUPT, ERR_IO, ERR_MEMORY. Unless OK, *s is unchanged.
MUST_CHECK enum status depth_frame_read(struct depth_frame *s, struct take *take, int64_t frame);

// From background pixel i to the actor's pixel next to it in direction `step` (an index offset), across mixed pixels:
// the first that shows a part, at most DEPTH_FRAME_INWARD_PX from i. -1: there is none, or the background is not
// clearly behind it.
int depth_frame_step_inside(const struct depth_frame *s, int i, int step);

// Median of the actor's depth samples in the 3 x 3 window about pixel i, which is one of the actor's; millimetres.
int depth_frame_median_mm(const struct depth_frame *s, int i);

// Assigns the actor's pixels to parts again, by better joints (colour camera's axes).
void depth_frame_relabel(struct depth_frame *s, const struct skeleton *skeleton);

// Replaces colours that may be mixed with another surface's: a pixel of the actor's bounds (and one more on each side)
// that is at an edge or not the actor's takes the colour of the nearest pixel well within a surface. rgb and out are
// whole colour images and may be the same. Where depth is not registered to colour, a copy. ERR_MEMORY: *out is then a
// copy.
MUST_CHECK enum status depth_frame_clean_colors(const struct depth_frame *s, const struct calibration *calibration,
                                                const uint8_t *rgb, uint8_t *out);
