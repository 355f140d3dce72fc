// Finds a person's 16 joints in one depth image, without memory: a small convolutional network (body.tflite, learnt by
// tools/train_body from images that tests/world renders; docs/notes/body-network.md says how, and what it is worth).
// It looks at a square about the person, in which a child is a small adult. Depth shows a person from the front and
// from behind nearly alike, so that the network is conditioned on the direction of the person's left, where a caller
// that tracks knows it. Run with a direction and with its opposite it gives both hypotheses: the pose, and the same
// with the sides exchanged.
//
// Depth camera's axes (x right, y down, z forward), metres; pixels as in base/lens.h. Deterministic, the same bits on
// every machine. One handle, one thread at a time.
#pragma once
#include "base/lens.h"
#include "recording/skeleton.h"

enum {
    BODY_NETWORK_CELLS = 96, // of the square's side
    BODY_NETWORK_MAP = 24,   // of the maps'
    BODY_NETWORK_PARTS = 18, // none, then tests/world's bones
};

// A square of an image: pixels of its upper left corner and its side (the first pixel reaches from -0.5 to 0.5), and
// the depth about which it is looked at.
struct body_square {
    double left, top, side, middle_m;
};

// Pixels, inclusive.
struct pixel_box {
    int left, top, right, bottom;
};

// depth: of the lens's size, mm, 0 unknown; mask: one byte a pixel. About what a mask shows within a box, which must
// lie within the image: a little larger than its bounds; the depth is the median of what it shows. side 0: nothing.
struct body_square body_square_about(const struct lens *lens, const uint16_t *depth, const uint8_t *mask,
                                     struct pixel_box box);
// The whole image.
static inline struct pixel_box lens_box(const struct lens *lens)
{
    return (struct pixel_box){0, 0, lens->width - 1, lens->height - 1};
}

// The width in metres that the square has at its depth.
double body_square_width_m(const struct body_square *square, const struct lens *lens);

// The cell of the maps that a pixel lies in; false: outside of the square.
bool body_square_cell(const struct body_square *square, struct pixel px, int *cell);

// The pixel in the middle of cell (column, row); false: outside of the image.
bool body_square_pixel(const struct body_square *square, const struct lens *lens, int column, int row, int *pixel);

struct found_body {
    struct vec3 joint[JOINT_COUNT];
    // Standard deviation of each coordinate. It follows from the share p of a joint's heat map that is in its peak, and
    // grows as p^-1.5, as the errors on 40 people did whom the network had not learnt from; its scale is chosen by
    // hand. INFINITY: it was not found, as where it is out of the square.
    double sigma_m[JOINT_COUNT];
    struct vec3 left; // towards the person's left; the longer, the surer, about 1 at most
    double log_odds;  // that the square shows a person
    // Of each cell of the square: the probability that it shows something else than the person.
    float none[BODY_NETWORK_MAP * BODY_NETWORK_MAP];
};

struct body_network;

// The weights are in the program. ERR_MEMORY; ERR_FORMAT: they are not those of this program. *out is then NULL.
MUST_CHECK enum status body_network_open(struct body_network **out);
void body_network_close(struct body_network **network); // NULL is fine

// depth, mask as above; only where the mask is not 0 is looked at, NULL: everywhere. square: its side and depth must be
// above 0. hint: unit vector towards the person's left, zero: not known.
void body_network_find(struct body_network *network, const struct lens *lens, const uint16_t *depth,
                       const uint8_t *mask, const struct body_square *square, struct vec3 hint, struct found_body *out);
