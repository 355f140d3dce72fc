// A ROS master and a simulated robot on it (tests/ros_robot), as processes of their own. Errors fail the test.
#pragma once
#include "base/status.h"

#include <sys/types.h>

struct ros_stage {
    char folder[64], calibration[128], truth[128], uri[64]; // uri: ros:http://…
    pid_t master, rover;
    struct {
        double seconds, x, y, heading, speed; // the robot's own; seconds: its clock
        int touched;
    } is;
};

// False: ROS is not there.
bool ros_stage_available(void);
// robot: the simulated one's program, ros-rover. patience_s: how long that drives on without a command, as "0.5".
void ros_stage_open(struct ros_stage *r, const char *robot, const char *patience_s);
void ros_stage_close(struct ros_stage *r); // zeroed is fine, also after a failed test

// Reads what the robot says of itself into r->is. False: not now.
bool ros_stage_read(struct ros_stage *r);
