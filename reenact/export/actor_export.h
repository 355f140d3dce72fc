// The actor of a take for other programs: the avatar (reenact/avatar/avatar.h) as an animated, skinned, textured
// glTF 2.0 model, as a page that shows that model in a browser, and as a mesh of one instant.
//
// The model is the texture atlas's mesh under the bones of bind_pose.h by linear blend skinning, as it is drawn without
// a frame layer: the joints, corrected where frames were registered, without the frames' non-rigid deformation. With an
// armature (armature.h) the mesh stands in its T-pose and is moved by its bones, of constant length. Colours
// are those under mean light (KHR_materials_unlit). y up, metres, seconds since the take's first frame; one key for
// each frame with a skeleton. Pure but for the take, of which only the index is read; the same take and avatar give the
// same bytes.
#pragma once
#include "reenact/avatar/avatar.h"
#include "reenact/export/armature.h"
#include "reenact/skeleton/skeleton_track.h"

#include <stdio.h>

struct actor_export {
    const struct take *take;
    const struct take_skeletons *skeletons;
    const struct skeleton_track *track;
    const struct avatar *avatar;
    const char *name;                     // of the take
    const enum armature_naming *armature; // NULL: the avatar's own bones, each where the joints have it
};

// The bytes of a .glb; the caller frees *bytes. ERR_INPUT: no frame's trunk is known; with an armature, a limb never
// is. ERR_MEMORY.
MUST_CHECK enum status actor_export_glb(const struct actor_export *export, uint8_t **bytes, size_t *count);

// An HTML page with that .glb in it and a viewer (WebGL 2), which needs nothing else: no network, no other file.
void actor_export_page(const char *name, const uint8_t *glb, size_t count, FILE *out);

// The avatar's surface at a frame, with its vertex colours, in the world's axes, as PLY. NOTHING: the frame's trunk is
// not known. ERR_MEMORY.
MUST_CHECK enum status actor_export_mesh_ply(const struct actor_export *export, int64_t frame, FILE *out);
