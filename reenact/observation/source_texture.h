// One recorded frame made ready to be a texture: its colours, and for each pixel
// which body parts it may colour. A pixel speaks for a part when the frame's
// mask says it is the person and its depth lies at that part and not clearly
// nearer another one; never at the very edge of the person, where colours mix
// with the background's. Pure; the take is only read.
#pragma once
#include "reenact/observation/part_label.h"

struct source_image {
    int64_t frame; // -1: nothing loaded
    int width, height;
    uint8_t *rgb;    // width * height * 3
    uint16_t *parts; // width * height; bit p: may colour part p
    bool labelled;   // parts was asked for and is filled
};

// Loads frame `frame` into *image, which is zeroed or was loaded before from
// the same take (its memory is used again). rays NULL: colours only.
// NOTHING: the frame has no colour. ERR_CORRUPT, ERR_IO, ERR_MEMORY; then as zeroed.
MUST_CHECK enum status source_image_load(struct source_image *image, struct take *take, int64_t frame,
                                         const struct source_rays *rays);
void source_image_free(struct source_image *image); // leaves it zeroed, frame -1

// A part's own texture: the window of the frame around the part, in which every
// pixel that may not colour it takes the colour of the nearest one that may.
struct source_patch {
    int left, top, width, height; // pixels of the frame
    uint8_t *rgb;                 // the caller frees it
};
// NOTHING: too little of the part is to be seen in this frame. ERR_MEMORY.
MUST_CHECK enum status source_patch_make(const struct source_image *image, const struct take *take, enum part p,
                                         struct source_patch *out);
