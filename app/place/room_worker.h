// Reads a recording's place with its views on a thread of its own, makes the map's surface of it, and then draws the
// place's recorded views from the viewpoint that was asked for last. Nothing waits for it: what it made is fetched when
// it is there, and what was asked for in between is left out.
//
// With hand_over it draws nothing, but makes the pictures' depth, the nearest to the viewpoint first, and hands them
// over to be drawn by the graphics card (room_views.h).
//
// Memory: the views' pictures (3 bytes a pixel), depth for at most ROOM_DEPTHS of them (5 bytes a pixel), points 2 cm
// apart, and three pictures as drawn. 40 views of 640 x 480: below 150 MB.
#pragma once
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
void room_worker_ask(struct room_worker *w, const struct lens *lens, struct pose world_from_view);

struct room_picture {
    int64_t number; // from 1
    struct lens lens;
    struct pose world_from_view;
    float *inverse_z; // 1/m; negative: what is there was not filmed
    uint8_t *rgba;    // premultiplied, transparent where nothing was filmed
    bool final;       // a better one of this view will not come
};
// The newest, borrowed until the next call; NULL: none yet.
const struct room_picture *room_worker_latest(struct room_worker *w);

// With hand_over: a picture with its depth and mesh, in place of what the caller holds in *slot, 0..ROOM_DEPTHS - 1.
// The caller closes it with room_worker_free_picture; its colours stay the worker's, until that is closed. False: none
// is new.
bool room_worker_take_picture(struct room_worker *w, int *slot, struct surround_picture *out);
void room_worker_free_picture(struct surround_picture *p); // what was zeroed, too
// The present gains of the pictures in those slots. Returns a number that grows when anything is new.
int64_t room_worker_gains(struct room_worker *w, float gains[ROOM_DEPTHS][3]);

// The map's surface, once; the caller frees it. False: not there (yet).
bool room_worker_take_mesh(struct room_worker *w, struct place_mesh *out);

// Nothing is being worked on. views: of the place; 0: there is nothing to draw.
bool room_worker_idle(struct room_worker *w, int *views);
