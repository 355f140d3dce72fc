// Body points of a sensor's colour images, found by a network on a thread of its own at lower priority,
// so that no frame waits for them. It looks at the newest image when it is free: at most at every LOOK_EVERY_th, and
// for at most a quarter of the time. The points are there one or more frames after their image; point_motion below
// makes up for that.
//
// Where the networks are missing nothing is looked for, and point_finder_query says why. One thread calls all
// functions. Memory: one image, and the network's.
#pragma once
#include "capture/body/point_evidence.h"
#include "neural/pose_network.h"
#include "recording/skeleton.h"

// ---------------------------------------------------------------- body points

// Body points of a colour image, as the tracker takes them (tracker_set_body_points), found by a pre-trained network.

// Looks for a person's points in the next image of a film (else call pose_network_restart before); rgb: width x height,
// 3 bytes a pixel. OK: *out says where they are, or that there is no person. NOTHING: the image is too dark to tell,
// and the tracker is to be given none.
MUST_CHECK enum status body_points_of_image(struct pose_network *network, const uint8_t *rgb, int width, int height,
                                            struct body_points *out);

// ---------------------------------------------------------------- point motion

// Body points of an image that is some frames old, moved to where they are by now: each goes by what its joint has gone
// in the image since, as tracked, and as it goes on at constant velocity from the last tracked frame to the next. Pure.

enum { POINT_MOTION_FRAMES = 12 };
#define POINT_MOTION_MAX_NS INT64_C(300000000) // older points are of no use

struct tracked_frame {
    int64_t time_ns;
    bool person;
    struct vec3 joint[JOINT_COUNT]; // colour camera's axes
    float confidence[JOINT_COUNT];
};

struct point_motion {
    struct tracked_frame at[POINT_MOTION_FRAMES]; // a ring
    int next, count;
};

// skeleton: colour camera's axes; NULL: no person.
void point_motion_add(struct point_motion *motion, int64_t time_ns, const struct skeleton *skeleton);
void point_motion_clear(struct point_motion *motion);

// Moves the points of the image at `from_ns` to now_ns, which is not before it. False: they are too old, or of no frame
// that was added, unless it is now_ns's own. Points whose joints were not known then and last stay where they are.
bool point_motion_apply(const struct point_motion *motion, const struct lens *color, int64_t from_ns, int64_t now_ns,
                        struct body_points *points);

// ---------------------------------------------------------------- point finder

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
void point_finder_offer(struct point_finder *finder, int64_t time_ns, const uint8_t *rgb);

// The points that were found last, once, and the time of their image. False: none since the last call.
bool point_finder_take(struct point_finder *finder, int64_t *time_ns, struct body_points *out);

// The next image has nothing to do with the last.
void point_finder_restart(struct point_finder *finder);

struct point_finder_state {
    int64_t looked;    // images
    double looked_ms;  // the time this took, sum
    char why_not[256]; // why none are looked for; "": they are
};
struct point_finder_state point_finder_query(struct point_finder *finder);
