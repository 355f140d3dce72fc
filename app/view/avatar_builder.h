// Makes a take's avatar (reenact/avatar/avatar.h) and the room about it (reenact/scene/occluder_mesh.h)
// beside the drawing, on threads and with handles on the recording of its own.
#pragma once
#include "reenact/avatar/avatar.h"
#include "reenact/scene/occluder_mesh.h"

struct avatar_builder;

struct avatar_builder_options {
    const char *path, *take;    // copied
    void (*notify)(void *self); // called on another thread when there is something new; may be NULL
    void *notify_self;
};
MUST_CHECK enum status avatar_builder_start(struct avatar_builder **out,
                                            const struct avatar_builder_options *options); // ERR_MEMORY
// Stops it and waits for that, a small part of a second. NULL is fine.
void avatar_builder_close(struct avatar_builder **p);

double avatar_builder_progress(const struct avatar_builder *p); // of the work that is done, 0..1

// False: not yet. True: *status says how it ended, and with OK *avatar is the
// caller's from here on; once. Fails as avatar_make and take_open do. *occluders is the
// caller's, too, and empty where there is none.
bool avatar_builder_finished(struct avatar_builder *p, struct avatar *avatar, struct occluder_mesh *occluders,
                             enum status *status);
