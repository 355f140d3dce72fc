// How a wheeled robot moves, and the link that its commands and pictures take. Pure: times are given.
#pragma once
#include "base/geometry.h"

struct drive_command {
    double speed;     // m/s ahead
    double turn_rate; // rad/s to the left
};

// The pose after `seconds` of a constant command: an arc.
struct pose robot_motion_after(struct pose world_from_body, struct drive_command c, double seconds);

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
