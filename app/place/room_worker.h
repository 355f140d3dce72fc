// Reads a recording's place with its views on a thread of its own, makes the map's surface of it, and then draws the
// place's recorded views from the viewpoint that was asked for last. Nothing waits for it: what it made is fetched when
// it is there, and what was asked for in between is left out.
//
// With hand_over it draws nothing, but makes the pictures' depth, the nearest to the viewpoint first, and hands them
// over to be drawn by the graphics card.
//
// Memory: the views' pictures (3 bytes a pixel), depth for at most ROOM_DEPTHS of them (5 bytes a pixel), points 2 cm
// apart, and three pictures as drawn. 40 views of 640 x 480: below 150 MB.
#pragma once
#include "platform/screen/gpu.h"
#include "reenact/render/solid_renderer.h"
#include "reenact/scene/place_mesh.h"
#include "surround/picture/surround_picture.h"

enum { ROOM_DEPTHS = 20 };

struct room_worker;

struct room_worker_options {
    const char *path;           // of the recording
    void (*notify)(void *self); // called on the thread when there is something new; may be NULL
    void *notify_self;
    bool hand_over;
};
// ERR_MEMORY. *out is then NULL.
MUST_CHECK enum status room_worker_start(struct room_worker **out, const struct room_worker_options *options);
void room_worker_close(struct room_worker **w); // NULL is fine; waits for the thread's current step

// Draw this view next: ideal lens. As a picture that is larger than the view by ROOM_MARGIN on each side and has at
// most about ROOM_LONG pixels in a row, so that a small movement finds it filled; then, if nothing else was asked for
// meanwhile, as large as the view, up to ROOM_LONG_FINE.
#define ROOM_MARGIN 0.15
enum { ROOM_LONG = 640, ROOM_LONG_FINE = 1280 };
void room_worker_ask(struct room_worker *worker, const struct lens *lens, struct pose world_from_view);

struct room_picture {
    int64_t number; // from 1
    struct lens lens;
    struct pose world_from_view;
    float *inverse_z; // 1/m; negative: what is there was not filmed
    uint8_t *rgba;    // premultiplied, transparent where nothing was filmed
    bool final;       // a better one of this view will not come
};
// The newest, borrowed until the next call; NULL: none yet.
const struct room_picture *room_worker_latest(struct room_worker *worker);

// The present gains of the pictures in those slots. Returns a number that grows when anything is new.
int64_t room_worker_gains(struct room_worker *worker, float gains[ROOM_DEPTHS][3]);

// The map's surface, once; the caller frees it. False: not there (yet).
bool room_worker_take_mesh(struct room_worker *worker, struct place_mesh *out);

// Nothing is being worked on. views: of the place; 0: there is nothing to draw.
bool room_worker_idle(struct room_worker *worker, int *views);

// ---------------------------------------------------------------- filmed layer

// What the room worker drew last, shown from where the viewpoint is now: the picture itself where they are the same,
// else bent over its own depth (reprojection), so that the viewpoint moves at the display's rate while new pictures
// come more slowly. The GPU's thread.

struct filmed_layer;
MUST_CHECK enum status filmed_layer_open(struct filmed_layer **out, struct gpu *gpu);
void filmed_layer_close(struct filmed_layer **f); // NULL is fine

// Draws the picture into a texture of the lens's size, premultiplied, transparent where nothing was filmed; valid until
// the next call. Costs nothing where nothing has changed. ERR_DEVICE, ERR_MEMORY.
MUST_CHECK enum status filmed_layer_draw(struct filmed_layer *layer, struct solid_renderer *renderer,
                                         const struct room_picture *picture, const struct lens *lens,
                                         struct pose world_from_camera, const struct gpu_texture **out);

// ---------------------------------------------------------------- room views

// The filmed room drawn by the graphics card from where the viewpoint is now, of the pictures that the room worker has
// handed over: nothing is bent and no slits open, however fast it moves. The GPU's thread.

struct room_views;
// ERR_DEVICE: this driver cannot; ERR_MEMORY.
MUST_CHECK enum status room_views_open(struct room_views **out, struct gpu *gpu);
// NULL is fine. Before the worker is closed.
void room_views_close(struct room_views **v);

// Draws into a texture of the lens's size, premultiplied, transparent where nothing was filmed; valid until the next
// call; *out NULL: nothing has come yet. Costs nothing where nothing has changed. ERR_DEVICE, ERR_MEMORY.
MUST_CHECK enum status room_views_draw(struct room_views *views, struct room_worker *worker, const struct lens *lens,
                                       struct pose world_from_camera, const struct gpu_texture **out);
// Whether a picture waits for the next call, so that uploads do not hold up an image.
bool room_views_more(const struct room_views *views);
