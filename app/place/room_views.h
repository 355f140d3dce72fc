// The filmed room drawn by the graphics card from where the viewpoint is now, of the pictures that the room worker has
// handed over: nothing is bent and no slits open, however fast it moves. The GPU's thread.
#pragma once
#include "app/place/room_worker.h"
#include "platform/screen/gpu.h"

struct room_views;
// ERR_DEVICE: this driver cannot; ERR_MEMORY.
MUST_CHECK enum status room_views_open(struct room_views **out, struct gpu *gpu);
// NULL is fine. Before the worker is closed.
void room_views_close(struct room_views **v);

// Draws into a texture of the lens's size, premultiplied, transparent where nothing was filmed; valid until the next
// call; *out NULL: nothing has come yet. Costs nothing where nothing has changed. ERR_DEVICE, ERR_MEMORY.
MUST_CHECK enum status room_views_draw(struct room_views *v, struct room_worker *worker, const struct lens *lens,
                                       struct pose world_from_camera, const struct gpu_texture **out);
// Whether a picture waits for the next call, so that uploads do not hold up an image.
bool room_views_more(const struct room_views *v);
