// What a robot's operator sees (drive_session.h), drawn by the graphics card at a display's rate: the surroundings with
// the overlay. The line to what is nearest is that of the image before, which the graphics card has done by then.
// Threads, errors as in platform/screen/gpu.h.
#pragma once
#include "platform/screen/gpu.h"
#include "surround/drive/drive_session.h"

struct operator_picture;
MUST_CHECK enum status operator_picture_open(struct operator_picture **out, struct gpu *gpu);
void operator_picture_close(struct operator_picture **o); // NULL is fine

// All that the session's own picture shows, in width x height pixels. Opaque; valid until the next call. ERR_DEVICE,
// ERR_MEMORY, and as drive_session_draw.
MUST_CHECK enum status operator_picture_draw(struct operator_picture *picture, struct drive_session *session, int width,
                                             int height, const struct gpu_texture **out);
// Through which lens, and from where, the last one is seen.
void operator_picture_view(const struct operator_picture *picture, struct lens *lens, struct pose *world_from_view);
