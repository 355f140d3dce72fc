// One recorded frame as a texture of the body's parts ([D14] 4.2, with masks for each part): its colours, and for each
// pixel which parts it may colour. A pixel may colour a part if the mask has it as the actor's and its depth lies at
// that part and not clearly nearer another one; never at the silhouette, where colours mix with the background's.
// Pure; deterministic; the take is only read. Memory: 5 bytes a colour pixel.
#pragma once
#include "reenact/observation/depth_frame.h"

struct source_image {
    int64_t frame; // -1: nothing loaded
    int width, height;
    uint8_t *rgb;    // width * height * 3, as the camera encoded it
    uint16_t *parts; // width * height; bit p: may colour part p
    bool labelled;   // parts is filled
};

// Loads frame `frame` into *image, which is zeroed or was loaded before from the same take (its memory is reused). rays
// NULL: colours only. NOTHING: the frame has no colour; image->frame is -1. ERR_CORRUPT, ERR_IO, ERR_MEMORY: *image is
// freed as by source_image_free.
MUST_CHECK enum status source_image_load(struct source_image *image, struct take *take, int64_t frame,
                                         const struct source_rays *rays);
void source_image_free(struct source_image *image); // leaves it zeroed, frame -1

// A part's texture: the window of the frame around the part, in which every pixel that may not colour it takes the
// colour of the nearest one that may.
struct source_patch {
    int left, top, width, height; // pixels of the frame
    uint8_t *rgb;                 // the caller frees it
};
// NOTHING: too little of the part is visible in this frame. ERR_MEMORY. Unless OK, *out is zeroed.
MUST_CHECK enum status source_patch_make(const struct source_image *image, const struct take *take, enum part p,
                                         struct source_patch *out);
