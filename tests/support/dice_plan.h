// What a random short film of the small world shows, drawn from a seed: who, how moving, where, behind what. For
// measuring how often the tracked skeleton is wrong.
//
// Film `index` of a seed depends on these two, on the length and on the list of motions alone: one film can be made
// again without the others. Drawn are: the figure, uniformly; the motion, uniformly; the stretch of it, the sensor's
// height and direction and the direction the actor faces, uniformly; the situation, as dice_situation_share says; the
// place, uniformly in distance and bearing among those where the situation comes true (checked on the true joints);
// 640x480 in one film of four, else 320x240; a swept room in half of the films.
#pragma once
#include "tests/world/world.h"

enum dice_situation {
    DICE_CLEAR,     // in view all the time
    DICE_ENTERS,    // comes in from the side
    DICE_LEAVES,    // the reverse
    DICE_CUT_SIDE,  // half out of the picture, by its left or right edge
    DICE_CUT_BELOW, // close: by the lower edge, most often
    DICE_FURNITURE, // behind a table, a chest or a post
    DICE_PASSERBY,  // a second person comes from outside and walks by, in front or behind
    DICE_SITUATIONS
};
extern const double dice_situation_share[DICE_SITUATIONS]; // sum 1
const char *dice_situation_name(enum dice_situation s);

// The motions that are drawn from: the world's own, and BVH files.
struct dice_motions {
    char **name;
    int count;
    bool stays; // they do not walk: who would enter or leave is in view all the time
};
// folder NULL: the world's own alone. Sorted by name. ERR_MISSING: no BVH file there. ERR_MEMORY.
MUST_CHECK enum status dice_motions_open(struct dice_motions *m, const char *folder);
// `count` of people who sit, kneel, lie, are on all fours or prop themselves up (tests/world/posture.h), by turns, each
// of its own. ERR_MEMORY.
MUST_CHECK enum status dice_motions_open_postures(struct dice_motions *m, uint64_t seed, int count);
void dice_motions_close(struct dice_motions *m); // zeroed is fine

enum { DICE_HZ = 30, DICE_FRAMES_MOST = 600 };

// A figure, and which stretch of which motion it goes through.
struct dice_actor {
    char figure[16];
    const char *motion; // of the list
    double start_s;     // where in the motion the film begins
    struct world_spot spot;
};

struct dice_plan {
    uint64_t seed, noise_seed;
    int index, frames; // at DICE_HZ
    enum dice_situation situation;
    struct dice_actor actor, passerby; // passerby: DICE_PASSERBY only
    struct world_stand stand;
    struct world_box box[WORLD_BOXES];
    int boxes;
    double scale; // of 640 x 480
    bool swept, plain;
};

struct dice_wish {
    uint64_t seed;
    double seconds; // a film is as long, or as its motion where that is shorter
    const struct dice_motions *motions;
    bool color; // also track with body points of the colour images; needs the networks (neural/pose_network.h)
    bool plain; // as world_options.plain: films that cost less, for tests
};

// ERR_INPUT, ERR_IO, ERR_MEMORY: as world_open, a bad BVH file for example.
MUST_CHECK enum status dice_plan_draw(struct dice_plan *out, const struct dice_wish *wish, int index);

// The world that the plan describes, with that actor.
struct world_options dice_world_options(const struct dice_plan *plan, const struct dice_actor *actor);

// The direction the body faces: 0 towards the camera, positive when its own left is nearer to it; -180..180. Camera
// axes of a level camera: its x and z.
double dice_facing_degrees(const struct skeleton *in_camera);

// Whether a point in camera axes lies inside the image.
bool dice_in_image(const struct lens *lens, struct vec3 p);
