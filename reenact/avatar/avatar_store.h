// Keeps an avatar in the recording (recording/prepared.h), so that a take that was prepared once opens
// immediately. What is read back is the avatar that was written, bit for bit, but for the scratch memory of fusion: its
// TSDF can be sampled and no longer be fused into. AVATAR_VERSION says by which method it was made: a change of what
// avatar_make gives raises it, and older ones are then made again.
#pragma once
#include "reenact/avatar/avatar.h"

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
