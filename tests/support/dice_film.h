// A random short film (dice_plan.h), filmed and tracked as `record` does, next to the truth.
#pragma once
#include "tests/support/dice_plan.h"
#include "tests/support/smoothed_film.h"

// How a true joint shows in the depth image, by the exact depth at its pixel.
enum dice_sight {
    DICE_VISIBLE, // no deeper under the actor's visible surface than the body is thick there
    DICE_HIDDEN,  // by the actor's own body
    DICE_BLOCKED, // by furniture or by the passer-by
    DICE_OUTSIDE, // of the image
};
// A joint can be seen at all: visible, or hidden by the own body only.
static inline bool dice_can_be_seen(enum dice_sight s) { return s == DICE_VISIBLE || s == DICE_HIDDEN; }

// From depth alone, and with body points of every third colour image, as `record` has them.
enum dice_mode {
    DICE_ONLINE,
    DICE_SMOOTHED,
    DICE_ALONE, // the network's joints of each image alone, where a person is followed
    DICE_DEPTH_MODES,
    DICE_COLOR_ONLINE = DICE_DEPTH_MODES,
    DICE_COLOR_SMOOTHED,
    DICE_MODES
};
const char *dice_mode_name(enum dice_mode m);

struct dice_frame {
    struct skeleton truth, passerby;   // colour camera's axes; passerby: all confidence 0 where there is none
    struct skeleton track[DICE_MODES]; // all confidence 0: no person was found
    enum dice_sight sight[JOINT_COUNT];
    double facing_degrees; // dice_facing_degrees of the truth
    double distance_m;     // of the true waist, level
    struct film_evidence evidence;
};

struct dice_film {
    struct dice_plan plan;
    struct dice_frame *frame;   // plan.frames
    int modes;                  // DICE_DEPTH_MODES or DICE_MODES: that many are in the frames
    double filmed_s, tracked_s; // processor time
    struct failure failure;     // of this film alone; then there are no frames
};

struct dice_request {
    struct dice_wish wish;
    int first, count; // the films' indices
    int threads;      // the results do not depend on it
    bool shown;       // counts films on the standard error stream while they are made
};

// out: `count` films, in order; each is freed with dice_film_free, failed or not. A film's failure is in it.
void dice_films_make(struct dice_film *out, const struct dice_request *request);
void dice_film_free(struct dice_film *f);

// ---------------------------------------------------------------- the images of a film

struct dice_camera {
    struct dice_plan plan;
    struct world *world, *passerby; // passerby: NULL where there is none
    struct calibration calibration;
    struct pose world_from_camera;
    // The last frame shot, with colour (RGB) where it was asked for.
    uint16_t *exact, *depth;  // mm: without and with the sensor's noise
    uint8_t *mask, *color;    // mask: 1 on the actor, 2 on the passer-by
    uint16_t *passerby_depth; // buffers
    uint8_t *passerby_mask, *passerby_color;
};

MUST_CHECK enum status dice_camera_open(struct dice_camera *c, const struct dice_plan *plan); // on error it is empty
void dice_camera_close(struct dice_camera *c);
MUST_CHECK enum status dice_camera_shoot(struct dice_camera *c, int frame, bool color);
// The empty room's depth, exact as a place's map has it; lens.width * lens.height.
MUST_CHECK enum status dice_camera_background(const struct dice_camera *c, uint16_t *depth);
