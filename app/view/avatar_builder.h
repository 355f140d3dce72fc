// Gets a take's avatar (reenact/avatar/avatar.h) and the room's occluder mesh (reenact/scene/occluder_mesh.h) in the
// background: on two threads, each with its own handle on the recording, which share the index of the take that is
// being watched. The avatar that the recording keeps (avatar.h) is there immediately; else, as far as they are wanted,
// a simple one comes first, then the full one, which is then kept in the recording, where that can be written.
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

enum avatar_wanted { AVATAR_WANTED_NONE, AVATAR_WANTED_SIMPLE, AVATAR_WANTED_FULL };

// Begins to make what is not there: the room's mesh and the avatars up to the one that is wanted; called again, more of
// them, never less. Until then only the kept avatar is read, so that the first picture has the processor for itself.
void avatar_builder_begin(struct avatar_builder *builder, enum avatar_wanted wanted);

double
avatar_builder_progress(const struct avatar_builder *builder); // share of the full avatar's work that is done, 0..1

// Waits until the kept avatar is there or it is known that there is none; at most that long.
void avatar_builder_await_kept(struct avatar_builder *builder, int64_t max_ns);

enum avatar_news {
    AVATAR_NO_NEWS,
    AVATAR_SIMPLE, // *avatar is the caller's, until a better one comes
    AVATAR_FULL,   // the last news: *status says how it ended, and with OK *avatar is the caller's
};
// *status: NOTHING: too little of the actor was seen, or the take has no depth. Errors: as recording_open,
// take_open_shared and avatar_make.
enum avatar_news avatar_builder_take(struct avatar_builder *builder, struct avatar *avatar, enum status *status);

// True, once: *occluders is the caller's; empty where there is no mesh.
bool avatar_builder_take_occluders(struct avatar_builder *builder, struct occluder_mesh *occluders);

// Once they have ended: OK: the recording keeps the full avatar, or there is none. ERR_IO: it cannot be written now.
// ERR_MEMORY.
MUST_CHECK enum status avatar_builder_kept(struct avatar_builder *builder);

// The threads have ended. What they made may still be taken.
bool avatar_builder_ended(const struct avatar_builder *builder);
