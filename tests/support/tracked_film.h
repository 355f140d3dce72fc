// A tracker before a film of the small world, at half a Kinect's size with its
// noise. What fails is a failed check of the test that asks for it.
#pragma once
#include "tests/world/world.h"

#include "capture/tracking/tracker.h"

// Of cases of one kind, tests take one in so many: in an emulated machine a picture takes seconds.
#ifdef EMULATED
enum { TRACKED_EACH = 3 };
#else
enum { TRACKED_EACH = 1 };
#endif

struct tracked_film {
    struct world *world;
    struct calibration calibration;
    struct tracker *tracker;
    size_t pixels;
    uint16_t *depth;     // as filmed last, mm
    uint8_t *truth_mask; // the figure in it
    uint8_t *mask;       // room for what the tracker says
};

// figure, motion: of the small world, by name.
void tracked_film_open(struct tracked_film *f, const char *figure, const char *motion);
void tracked_film_close(struct tracked_film *f);
// Films the figure `time_s` after its motion began. seed: of the noise.
void tracked_film_shoot(struct tracked_film *f, struct pose world_from_camera, double time_s, uint64_t seed);

// Mean distance over the joints that are known; -1 when none is.
double error_of(const struct skeleton *got, const struct skeleton *truth);
int64_t nanoseconds(double seconds);
// A pose moved along its own axes.
struct pose moved(struct pose world_from_camera, struct vec3 by);
