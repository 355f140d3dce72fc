// How a wheeled robot moves, and the link that its commands and pictures take. Pure: times are given.
#pragma once
#include "base/geometry.h"

// ---------------------------------------------------------------- head tracker

// The tablet as a head tracker: how it moves and turns in its own place, the eye moves and turns about the robot. Where
// the tablet is when it is centred, and which way it looks then, is the viewpoint's place, looking ahead; up stays up.
// Pure.

struct head_tracker {
    bool centred;
    struct vec3 origin; // the tablet's, in its place
    double c, s;        // cosine and sine of the way it looked
};

// place_from_camera: axes x right, y down, z ahead; the place's z is up. viewpoint: where the eye is in the body's axes
// (x ahead, y left, z up) with the tablet at its origin. The first call, and the first after `centred` is cleared,
// centres. Returns body_from_eye, the eye's axes as the camera's.
struct pose head_tracker_eye(struct head_tracker *tracker, struct pose place_from_camera, struct vec3 viewpoint);

// ---------------------------------------------------------------- drive path

// Where a robot has been, as a line on the floor of bounded length in memory: when it is full every second point goes,
// and points are kept twice as far apart from then on. Pure.

enum { DRIVE_PATH_POINTS = 256 };

struct drive_path {                    // zeroed: empty
    struct vec3 at[DRIVE_PATH_POINTS]; // world, m; the first where it began
    int count;
    double spacing_m; // least distance between neighbours
};

void drive_path_add(struct drive_path *path, struct vec3 at);

// ---------------------------------------------------------------- robot motion

struct drive_command {
    double speed;     // m/s ahead
    double turn_rate; // rad/s to the left
};

// The pose after `seconds` of a constant command: an arc.
struct pose robot_motion_after(struct pose world_from_body, struct drive_command command, double seconds);

// A link with delay and loss. Whether packet `number` arrives is a fixed function of the number and the seed.
struct drive_link {
    double delay_s; // one way
    double loss;    // share of packets lost, 0..1
    uint32_t seed;
};
bool drive_link_delivers(const struct drive_link *link, uint32_t number);

// What a robot does about its link: without a command for `patience_s` it stops.
struct link_watch {
    double patience_s; // 0.5
    int64_t heard_ns;  // when the last command arrived
    bool heard;        // one has arrived
};
// The command to carry out at `now_ns`; *lost: the link is, and the robot stands.
struct drive_command link_watch_command(const struct link_watch *watch, struct drive_command last, int64_t now_ns,
                                        bool *lost);
