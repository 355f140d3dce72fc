// Makes a take's likeness (reenact/avatar/avatar.h) and the room about it (reenact/scene/occluder_mesh.h)
// beside the drawing, on threads and with handles on the recording of its own.
#pragma once
#include "reenact/avatar/avatar.h"
#include "reenact/scene/occluder_mesh.h"

struct preparation;

struct preparation_options {
    const char *path, *take;  // copied
    void (*news)(void *self); // called on another thread when there is something new; may be NULL
    void *news_self;
};
MUST_CHECK enum status preparation_start(struct preparation **out,
                                         const struct preparation_options *options); // ERR_MEMORY
// Stops it and waits for that, a small part of a second. NULL is fine.
void preparation_close(struct preparation **p);

double preparation_share(const struct preparation *p); // of the work that is done, 0..1

// False: not yet. True: *status says how it ended, and with OK *likeness is the
// caller's from here on; once. Fails as likeness_make and take_open do. *room is the
// caller's, too, and empty where there is none.
bool preparation_ended(struct preparation *p, struct likeness *likeness, struct room *room, enum status *status);
