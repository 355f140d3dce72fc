// The viewer's part for the room about the actor: the recording's things, its filmed views behind an orbit, and the
// map. What takes long runs on threads (room_worker, knowledge_asker); nothing here waits for them. Used by viewer.c
// alone.
#pragma once
#include "app/place/place_things.h"
#include "app/place/room_worker.h"
#include "app/ui/room_page.h"
#include "recording/recorded_things.h"

// ---------------------------------------------------------------- room things

// A recording's things as a map shows them: what is drawn of each over it, and their bodies on the GPU. The GPU's
// thread.

struct room_things {
    struct place_things known;
    struct room_thing *shown;   // of each
    struct thing_solid *solids; // of each, opened when first drawn
    bool *opened;
};

// What of them is damaged is no error: there are none then. ERR_MEMORY; room_things_close is needed then, too.
MUST_CHECK enum status room_things_open(struct room_things *out, struct recording *recording);
void room_things_close(struct room_things *things); // zeroed is fine

// All bodies, in the place's world.
void room_things_draw(struct room_things *things, struct gpu *gpu, struct solid_renderer *renderer,
                      const struct solid_view *view);

// ---------------------------------------------------------------- viewer room

struct viewer;
struct viewer_surface;

enum { VIEWER_PATH_MAX = 512 };

struct viewer_room {
    struct room_things things;
    struct gpu_texture **pictures; // of each thing, opened when first shown
    struct overlay_group *asked;   // points of each, of which is asked whether they are seen
    struct overlay overlay;
    bool seen_comes; // what was asked has not been read yet
    struct solid_renderer *renderer;
    struct gpu_target *turning; // the card's body

    struct room_worker *worker;
    struct room_views *views; // NULL: the worker draws, and `filmed` shows that
    struct filmed_layer *filmed;
    struct lens asked_lens; // of the worker
    struct pose asked_pose, seen_pose;
    int64_t seen_number; // of the worker's picture at the last update
    int64_t still_ns;    // since when the viewpoint has not moved

    struct solid_mesh *mesh;         // of the place
    struct vec3 mesh_low, mesh_high; // its bounds
    bool mesh_came;
    struct gpu_target *surface; // the mesh behind the orbit
    struct lens surface_lens;
    struct pose surface_pose; // that it shows
    bool surface_drawn;
    struct gpu_target *map;
    struct lens map_lens;
    struct pose map_pose; // that the map shows
    bool map_drawn;
    struct vec3 path[VIEWER_PATH_MAX];
    int path_count;
    struct recorded_drive drive;
    bool driven; // a robot was, in the place

    struct knowledge_asker *asker;
    int asked_thing; // whose card was open at the last update
    struct thing_card card;
    char source[320];
    struct room_page page;
};

// Reads the recording's things. What of them is damaged is no error: there are none then. ERR_DEVICE, ERR_MEMORY.
MUST_CHECK enum status viewer_room_open(struct viewer *v);
void viewer_room_close(struct viewer *viewer);
// Fetches what the threads have made.
void viewer_room_update(struct viewer *viewer, int64_t now_ns);

// The recorded views behind an orbit, as seen by the request; *out NULL: there are none (yet). ERR_DEVICE, ERR_MEMORY.
MUST_CHECK enum status viewer_room_draw_filmed(struct viewer *v, const struct take_view_request *request,
                                               int64_t now_ns, const struct gpu_texture **out);
// The map's surface as seen by the request, and the room's bounds, into the image: what is behind the recorded views
// where they show nothing. ERR_DEVICE, ERR_MEMORY.
MUST_CHECK enum status viewer_room_draw_surface(struct viewer *v, const struct take_view_request *request,
                                                struct take_view_image *out);
// Asks with the request which things are seen in its picture; the answer is read before the next one is drawn, when the
// GPU has it.
void viewer_room_ask_seen(struct viewer *viewer, struct take_view_request *request);
MUST_CHECK enum status viewer_room_read_seen(struct viewer *v); // ERR_DEVICE

// Fills room.page, with the map and the card's pictures where they are open. ERR_DEVICE, ERR_MEMORY.
MUST_CHECK enum status viewer_room_draw(struct viewer *v, const struct viewer_surface *surface, int64_t now_ns);

// Whether the recorded views are to be shown behind the orbit.
bool viewer_room_wants_filmed(const struct viewer *viewer);
