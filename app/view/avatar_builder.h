// Builds a take's avatar (reenact/avatar/avatar.h) and the room's occluder mesh (reenact/scene/occluder_mesh.h) in the
// background: on two threads, each with its own handle on the recording, which share the index of the take that is
// being watched.
#pragma once
#include "reenact/avatar/avatar.h"
#include "reenact/scene/occluder_mesh.h"

struct avatar_builder;

struct avatar_builder_options {
    const char *path;           // of the recording, copied
    const struct take *take;    // its index is shared; borrowed, must outlive the builder
    void (*notify)(void *self); // called on another thread on progress and at the end; may be NULL
    void *notify_self;
};
// ERR_MEMORY: *out is then NULL.
MUST_CHECK enum status avatar_builder_start(struct avatar_builder **out, const struct avatar_builder_options *options);
// Cancels the work and waits until its threads have ended, a small part of a second. NULL is fine; sets *p = NULL.
void avatar_builder_close(struct avatar_builder **p);

double avatar_builder_progress(const struct avatar_builder *p); // share of the avatar's work that is done, 0..1

// False: not ended yet. True: *status says how it ended; with OK *avatar is the caller's from here on, and only at the
// first call. NOTHING: too little of the actor was seen, or the take has no depth. Errors: as recording_open,
// take_open_shared and avatar_make. *occluders is the caller's, too, and empty where there is no mesh.
bool avatar_builder_finished(struct avatar_builder *p, struct avatar *avatar, struct occluder_mesh *occluders,
                             enum status *status);
