// What a camera that stands still sees of the room without the figure, kept from one image to the next: most of an
// image's work. An image is the same, bit for bit, with and without it. Internal to tests/world.
#pragma once
#include "tests/world/scene.h"

#include <stdatomic.h>

struct pixel_corner { // what the ray through a corner of pixels hits
    struct vec3 ray;  // world, z = 1 in the camera
    struct hit hit;
    int decal;
};

// Where a sample of a pixel's colour lies. Rounded: within ROOM_SAMPLE_ROUNDING.
struct room_sample {
    float u, v; // metres on the surface
    int surface;
};
#define ROOM_SAMPLE_ROUNDING 1e-5

enum { ROOM_SAMPLES = 16 }; // of a pixel that shows more than one surface, at most

struct sample_list { // of some rows of pixels
    struct room_sample *samples;
    size_t count, capacity;
};

struct still_view {
    struct lens lens;
    struct pose world_from_camera;
    struct pixel_corner *corners; // of each list, those of its rows and those below: list_rows + 1 rows of width + 1
    double *depth;                // metres along the camera's axis, at each pixel's centre
    float (*color)[3];            // linear, of each pixel
    uint32_t *first;              // of each pixel: its first sample in its list
    uint8_t *sample_count;        // of each pixel
    struct sample_list *lists;    // `list_count`, each of `list_rows` rows
    int list_count, list_rows;
    atomic_bool failed; // no memory for some of the lists
    int users;          // images that are being rendered with it
};

// A view with room for everything, not yet filled. NULL: no memory.
struct still_view *still_view_make(const struct lens *lens, struct pose world_from_camera, int list_rows);
void still_view_free(struct still_view *v); // NULL is fine

// Adds the samples of pixel `at` to list `list`.
void still_view_add(struct still_view *v, int list, size_t at, const struct room_sample *samples, int count);

// The corners above row `row` of a list, 0 to list_rows.
static inline struct pixel_corner *still_view_corners(const struct still_view *v, int list, int row)
{
    return v->corners + (size_t)(list * (v->list_rows + 1) + row) * (size_t)(v->lens.width + 1);
}

static inline const struct room_sample *still_view_samples(const struct still_view *v, int list, size_t at)
{
    return v->lists[list].samples + v->first[at];
}

// The view of the camera that was still last, and the cameras before it. Safe from any thread.
struct still_views;
struct still_views *still_views_open(void);    // NULL: no memory
void still_views_close(struct still_views *s); // NULL is fine

// What is known of a camera. *known: it was seen before, so that it pays to fill a view and to give it to
// still_views_keep. Returns the view, which still_views_leave must give back, or NULL.
struct still_view *still_views_find(struct still_views *s, const struct lens *lens, struct pose world_from_camera,
                                    bool *known);
void still_views_leave(struct still_views *s, struct still_view *view); // NULL is fine

// Owns the view from here on, which the caller uses until it calls still_views_leave.
void still_views_keep(struct still_views *s, struct still_view *view);
