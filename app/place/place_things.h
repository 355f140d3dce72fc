// The things of a recording as the app shows them: from the file, so that they are there without the network. On wish a
// thread asks the address that the file gives for what is newer, and writes it into the file; nothing waits for it, and
// what fails says why.
#pragma once
#include "base/linear_algebra.h"
#include "formats/glb_reader.h"
#include "objects/thing_knowledge.h"
#include "recording/recording.h"
#include "reenact/render/solid_renderer.h"

struct place_thing {
    char name[64], note[1024], url[512], etag[128];
    struct pose world_from_thing;
    struct covariance3 covariance;
    double width_m, height_m, sigma_m; // sigma: the largest standard deviation of its position
    int sightings;
    bool gone;
    bool known;  // `knowledge` says something
    bool unkept; // which came from the server, and the recording could not be written
    struct thing_knowledge knowledge;
    char trouble[256];    // why nothing newer came; "" none
    struct image picture; // width 0: none
    struct glb_model model;
};

struct place_things {
    struct place_thing *things;
    int count;
};

// Pictures and models that cannot be read are left out. As recording_read_things; on error there are none.
MUST_CHECK enum status place_things_read(struct recording *recording, struct place_things *out);
void place_things_free(struct place_things *things); // zeroed is fine

// The largest standard deviation of a covariance in any direction: the longest half axis of its ellipsoid.
double covariance_largest_sigma(const struct covariance3 *covariance3);
// The half axes of the 95 % ellipsoid, metres, longest first, world axes.
void covariance_ellipsoid(const struct covariance3 *covariance3, struct vec3 axes[3]);

struct knowledge_asker;
struct knowledge_asker_options {
    const char *file; // the recording, in which answers are kept where it can be written; NULL: none are
    struct http_limits limits;
    void (*notify)(void *self); // on the thread: there is an answer; may be NULL
    void *notify_self;
};
// ERR_MEMORY; *out is then NULL.
MUST_CHECK enum status knowledge_asker_start(struct knowledge_asker **out,
                                             const struct knowledge_asker_options *options);
// NULL is fine. Does not wait for a request that runs: its thread ends with it, and notifies of nothing more.
void knowledge_asker_close(struct knowledge_asker **a);
// Asks for that thing next, in place of one that waits; does not block.
void knowledge_asker_ask(struct knowledge_asker *asker, int index, const struct place_thing *thing);
// Puts an answer that came into its thing; returns the thing's index, or -1. Does not block.
int knowledge_asker_take(struct knowledge_asker *asker, struct place_things *things);
bool knowledge_asker_asks(struct knowledge_asker *asker, int index); // a request for it waits or runs

// ---------------------------------------------------------------- thing solid

// A thing as a body on the GPU: its model where the recording keeps one, else a box of its size with its picture on the
// front. The GPU's thread.

struct thing_solid {
    struct solid_mesh *parts[GLB_MAX_PARTS];
    struct gpu_texture *pictures[GLB_MAX_PARTS]; // NULL: none
    bool two_sided[GLB_MAX_PARTS];
    int count;
    bool is_model;
    struct vec3 low, high; // bounds in the thing's axes, metres
};

// ERR_DEVICE, ERR_MEMORY. On error *out is zeroed.
MUST_CHECK enum status thing_solid_open(struct thing_solid *out, struct gpu *gpu, const struct place_thing *thing);
void thing_solid_close(struct thing_solid *solid); // zeroed is fine

void thing_solid_draw(const struct thing_solid *solid, struct solid_renderer *renderer, const struct solid_view *view,
                      struct pose world_from_thing);

// Alone, turned by `angle` about its vertical axis, in the middle of the target, which is cleared.
void thing_solid_draw_turning(const struct thing_solid *solid, struct solid_renderer *renderer,
                              struct gpu_target *target, double angle);
