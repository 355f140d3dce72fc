// The avatar: the actor of one take as one model, fused from the depth and colours of the whole take: a closed surface
// in the bind pose with skin weights, vertex colours and a texture, and for each used frame the corrections of its
// joints. The pipeline, which passes over the frames several times (enum avatar_step):
//   three rounds of TSDF fusion (tsdf.h) and of matching the silhouettes (deformation.h), frames placed by
//   their joints at first, then registered (articulated_icp.h), then registered with axial rotations from colours
//   (axial_rotation.h);
//   then vertex colours (vertex_color.h), each frame deformed to fit (deformation.h), and the atlas (texture_atlas.h).
//
// avatar_make reads the take, so nothing else may read that take meanwhile, and starts threads, which have ended when
// it returns. The same take and max_frames give the same bytes, on any number of threads.
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
    struct texture_atlas atlas;                 // surface and vertex_colors as they are drawn
    struct joint_noise joint_errors;            // of this take's joints, measured by registration
    int64_t *frames;                            // the used frames, increasing
    struct bone_corrections *frame_corrections; // of each used frame
    int frame_count;
};

enum { AVATAR_FRAMES = 120 }; // default; more frames add nothing to the shape

// Bytes of decoded depth frames that are kept while an avatar is made, so that each is decoded once: five for each
// pixel about the person. What does not fit is read again in each pass.
#define AVATAR_CACHE_BYTES ((size_t)96 << 20)

enum avatar_step {
    AVATAR_TSDF_FROM_JOINTS,        // fuse, frames placed by their joints
    AVATAR_SILHOUETTES_FROM_JOINTS, // measure the silhouettes against that shape
    AVATAR_TSDF_ALIGNED,            // register frames to it, and fuse
    AVATAR_SILHOUETTES_ALIGNED,     // as above
    AVATAR_ROTATION_SEED,           // axial rotations: choose the seed frame
    AVATAR_ROTATION_TRACK,          // learn colours from the seed on
    AVATAR_ROTATION_MEASURE,        // measure each frame against these
    AVATAR_TSDF_FINAL,              // register frames with these rotations, and fuse
    AVATAR_SILHOUETTES_FINAL,       // as above
    AVATAR_COLOR_SAMPLES,           // each frame's colour samples
    AVATAR_SURFACE,                 // between silhouettes and colour samples: extract the surface
    AVATAR_VERTEX_COLORS,           // albedo and irradiance
    AVATAR_ATLAS,                   // simplify, unwrap, bake
    AVATAR_STEPS
};

struct avatar_options {
    int max_frames; // at most so many frames are used. Default AVATAR_FRAMES
    bool simple;    // only the first round, whose frames are placed by their joints, on its coarse grid, and colours
                    // without deformation: a whole body in a fiftieth of the time. Default no
    int threads;    // of the pass over the frames; inner loops use half as many, at least 1. At least 1. Default 4
    const struct progress_watch *watch; // steps: enum avatar_step. Default NULL
};
struct avatar_options avatar_default_options(void);

// rays: from source_rays_open for this take. NOTHING: the take shows too little of a person, or the watch said that the
// avatar is not wanted. ERR_INPUT: the joints lie too far apart to be one person's (tsdf_open), or the surface is too
// large for the atlas (texture_atlas_make). ERR_CORRUPT, ERR_IO, ERR_MEMORY. *out is empty unless OK; else the caller
// frees it with avatar_free.
MUST_CHECK enum status avatar_make(struct avatar *out, struct take *take, const struct source_rays *rays,
                                   const struct avatar_options *options);
void avatar_free(struct avatar *avatar);

// The corrections of any frame's joints, interpolated between the used frames around it. The avatar has at least one.
struct bone_corrections avatar_corrections(const struct avatar *avatar, int64_t frame);

// ---------------------------------------------------------------- avatar store

// Keeps an avatar in the recording (recording/prepared.h), so that a take that was prepared once opens
// immediately. What is read back is the avatar that was written, bit for bit, but for the scratch memory of fusion: its
// TSDF can be sampled and no longer be fused into. AVATAR_VERSION says by which method it was made: a change of what
// avatar_make gives raises it, and older ones are then made again.

enum { AVATAR_VERSION = 1 };

// The bytes of an avatar; the caller frees *bytes. ERR_MEMORY.
MUST_CHECK enum status avatar_pack(const struct avatar *avatar, uint8_t **bytes, size_t *count);

// The avatar from such bytes, of that take. ERR_CORRUPT: they are no avatar of it. ERR_MEMORY. *out is empty unless OK;
// else the caller frees it with avatar_free.
MUST_CHECK enum status avatar_unpack(struct avatar *out, const struct take *take, const void *bytes, size_t count);

// The take's avatar as the recording keeps it. NOTHING: it keeps none that this program could have made. ERR_IO,
// ERR_MEMORY. *out as above.
MUST_CHECK enum status avatar_load(struct avatar *out, const struct take *take);
// Writes such bytes into the recording at `path`; NOTHING where that cannot be written just now. ERR_MEMORY.
MUST_CHECK enum status avatar_save(const uint8_t *bytes, size_t count, const char *path, const struct take *take);

// avatar_load or, where that finds nothing, avatar_make.
MUST_CHECK enum status avatar_obtain(struct avatar *out, struct take *take, const struct source_rays *rays,
                                     const struct avatar_options *options);
