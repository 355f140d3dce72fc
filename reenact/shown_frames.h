// What the frames that are shown saw of the person themselves, as textures: the part of
// each frame's colours and depth where the person is, made when it is first shown and kept
// within a bound; the longest unused goes first. One thread.
#pragma once
#include "platform/gpu.h"
#include "reenact/likeness.h"

struct shown_frames;

// gpu, take and rays must outlive it. max_bytes: of textures; one frame is always kept. ERR_DEVICE, ERR_MEMORY.
MUST_CHECK enum status shown_frames_open(struct shown_frames **out, struct gpu *gpu, struct take *take,
                                         const struct source_rays *rays, size_t max_bytes);
void shown_frames_close(struct shown_frames **f);

enum { SHIFTS_WIDE = 128 };
struct shown_frame {
    bool seen;                     // it has colours and depth; else the textures are of one pixel, of nobody
    struct gpu_texture *color;     // the person's alone: others' colours are replaced by the nearest of theirs
    struct gpu_texture *depth;     // millimetres (red high, green low byte); blue: how deep within one surface of
                                   // the person it lies, 1 well within, 0 at an edge and elsewhere, and all round the rim
    float windows[2][4];           // colours' and depth's: left, top, width, height in the frame's own pixels
    struct adjustment adjustment;  // of the joints' posture
    float (*shift)[3];             // beyond it (warp.h), of each point of the atlas's mesh in the rest pose, metres
    struct gpu_texture *shifts;    // the same: 32767 t + 32768 is a component of WARP_MOST_M * t; its high bytes, and
                                   // SHIFTS_WIDE texels to the right its low bytes
};

// *out: borrowed until the next call. As take_read; ERR_DEVICE.
MUST_CHECK enum status shown_frames_of(struct shown_frames *f, const struct likeness *likeness, int64_t frame,
                                       const struct shown_frame **out);

// For another likeness.
void shown_frames_forget(struct shown_frames *f);
