// The person as one model, made once for a take: a closed surface in the bind_pose
// pose, its colours, and for every transforms how it lies. Made from the depth and
// the colours of the whole take; pure; deterministic.
#pragma once
#include "base/progress.h"
#include "reenact/avatar/articulated_icp.h"
#include "reenact/avatar/texture_atlas.h"

struct avatar {
    struct bind_pose bind_pose;
    struct tsdf *tsdf;
    struct surface_mesh surface;
    struct skin_weights *skins; // of the surface's points
    struct vertex_colors vertex_colors;
    struct texture_atlas atlas;      // surface and vertex_colors, as they are drawn
    struct joint_noise joint_errors; // how far joints err, as far as frames tell
    int64_t *frames;                 // whose frame_corrections are known, rising
    struct bone_corrections *frame_corrections;
    int frame_count;
};

enum { AVATAR_FRAMES = 120 }; // more add nothing to the shape

// What is kept of these frames while a avatar is made, so that each is read once: five bytes for each pixel about
// the person. What does not fit is read again for each pass.
#define AVATAR_CACHE_BYTES ((size_t)96 << 20)

enum avatar_step {
    AVATAR_TSDF_FROM_JOINTS,        // the shape by the joints alone
    AVATAR_SILHOUETTES_FROM_JOINTS, // how the outlines lie about it
    AVATAR_TSDF_ALIGNED,            // frames laid on it, and what they make of it
    AVATAR_SILHOUETTES_ALIGNED,     // as above
    AVATAR_ROTATION_SEED,           // which frame tells best how the skull is turned
    AVATAR_ROTATION_TRACK,          // colours of what is turned by them learned, from there on
    AVATAR_ROTATION_MEASURE,        // how each frame has it turned, by these
    AVATAR_TSDF_FINAL,              // frames laid so, and what they make of it
    AVATAR_SILHOUETTES_FINAL,       // as above
    AVATAR_COLOR_SAMPLES,           // what each frame says of the colours
    AVATAR_SURFACE,                 // between outlines and colours: the triangles
    AVATAR_VERTEX_COLORS,           // colours and light
    AVATAR_ATLAS,                   // as it is drawn
    AVATAR_STEPS
};

// Reads at most `max_frames` frames, spread evenly. rays as source_rays_open made
// them for this take; watch may be NULL. NOTHING: the take shows too little of a
// person for it, or it is not wanted. ERR_CORRUPT, ERR_IO, ERR_MEMORY.
MUST_CHECK enum status avatar_make(struct avatar *out, struct take *take, const struct source_rays *rays,
                                   int max_frames, const struct progress_watch *watch);
void avatar_free(struct avatar *f);

// How the joints' transforms of `frame` is to be adjusted, by the known frames about it.
struct bone_corrections avatar_corrections(const struct avatar *f, int64_t frame);
