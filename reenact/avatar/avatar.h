// The person as one model, made once for a take: a closed surface in the rest
// pose, its colours, and for every posture how it lies. Made from the depth and
// the colours of the whole take; pure; deterministic.
#pragma once
#include "base/progress.h"
#include "reenact/avatar/articulated_icp.h"
#include "reenact/avatar/texture_atlas.h"

struct likeness {
    struct rest rest;
    struct volume *volume;
    struct surface surface;
    struct skin *skins; // of the surface's points
    struct coat coat;
    struct atlas atlas;              // surface and coat, as they are drawn
    struct bone_errors joint_errors; // how far joints err, as far as frames tell
    int64_t *frames;                 // whose adjustments are known, rising
    struct adjustment *adjustments;
    int frame_count;
};

enum { LIKENESS_FRAMES = 120 }; // more add nothing to the shape

// What is kept of these frames while a likeness is made, so that each is read once: five bytes for each pixel about
// the person. What does not fit is read again for each pass.
#define LIKENESS_SIGHT_BYTES ((size_t)96 << 20)

enum likeness_step {
    LIKENESS_FIRST,          // the shape by the joints alone
    LIKENESS_FIRST_OUTLINES, // how the outlines lie about it
    LIKENESS_LAID,           // frames laid on it, and what they make of it
    LIKENESS_LAID_OUTLINES,  // as above
    LIKENESS_LOOK,           // which frame tells best how the skull is turned
    LIKENESS_FOLLOW,         // colours of what is turned by them learned, from there on
    LIKENESS_TURNS,          // how each frame has it turned, by these
    LIKENESS_SHAPE,          // frames laid so, and what they make of it
    LIKENESS_OUTLINES,       // as above
    LIKENESS_COLORS,         // what each frame says of the colours
    LIKENESS_SURFACE,        // between outlines and colours: the triangles
    LIKENESS_COAT,           // colours and light
    LIKENESS_ATLAS,          // as it is drawn
    LIKENESS_STEPS
};

// Reads at most `max_frames` frames, spread evenly. rays as source_rays_open made
// them for this take; watch may be NULL. NOTHING: the take shows too little of a
// person for it, or it is not wanted. ERR_CORRUPT, ERR_IO, ERR_MEMORY.
MUST_CHECK enum status likeness_make(struct likeness *out, struct take *take, const struct source_rays *rays,
                                     int max_frames, const struct progress_watch *watch);
void likeness_free(struct likeness *f);

// How the joints' posture of `frame` is to be adjusted, by the known frames about it.
struct adjustment likeness_adjustment(const struct likeness *f, int64_t frame);
