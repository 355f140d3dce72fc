// A tracker on frames of the small world, at half a Kinect's size with its noise. An error fails the test.
#pragma once
#include "capture/tracking/tracker.h"
#include "tests/world/world.h"

// Of similar cases tests take one in this many: under an emulator an image takes seconds, and sanitizers slow it down.
#ifdef EMULATED
enum { TRACKED_EACH = 3 };
#else
enum { TRACKED_EACH = SANITIZED ? 3 : 1 };
#endif

struct tracked_film {
    struct world *world;
    struct calibration calibration;
    struct tracker *tracker;
    size_t pixels;
    uint16_t *depth;     // last frame filmed, mm
    uint8_t *truth_mask; // true mask of the figure in it
    uint8_t *mask;       // buffer for the tracker's mask
};

// figure, motion: of the small world, by name.
void tracked_film_open(struct tracked_film *f, const char *figure, const char *motion);
void tracked_film_close(struct tracked_film *f);
// Films the figure `time_s` after the start of its motion. seed: of the noise.
void tracked_film_shoot(struct tracked_film *f, struct pose world_from_camera, double time_s, uint64_t seed);

// Mean distance over the known joints; -1 when none is known.
double error_of(const struct skeleton *got, const struct skeleton *truth);
// Squared Mahalanobis distance of a joint's error by its covariance; on average 3 where that is right. Checks that the
// covariance is one.
double joint_mahalanobis_squared(const struct skeleton *got, const struct skeleton *truth, enum joint j);
int64_t nanoseconds(double seconds);
// A pose translated along its own axes.
struct pose moved(struct pose world_from_camera, struct vec3 by);
