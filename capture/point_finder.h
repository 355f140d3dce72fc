// Body points of a sensor's colour images (body_points.h), found by a network on a thread of its own at lower priority,
// so that no frame waits for them. It looks at the newest image when it is free: at most at every LOOK_EVERY_th, and
// for at most a quarter of the time. The points are there one or more frames after their image; point_motion.h makes up
// for that.
//
// Where the networks are missing nothing is looked for, and point_finder_query says why. One thread calls all
// functions. Memory: one image, and the network's.
#pragma once
#include "capture/body/point_evidence.h"

struct point_finder;

struct point_finder_options {
    int width, height; // of the colour images
    // In place of the network, for tests; called on the thread, returns as body_points_of_image. NULL: the network
    enum status (*find)(void *self, const uint8_t *rgb, int width, int height, struct body_points *out);
    void *find_self;
};
// ERR_MEMORY: *out is NULL.
MUST_CHECK enum status point_finder_open(struct point_finder **out, const struct point_finder_options *options);
void point_finder_close(struct point_finder **p); // NULL is fine; waits for the thread

// An image of the film. Copies it where it is to be looked at.
void point_finder_offer(struct point_finder *p, int64_t time_ns, const uint8_t *rgb);

// The points that were found last, once, and the time of their image. False: none since the last call.
bool point_finder_take(struct point_finder *p, int64_t *time_ns, struct body_points *out);

// The next image has nothing to do with the last.
void point_finder_restart(struct point_finder *p);

struct point_finder_state {
    int64_t looked;    // images
    double looked_ms;  // the time this took, sum
    char why_not[256]; // why none are looked for; "": they are
};
struct point_finder_state point_finder_query(struct point_finder *p);
