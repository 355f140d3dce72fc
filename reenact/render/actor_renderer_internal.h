// The actor renderer's state and its render targets; for actor_renderer.c, actor_targets.c and actor_overlay.c only.
#pragma once
#include "reenact/render/actor_renderer_live.h"
#include "reenact/render/avatar_renderer.h"
#include "reenact/render/cylinder_renderer.h"
#include "reenact/render/occlusion_shadow.h"
#include "reenact/skeleton/skeleton_track.h"

struct renderer {
    struct gpu *gpu;
    struct take *take;
    struct lens lens, drawn; // the viewer camera's; the same at `resolution_scale`, which is drawn with
    double resolution_scale; // per axis
    enum detail detail;
    struct take_skeletons *own_skeletons; // NULL: the options gave them
    const struct take_skeletons *skeletons;
    struct skeleton_track *motion;
    struct cylinder_renderer *cylinders;
    struct source_rays *rays; // NULL: the take has no depth
    struct occlusion_shadow *occlusion;
    struct avatar_renderer *avatar; // NULL: the take shows too little for an avatar; rounded cylinders then
    struct gpu_program *compose_program;
    struct gpu_mesh *fullscreen; // one triangle over the whole target
    struct gpu_texture *camera;
    struct gpu_target *paper, *full, *composed; // actor at DETAIL_PAPER, at DETAIL_FULL, composed image
    struct gpu_target *actor;                   // `paper` or `full`, whichever was drawn last
    struct gpu_target *room_depth;              // occluder mesh's depth for DETAIL_FULL; NULL: no room
    bool room_drawn;                            // it is not empty
    struct gpu_target *shadow;                  // NULL: not wanted
    struct gpu_texture *no_shadow;              // one transparent pixel
    bool shaded;                                // the image last drawn has a shadow
    struct depth_overlay *overlay;              // NULL: none was drawn yet, as the following
    struct gpu_target *strokes;
    bool stroked;              // the image last drawn has strokes
    struct gpu_target *source; // as renderer_read_source; NULL: not wanted
    bool writes_source;        // wanted for the next image
    bool upload_pending;       // waiting for the avatar or its upload
    bool avatar_later;         // renderer_set_avatar gives it
    double error_px;           // predicted error that DETAIL_AUTO accepts
    double cylinder_error_m;   // of the cylinders against the avatar's surface
};

// Opens the render targets at the lens's size. ERR_DEVICE, ERR_MEMORY; close them then, too.
MUST_CHECK enum status actor_targets_open(struct renderer *p, bool sources, bool shadow);
MUST_CHECK enum status actor_targets_open_room_depth(struct renderer *p);
void actor_targets_close(struct renderer *p);
// Where the room's depth is drawn that hides p->actor: into p->room_depth, or into its own.
struct gpu_target *actor_targets_room(const struct renderer *p);

// Applies the resolution scale and the lens to targets and renderers. Targets keep their allocation
// at the lens's size and use their top left, so that nothing is allocated when the scale changes.
void actor_targets_apply_scale(struct renderer *p);

// Draws view->overlay over the actor just drawn, and the depth of the room that may hide it. ERR_DEVICE, ERR_MEMORY.
MUST_CHECK enum status actor_overlay_draw(struct renderer *p, const struct renderer_view *view);
