// What one recorded frame adds to the likeness while it is the frame that is shown: the
// person's own colours and depth in it, and how the likeness is laid on it and bent.
// It depends on the take and the likeness alone, not on who looks from where, so that it
// can be made before it is wanted, on any thread; frame_layer_cache.h brings it to the GPU.
// Pure; deterministic. One loader, one thread; loaders with a take handle each may share
// a likeness.
#pragma once
#include "reenact/avatar/avatar.h"

// What the frame knows of a point of the atlas's mesh.
struct loaded_point {
    float in_color[2]; // where it saw it: in its colours, of their size
    float in_depth[2]; // likewise
    float away_m;      // in depth, if nothing is before it
    float seen;        // how squarely: 1 straight on, 0 aside, away, or not at all
    float facing[3];   // its normal, colour camera's axes
    float light;       // root of the room's light on it, as bright as the frame has it
};

struct loaded_picture {
    uint8_t *pixels; // rows without padding
    int width, height;
};

struct loaded_frame {
    int64_t frame;
    bool seen;                    // it has colours and depth; else these are of few pixels, of nobody
    struct loaded_picture color;  // RGB, the person's alone: others' colours are replaced by the nearest of theirs
    struct loaded_picture depth;  // RGBA: millimetres (red high, green low byte); blue: how deep within one surface of
                                  // the person it lies, 1 well within, 0 at an edge and elsewhere, and along the rim
    float windows[2][4];          // colours' and depth's: left, top, width, height in the frame's own pixels
    float brighter;               // than the take's frames are in the mean, of colours' roots (exposure.h)
    struct adjustment adjustment; // of the joints' posture
    float (*shift)[3]; // beyond it (deformation.h), of each point of the atlas's mesh in the rest pose, metres
    struct loaded_point *points; // of each; NULL, as shift: the frame's posture is not known
    int point_count, triangle_count;
    bool *own; // of each of its triangles: whether it may have colours of the frame's own
               // (triangle_visibility.h); NULL, as points
};
void loaded_frame_free(struct loaded_frame *f);          // zeroed is fine
size_t loaded_frame_bytes(const struct loaded_frame *f); // pictures as textures, four a pixel

struct frame_loader;

// All are borrowed and must outlive it; nobody else may read the take's pictures meanwhile. ERR_MEMORY.
MUST_CHECK enum status frame_loader_open(struct frame_loader **out, struct take *take, const struct source_rays *rays,
                                         const struct likeness *likeness);
void frame_loader_close(struct frame_loader **l); // NULL is fine

// On OK *out is the caller's: loaded_frame_free. As take_read.
MUST_CHECK enum status frame_loader_load(struct frame_loader *l, int64_t frame, struct loaded_frame *out);
